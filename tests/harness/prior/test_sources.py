"""Prior maps from the world's geometry and from every format that is read, and what is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.map_files.files import cells_of, moment_at, write_map
from wayproof.harness.prior.cells import PriorCells, packed, prior_layer, unpacked
from wayproof.harness.prior.of_world import grid_of_world
from wayproof.harness.scenario.prior_maps import with_prior
from wayproof.harness.scenario.scenario import build
from wayproof.harness.scenario.worlds import find_world
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window, unpack

SHORT = "episode.time_limit=2"


@pytest.fixture(scope="module")
def log(recorded):
    """Log of a drone in the corridor."""
    return open_log(Path(recorded("corridor", "drone", 1, SHORT).log))


def prior_of(source, *settings, world="corridor", robot="drone"):
    config = override(Config(world, robot, 1), [f"prior.source={source}", *settings])
    config = with_prior(config, find_world(config))
    return config, unpacked(config.prior_map)


def dense(cells, window):
    """States of the cells of a window; unknown beyond those of a prior map."""
    states = np.zeros(window.shape, np.uint8)
    low = np.subtract(cells.first, window.first)
    box = tuple(slice(a, a + n) for a, n in zip(low, cells.states.shape, strict=True))
    states[box] = cells.states
    return states


def window_of(config):
    world = find_world(config)
    return Window.covering(world.low, world.high, config.map.resolution)


def test_the_truth_has_what_is_solid_and_a_floor_and_free_air():
    config, cells = prior_of("truth")
    world, window = find_world(config), window_of(config)
    states = dense(cells, window)
    rng = np.random.default_rng(0)
    places = rng.integers((0, 0, 0), window.shape, (4000, 3))
    centres = window.origin + (places + 0.5) * 0.1
    away = np.min([solid.distance(centres) for solid in world.solids], axis=0)
    found = states[tuple(places.T)]
    above = places[:, 2] + window.first[2] > 0
    assert (found[above & (away > 0.06)] == FREE).all()
    assert (found[above & (away == 0.0)] == OCCUPIED).all()
    assert (states[:, :, -window.first[2]] == OCCUPIED).all()
    assert np.count_nonzero(states[:, :, : -window.first[2]] == FREE) == 0


def test_a_hole_in_the_floor_is_none_to_stand_on():
    world = find_world(Config("construction", "quadruped", 1))
    grid = grid_of_world(world, 0.1)
    floor = -round(grid.origin[2] / 0.1 + 0.75)
    held = grid.states[:, :, floor] == OCCUPIED
    assert 0.5 < held.mean() < 1.0
    assert (grid.states[:, :, floor][~held] == FREE).all()


@pytest.mark.parametrize("ending", [".map", ".mcap"])
def test_the_map_of_a_log_and_its_file_give_the_same_cells(log, tmp_path, ending):
    path = log.path
    if ending == ".map":
        path = tmp_path / "own.map"
        write_map(log, path)
    config, cells = prior_of(path)
    own = cells_of(log, moment_at(log, None))
    assert config.prior.source.startswith(f"{path.name}@")
    np.testing.assert_array_equal(dense(cells, window_of(config)), own.states)


def test_an_occupancy_map_that_was_exported_stands_where_its_cells_were(recorded, tmp_path):
    log = open_log(Path(recorded("corridor", "quadruped", 1, SHORT).log))
    path = tmp_path / "nav.yaml"
    write_map(log, path)
    config, cells = prior_of(path, robot="quadruped")
    plane = moment_at(log, None).costmap.state[:, :, 0]
    window = window_of(config)
    states = dense(cells, window)
    layer = 5 - window.first[2]  # at half a metre
    np.testing.assert_array_equal(states[:, :, layer], plane)
    floor = states[:, :, -window.first[2]]
    np.testing.assert_array_equal(floor == OCCUPIED, plane != UNKNOWN)


def test_an_octomap_that_was_exported_has_free_and_occupied_cells(log, tmp_path):
    pytest.importorskip("pyoctomap")
    path = tmp_path / "oct.bt"
    write_map(log, path)
    _, cells = prior_of(path, "prior.z=0.025")  # its lattice has a face at z = 0
    own = cells_of(log, moment_at(log, None))
    window = Window(own.resolution, own.first, own.states.shape)
    there = dense(cells, window)
    assert (there == own.states).mean() > 0.99
    assert np.count_nonzero(there == FREE) > 1000


def test_a_prior_map_is_placed_by_its_settings(log, tmp_path):
    path = tmp_path / "own.map"
    write_map(log, path)
    _, cells = prior_of(path)
    config, moved = prior_of(path, "prior.x=0.5", "prior.y=-0.3")
    window = window_of(config)
    before, after = dense(cells, window), dense(moved, window)
    np.testing.assert_array_equal(after[5:, :-3], before[:-5, 3:])


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("nothing.map", "prior map 'nothing.map': No such file"),
        ("truht", "did you mean 'truth'"),
        ("a.pgm", "unknown prior map 'a.pgm'"),
        ("map.yaml@0123456789abcdef", "was read from a file: expected the file"),
    ],
)
def test_a_source_that_is_none_is_refused_in_a_line(source, text):
    with pytest.raises(InputError, match=text):
        prior_of(source)


@pytest.mark.parametrize("ending", [".map", ".yaml", ".bt", ".mcap", ".xml", ".ply"])
def test_a_file_of_other_content_is_refused_in_a_line(tmp_path, ending):
    path = tmp_path / f"broken{ending}"
    path.write_bytes(b"nothing of the kind\n" * 40)
    assert main(["run", "corridor", "--robot", "drone", "--seed", "1", "--prior", str(path)]) == 2
    with pytest.raises(InputError) as caught:
        prior_of(path)
    assert "broken" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_map_that_does_not_overlap_the_operating_area_is_refused(log):
    with pytest.raises(InputError, match="no known cell in the operating area"):
        prior_of(log.path, "prior.x=500")


def test_a_stale_prior_needs_a_prior():
    stale = 'perturbation={"kind": "stale_prior", "severity": 3}'
    with pytest.raises(InputError, match=r"there is none; expected prior\.source"):
        build(override(Config("corridor", "drone", 1), [stale]))


def test_cells_survive_their_bytes_and_damaged_bytes_are_refused():
    rng = np.random.default_rng(0)
    cells = PriorCells(0.1, (-3, 4, -1), rng.integers(0, 3, (7, 5, 9)).astype(np.uint8))
    again = unpacked(packed(cells))
    assert (again.resolution, again.first) == (0.1, (-3, 4, -1))
    np.testing.assert_array_equal(again.states, cells.states)
    data = packed(cells)
    for bad in (b"", data[:40], data[:-3], b"x" + data[1:], data[:8] + b"\xff" * 8 + data[16:]):
        with pytest.raises(ValueError, match="prior_map"):
            unpacked(bad)


def test_a_layer_at_another_resolution_holds_the_same_walls():
    config, _ = prior_of("truth")
    mission = build(config).mission
    fine = dataclasses.replace(config, map=dataclasses.replace(config.map, resolution=0.05))
    layers = [prior_layer(one, mission) for one in (config, fine)]
    occupied = [
        layer.columns(layer.window.first, (*layer.window.shape[:2], 2))[0] for layer in layers
    ]
    counts = [int(unpack(one, 128).sum()) for one in occupied]
    assert counts[1] == pytest.approx(8 * counts[0], rel=0.1)
