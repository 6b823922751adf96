import contextlib
import io
import json

import mujoco
import numpy as np
import pytest
from rich.console import Console

from wayproof.harness.bench.micro import loop
from wayproof.harness.bench.micro.rays import SAMPLE, SCENES, disagreement, within
from wayproof.harness.bench.raycast.scenes import RELIEF, clutter, field_terrain, mesh_terrain
from wayproof.harness.bench.stages import STAGES
from wayproof.harness.bench.table import print_rows
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config, override
from wayproof.harness.scenario.scenario import build

FIELDS = [
    "scene",
    "geoms",
    "engine",
    "threads",
    "rays",
    "mray_per_s",
    "ratio_vs_multiray",
    "max_error_m",
    "id_mismatches",
]


OURS = [("tile", 1), ("tile", 2), ("tree", 1), ("mj_multiRay", 1), ("mj_ray", 1)]
PEERS = {"open3d", "embree"}  # where they are installed


@pytest.fixture(scope="module")
def printed():
    """What the command prints, once for all tests: it casts at every scene."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        assert main(["bench", "rays", "--repeats", "1", "--json"]) == 0
    assert err.getvalue() == ""
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def rows(printed):
    return [row for row in printed["rows"] if row["engine"] not in PEERS]


def test_the_command_prints_flat_rows(printed):
    assert list(printed) == ["rows"]
    assert all(list(row) == FIELDS for row in printed["rows"])


def test_every_engine_is_on_every_scene(rows):
    got = [(row["scene"], row["geoms"], row["engine"], row["threads"]) for row in rows]
    assert got == [(s.name, s.geoms, *engine) for s in SCENES for engine in OURS]
    assert {row["rays"] for row in rows} == {100_000, 320 * 240, SAMPLE}


def test_engines_agree(rows):
    for row in rows:
        assert 0.0 <= row["max_error_m"] <= 1e-9, row
        assert row["id_mismatches"] == 0, row


def test_ratios_are_those_of_the_rates(rows):
    for i in range(0, len(rows), len(OURS)):
        multi = rows[i + 3]["mray_per_s"]
        for row in rows[i : i + len(OURS)]:
            assert row["mray_per_s"] > 0.0
            assert row["ratio_vs_multiray"] == pytest.approx(row["mray_per_s"] / multi)


def test_without_json_a_table(rows):
    console = Console(file=io.StringIO(), width=80)
    print_rows(console, "bench rays, seed 0", rows)
    text = console.file.getvalue()
    assert "bench rays, seed 0" in text
    assert text.count("mj_multiRay") == len(SCENES)
    assert "…" not in text


NAMES = ", ".join(sorted(STAGES))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bench", "ray"], f"unknown stage 'ray'; did you mean 'rays'? (available: {NAMES})"),
        (["bench", "nothing"], f"unknown stage 'nothing' (available: {NAMES})"),
        (["bench"], "the following arguments are required: STAGE"),
        (["bench", "rays", "--repeats", "0"], "repeats: got 0, expected 1 to 1000"),
        (["bench", "rays", "--seed", "-1"], "seed: got -1"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, arguments, said):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert said in captured.err


def test_disagreement_by_hand():
    got = np.array([1.0, -1.0, 3.0]), np.array([4, -1, 6], np.int32)
    expected = np.array([1.5, -1.0, 3.0]), np.array([4, -1, 7], np.int32)
    assert disagreement(got, expected) == (0.5, 1)


def test_hits_beyond_range_become_misses():
    distance, ids = within((np.array([2.0, 2.5, -1.0]), np.array([3, 4, -1], np.int32)), 2.0)
    assert distance.tolist() == [2.0, -1.0, -1.0]
    assert ids.tolist() == [3, -1, -1]


def test_clutter_has_the_asked_geoms_and_movers():
    model = mujoco.MjModel.from_xml_string(clutter(23, moving=7, seed=5))
    assert (model.ngeom, model.nmocap) == (24, 7)
    kinds, counts = np.unique(model.geom_type[1:], return_counts=True)
    assert len(kinds) == 5
    assert sorted(counts) == [4, 4, 5, 5, 5]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert np.hypot(*data.geom_xpos[1:, :2].T).min() >= 2.0
    assert (model.geom_bodyid[:17] == 0).all()  # the floor and what stands, in the world body
    assert (model.body_mocapid[model.geom_bodyid[17:]] >= 0).all()


def test_clutter_is_its_seeds_alone():
    assert clutter(9, seed=1) == clutter(9, seed=1)
    assert clutter(9, seed=1) != clutter(9, seed=2)


def test_no_more_movers_than_geoms():
    with pytest.raises(ValueError, match="moving: got 3, expected 0 to 2"):
        clutter(2, moving=3)


@pytest.mark.parametrize(("make", "points"), [(mesh_terrain, 72), (field_terrain, 300)])
def test_terrain_is_ground_below_the_sensor(make, points):
    model = mujoco.MjModel.from_xml_string(make(points, moving=3, seed=2))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if make is mesh_terrain:
        assert model.nmeshface == 2 * 71 * 71
    else:
        assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (300, 300)
    assert model.nmocap == 3
    rng, geom = np.random.default_rng(0), np.zeros(1, np.int32)
    heights = []
    for _ in range(200):
        above = np.array([*rng.uniform(-19.0, 19.0, 2), 5.0])
        down = np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(model, data, above, down, None, 1, -1, geom)
        if geom[0] == 0:
            heights.append(5.0 - distance)
    assert -RELIEF - 1e-6 <= min(heights) < -0.7 * RELIEF
    assert -0.3 * RELIEF < max(heights) <= 1e-6


def test_both_terrains_are_the_same_ground():
    """Where their samples lie, the mesh and the field are one surface."""
    down, geom, found = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32), []
    for make in (mesh_terrain, field_terrain):
        model = mujoco.MjModel.from_xml_string(make(41, seed=3))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        places = [(x + 1e-4, y + 2e-4, 5.0) for x in (-7.0, 0.0, 12.0) for y in (-15.0, 3.0)]
        found.append(
            [mujoco.mj_ray(model, data, np.array(p), down, None, 1, -1, geom) for p in places]
        )
    np.testing.assert_allclose(*found, atol=2e-3)


def test_one_part_alone(capsys):
    assert main(["bench", "robots", "--repeats", "1", "--only", "hover", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["robot"], row["case"], row["runs"]) for row in rows] == [("drone", "hover", 1)]
    assert main(["bench", "map", "--only", "hover"]) == 2
    assert "unknown part of bench map 'hover' (available: accuracy, " in capsys.readouterr().err
    assert main(["bench", "rays", "--only", "hover"]) == 2
    assert (
        "--only: got bench rays, expected one of: coverage, loop, map, robots"
        in capsys.readouterr().err
    )


def test_whole_episodes_under_one_load(capsys):
    assert main(["bench", "loop", "--repeats", "1", "--only", "light", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["robot"] for row in rows] == ["quadruped", "drone"]
    for row in rows:
        assert row["rays"] in range(19_000, 20_001)
        assert (row["resolution_m"], row["threads"]) == (0.1, 1)
        assert (row["episodes"], row["reached"]) == (1, 1)
        assert set(row["stage_ms"]) == {"sense", "map", "costmap", "plan"}
        assert 0.0 < row["decision_ms_p50"] <= row["decision_ms_p99"]
        # What a decision takes is part of what an episode of ten decisions a second takes.
        assert 0.0 < row["realtime_factor"] < 100.0 / sum(row["stage_ms"].values())
    for robot in loop.ROBOTS:
        for load in ("dense", "dense-on-two"):
            scenario = build(override(Config(loop.WORLD, robot, 0), loop.LOADS[load]))
            assert sum(one.table.beams for one in scenario.scene.casters) >= 100_000
            assert scenario.config.map.resolution == 0.05
            assert scenario.config.threads == (2 if load == "dense-on-two" else 1)
    assert main(["bench", "loop", "--only", "heavy"]) == 2
    assert "(available: dense, dense-on-two, light)" in capsys.readouterr().err
