import json
import math

import numpy as np
import pytest

from wayproof.harness import bench
from wayproof.harness.bench import loop, plan, rays, robots
from wayproof.harness.bench.map import integrate, room_sweeps
from wayproof.harness.bench.table import print_rows
from wayproof.harness.cli.main import main
from wayproof.maps import MapConfig, VoxelMap
from wayproof.planners import PLANNERS, PlannerConfig


def rows_of(capsys, *words):
    assert main(["bench", *words, "--repeats", "1", "--json"]) == 0
    return json.loads(capsys.readouterr().out)["rows"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["ray"],
            "unknown part 'ray'; did you mean 'rays'? (available: loop, map, plan",
        ),
        ([], "the following arguments are required: PART"),
        (["rays", "--repeats", "0"], "repeats: got 0, expected 1 to 1000"),
        (["rays", "--seed", "-1"], "seed: got -1"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, words, said):
    assert main(["bench", *words]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert said in captured.err


@pytest.mark.few(1)
@pytest.mark.parametrize("count", [2, len(rays.SCENES)])
def test_rays_agree_with_mujoco_on_every_scene(capsys, monkeypatch, count):
    monkeypatch.setattr(rays, "SCENES", rays.SCENES[:count])
    monkeypatch.setattr(rays, "FIELD_POINTS", 100)  # MuJoCo takes half of the time for it
    rows = rows_of(capsys, "rays")
    assert [row["scene"] for row in rows] == [scene.name for scene in rays.SCENES]
    for row in rows:
        assert row["max_error_m"] <= 1e-9
        assert row["other_ids"] == 0
        assert row["ms_min"] == row["ms"]
        assert row["mray_per_s"] == pytest.approx(row["rays"] / row["ms"] / 1e3)


def test_disagreement_by_hand():
    got = np.array([1.0, -1.0, 3.0]), np.array([4, -1, 6], np.int32)
    expected = np.array([1.5, -1.0, 3.0]), np.array([4, -1, 7], np.int32)
    assert rays.disagreement(got, expected) == (0.5, 1)
    far = rays.within((np.array([2.0, 2.5, -1.0]), np.array([3, 4, -1], np.int32)), 2.0)
    assert (far[0].tolist(), far[1].tolist()) == ([2.0, -1.0, -1.0], [3, -1, -1])


def test_the_map_is_timed_by_cell_size(capsys, monkeypatch):
    monkeypatch.setattr("wayproof.harness.bench.map.RESOLUTIONS", (0.2,))
    (row,) = rows_of(capsys, "map")
    assert row["cell_m"] == 0.2
    voxel_map = VoxelMap(MapConfig(resolution=0.2, half_life=0.0))
    updated = [integrate(voxel_map, one, k) for k, one in enumerate(room_sweeps(0)[:2])]
    assert min(updated) <= row["cells"] <= max(updated)
    assert row["mib"] == voxel_map.memory_bytes() / 2**20
    assert 0.0 < row["ms_min"] <= row["ms"]
    assert min(row["x_octomap"], row["octomap_mib"], row["decay_ms"]) > 0.0


def test_every_planner_solves_the_same_queries(monkeypatch):
    monkeypatch.setattr(plan, "PLANNERS", {name: PLANNERS[name] for name in ("astar", "kpiece1")})
    rows = plan.bench_plan(1, 0, print)
    names = ["astar", "kpiece1", "astar, clear"]
    assert [(row["robot"], row["planner"]) for row in rows] == [
        (robot, name) for robot in ("drone", "quadruped") for name in names
    ]
    for row in rows:
        assert row["success"] == (1.0 if row["planner"].startswith("astar") else row["success"])
        assert row["length"] >= 1.0 or not row["success"]
    assert rows[0]["x_astar"] == 1.0


def test_queries_are_free_and_far_apart():
    space = plan.ground(plan.warehouse(0))
    for query in plan.make_queries(space, 3, seed=0):
        start = np.append(query.start, query.heading)
        assert space.sweep_free(start, start)
        assert 14.0 <= math.dist(query.start, query.goal) <= 16.0
        found = plan._plan(space, query, PlannerConfig(name="astar"))
        assert found.length >= math.dist(query.start, query.goal) - 1e-9


@pytest.mark.large
def test_episodes_are_timed_beside_their_physics(capsys, monkeypatch):
    monkeypatch.setattr(loop, "LOADS", {"light": loop.LIGHT})
    rows = rows_of(capsys, "loop")
    assert [row["robot"] for row in rows] == ["quadruped", "drone"]
    for row in rows:
        assert row["rays"] in range(19_000, 20_001)
        assert row["reached"] == 1.0
        assert 0.0 < row["physics"] < 1.0
        assert row["bare"] == pytest.approx(row["real"] / row["physics"])
        assert 0.0 < max(row[stage] for stage in loop.STAGES) < row["ms"] <= row["ms_p99"]


@pytest.mark.large
def test_robots_follow_their_course(capsys):
    quadruped, drone = rows_of(capsys, "robots")
    assert (quadruped["robot"], drone["robot"]) == ("quadruped", "drone")
    for row, error, speed in ((quadruped, 0.2, 0.8), (drone, 0.8, 2.5)):
        assert (row["runs"], row["falls"]) == (1, 0)
        assert row["error_m"] < error
        assert row["speed_m_s"] > speed
        assert 0.0 < row["physics"] < 1.0
        assert row["real"] == row["real_max"]


def test_a_course_begins_at_rest_and_comes_to_its_speed():
    for robot in ("quadruped", "drone"):
        course = robots.figure_of_eight(4.0, 1.0, 0.7, robot)
        assert np.linalg.norm(course(0.0).velocity) == 0.0
        for time in (1.0, 3.0, 8.0):
            before, here, after = (course(time + step) for step in (-1e-4, 0.0, 1e-4))
            moved = np.subtract(after.position, before.position) / 2e-4
            assert here.velocity == pytest.approx(moved, abs=1e-4)
            turned = (after.heading - before.heading) / 2e-4
            assert here.yaw_rate == pytest.approx(turned, abs=1e-3)


def test_rows_with_the_same_fields_share_a_table(capsys):
    from rich.console import Console

    console = Console(width=80)
    with console.capture() as printed:
        print_rows(console, "two", [{"a_b": 1.23456, "c": "x"}, {"a_b": 2.0, "c": "y"}, {"d": 1}])
    text = printed.get()
    assert text.count("a b") == 1
    assert "1.23 x" in text
    assert set(bench.BENCHES) == {"rays", "map", "plan", "loop", "robots"}
