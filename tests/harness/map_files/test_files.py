"""Map files, read back by the readers of others and by our own."""

import re
from pathlib import Path

import numpy as np
import pyoctomap
import pytest
from PIL import Image
from ruamel.yaml import YAML

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.map_files.files import (
    WRITERS,
    cells_of,
    moment_at,
    plane_of,
    write_map,
    write_nav2,
)
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, VoxelMap
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.options import ImportOptions

LOG = Path(__file__).parents[1] / "logs/small.mcap"


@pytest.fixture(scope="module")
def log():
    return open_log(LOG)


@pytest.fixture(scope="module")
def moment(log):
    return moment_at(log, None)


@pytest.fixture(scope="module")
def cells(log, moment):
    return cells_of(log, moment)


def nav2_states(path):
    """States (nx, ny) as Nav2's loader has them: map_io.cpp, mode trinary, by other libraries."""
    described = YAML(typ="safe").load(path)
    assert described["mode"] == "trinary"
    assert not described["negate"]
    grey = np.asarray(Image.open(path.parent / described["image"]), np.float64)
    occupancy = (255.0 - grey) / 255.0
    states = np.full(grey.shape, UNKNOWN, np.uint8)
    states[occupancy > described["occupied_thresh"]] = OCCUPIED
    states[occupancy < described["free_thresh"]] = FREE
    return states[::-1].T, described


def test_nav2_reads_the_states_of_the_plane(tmp_path, log, moment):
    flat, costmap = plane_of(moment), moment.costmap
    assert set(np.unique(flat)) == {UNKNOWN, FREE, OCCUPIED}
    decision, count = write_map(log, tmp_path / "m.yaml")
    states, described = nav2_states(tmp_path / "m.yaml")
    assert np.array_equal(states, flat)
    assert described["resolution"] == costmap.resolution
    assert described["origin"] == [*costmap.origin[:2].tolist(), 0]
    assert (decision, count) == (moment.decision.sequence, states.size)


def test_our_import_has_a_wall_where_the_plane_is_occupied(tmp_path, log, moment):
    flat, costmap = plane_of(moment), moment.costmap
    write_map(log, tmp_path / "m.yaml")
    options = ImportOptions(height=1.0, unknown="free")
    found, notes = import_world(tmp_path / "m.yaml", options, (1.0, 1.0, 0.0), (2.0, 2.0, 0.0))
    occupied = np.zeros(flat.shape, bool)
    for part in found.solids:
        if part.kind == "floor":
            continue
        middle, half = np.array(part.centre[:2]), np.array(part.half_extents[:2])
        low = np.rint((middle - half - costmap.origin[:2]) / costmap.resolution).astype(int)
        high = np.rint((middle + half - costmap.origin[:2]) / costmap.resolution).astype(int)
        occupied[low[0] : high[0], low[1] : high[1]] = True
    assert np.array_equal(occupied, flat == OCCUPIED)
    counted = (flat == OCCUPIED).sum(), (flat == UNKNOWN).sum()
    assert f"{counted[0]} cells occupied, {counted[1]} unknown, taken as free" in notes


def test_unknown_cells_are_unknown_under_every_threshold_that_is_written(tmp_path):
    states = np.array([[UNKNOWN, FREE], [OCCUPIED, UNKNOWN], [FREE, FREE]], np.uint8)
    write_nav2(states, np.array([-1.5, 0.25]), 0.05, tmp_path / "a.yaml")
    read, described = nav2_states(tmp_path / "a.yaml")
    assert np.array_equal(read, states)
    assert described["origin"] == [-1.5, 0.25, 0]
    assert (255 - 205) / 255 > described["free_thresh"]
    with pytest.raises(InputError, match="expected one without"):
        write_nav2(states, np.zeros(2), 0.05, tmp_path / "a#b.yaml")


def test_octomap_has_the_same_cells(tmp_path, log, cells):
    write_map(log, tmp_path / "m.bt")
    tree = pyoctomap.OcTree(1.0)
    assert tree.readBinary(str(tmp_path / "m.bt"))
    assert tree.getResolution() == cells.resolution
    states = np.zeros(cells.states.shape, np.uint8)
    for leaf in tree.begin_leafs():
        half = leaf.getSize() / 2.0
        low = np.rint((np.array(leaf.getCoordinate()) - half) / cells.resolution).astype(int)
        side = round(leaf.getSize() / cells.resolution)
        first = low + np.array([0, 0, 1]) - np.array(cells.first)  # a layer of ours is one higher
        state = OCCUPIED if tree.isNodeOccupied(leaf) else FREE
        box = tuple(slice(at, at + side) for at in first)
        assert (states[box] == UNKNOWN).all()
        states[box] = state
    assert np.array_equal(states, cells.states)


@pytest.mark.parametrize("ending", ["pcd", "ply"])
def test_points_are_the_centres_of_the_occupied_cells(tmp_path, log, cells, moment, ending):
    path = tmp_path / f"m.{ending}"
    write_map(log, path)
    data = path.read_bytes()
    end = {"pcd": b"DATA binary\n", "ply": b"end_header\n"}[ending]
    place = data.index(end) + len(end)
    count = int(re.search(rb"(?:POINTS|vertex) (\d+)", data)[1])
    points = np.frombuffer(data[place:], "<f4").reshape(-1, 3)
    assert len(points) == count == (cells.states == OCCUPIED).sum()
    assert (moment.map.state_at(points.astype(float)) == OCCUPIED).all()
    assert len(np.unique(points, axis=0)) == count
    if ending == "ply":
        trimesh = pytest.importorskip("trimesh")
        found = trimesh.load(path).vertices
        np.testing.assert_allclose(found, cells.centres(OCCUPIED), atol=1e-6)


def test_our_own_file_is_the_map_itself(tmp_path, log, moment):
    write_map(log, tmp_path / "m.map")
    assert VoxelMap.load(tmp_path / "m.map").version() == moment.map.version()


def test_an_earlier_decision_has_its_own_map(tmp_path, log):
    for number in (0, 3):
        assert write_map(log, tmp_path / f"{number}.map", number)[0] == number
        version = VoxelMap.load(tmp_path / f"{number}.map").version()
        assert version == moment_at(log, number).map.version()
    with pytest.raises(InputError, match="--at 99: no such decision, expected 0 to 5"):
        write_map(log, tmp_path / "m.map", 99)


def test_the_verb_names_the_endings(tmp_path, capsys):
    out = tmp_path / "m.pgm"
    assert main(["export", str(LOG), "--map", str(out)]) == 2
    assert f"expected a name that ends in {', '.join(WRITERS)}" in capsys.readouterr().err
    assert main(["export", str(LOG), "--map", str(tmp_path / "m.pcd"), "--at", "2"]) == 0
    assert "decision 2, cells" in capsys.readouterr().out
    assert (tmp_path / "m.pcd").stat().st_size > 0
