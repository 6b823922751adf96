"""Published protocols: their scores by hand, their searches against naive ones, their files."""

import dataclasses
import heapq
import itertools
import json
import math
import re

import numpy as np
import pytest

from wayproof.harness.bench.published import BENCHMARKS, barn, dodge
from wayproof.harness.bench.published.trials import Finished, Trial, run_trial
from wayproof.harness.bench.published.voxel_search import (
    SQRT2,
    SQRT3,
    VoxelSearch,
    _length,
    _search,
)
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config, override
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.world_files import ImportOptions

PILLAR = """<model name='p{n}'><static>1</static><pose frame=''>{x} {y} 0 0 0 0</pose>
<link name='l'><collision name='c'><geometry><cylinder><radius>0.075</radius><length>1</length>
</cylinder></geometry></collision></link></model>"""


def barn_folder(folder, gap):
    """A wall of pillars across the way with a gap, and a reference path through it."""
    places = [(x, 7.0) for x in np.arange(-4.9, 0.5, 0.15) if abs(x + 2.25) > gap / 2]
    models = "".join(PILLAR.format(n=n, x=x, y=y) for n, (x, y) in enumerate(places))
    (folder / "world_7.world").write_text(f"<sdf version='1.6'><world>{models}</world></sdf>")
    # x = 0.15 i - 4.575 and y = 0.15 j + 5.075, from (-2.175, 5.075) straight to (-2.175, 9.575)
    np.save(folder / "path_7.npy", np.array([[16, j] for j in range(31)]))
    return folder


def field_folder(folder):
    rows = ["s, 8, 0, 4, 1, 0, 0, 0, 1.5, 1.5, 1.5", "s, 1000, 0, 4, 1, 0, 0, 0, 1, 1, 1"]
    (folder / "easy_0.csv").write_text("\n".join(rows))
    return folder


# ---- the exact search


def naive_length(occupied, start, goal):
    """Dijkstra over the same moves, each checked cell by cell."""
    steps = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]
    best, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        length, cell = heapq.heappop(queue)
        if cell == goal:
            return length
        if length > best[cell]:
            continue
        for step in steps:
            other = tuple(np.add(cell, step).tolist())
            if not all(0 <= a < n for a, n in zip(other, occupied.shape, strict=True)):
                continue
            box = [slice(min(a, b), max(a, b) + 1) for a, b in zip(cell, other, strict=True)]
            through = length + math.dist(cell, other)
            if not occupied[tuple(box)].any() and through < best.get(other, math.inf) - 1e-12:
                best[other] = through
                heapq.heappush(queue, (through, other))
    return None


@pytest.mark.parametrize("seed", range(6))
def test_the_search_is_as_short_as_a_naive_one(seed):
    rng = np.random.default_rng(seed)
    occupied = rng.uniform(size=(9, 8, 7)) < (0.1, 0.3, 0.5)[seed % 3]
    free = np.argwhere(~occupied).tolist()
    search = VoxelSearch(occupied)
    for _ in range(4):
        start, goal = (tuple(free[n]) for n in rng.integers(len(free), size=2))
        expected, found = naive_length(occupied, start, goal), search.solve(start, goal)
        assert (found is None) == (expected is None)
        if found is not None:
            assert found.length == pytest.approx(expected, abs=1e-9)
            assert found == search.solve(start, goal)  # whatever was searched before


def test_counts_by_hand():
    # (0, 0, 0) to (4, 2, 1): one step along all axes, one along two, two along one.
    found = VoxelSearch(np.zeros((5, 5, 5), bool)).solve((0, 0, 0), (4, 2, 1))
    assert found[:3] == (2, 1, 1)
    assert found.length == 2.0 + SQRT2 + SQRT3
    with pytest.raises(ValueError, match="goal"):
        VoxelSearch(np.zeros((5, 5, 5), bool)).solve((0, 0, 0), (5, 0, 0))


def test_no_corner_is_cut():
    occupied = np.zeros((2, 2, 1), bool)
    occupied[1, 0, 0] = True
    assert VoxelSearch(occupied).solve((0, 0, 0), (1, 1, 0))[:3] == (2, 0, 0)
    occupied[0, 1, 0] = True
    assert VoxelSearch(occupied).solve((0, 0, 0), (1, 1, 0)) is None


def test_compiled_and_plain_search_agree():
    occupied = np.random.default_rng(3).uniform(size=(6, 6, 6)) < 0.3
    occupied[0, 0, 0] = occupied[5, 5, 5] = False
    search = VoxelSearch(occupied)
    compiled = search.solve((0, 0, 0), (5, 5, 5))
    counts, state = np.zeros((216, 3), np.uint32), np.zeros(216, np.uint32)
    given = (search._allowed, occupied.shape, 0, 215, counts, state, 2)
    assert _search.py_func(*given) == compiled.expanded
    assert tuple(counts[215]) == compiled[:3]
    assert _length.py_func(1, 1, 1) == _length(1, 1, 1)


def test_published_lengths_are_checked(tmp_path, capsys):
    (tmp_path / "m.3dmap").write_text("voxel 6 6 6\n3 3 3\n")
    file = tmp_path / "m.3dscen"
    file.write_text("version 1\nm.3dmap\n0 0 0 4 2 1 5.14626437 1.0\n0 0 0 5 0 0 5.5 1.0\n")
    assert main(["bench", "plan", "--scenarios", str(file), "--repeats", "2", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["planner"] for row in rows] == ["exact", "astar", "rrtconnect"]
    assert (rows[0]["problems"], rows[0]["success"], rows[0]["differing"]) == (2, 1.0, 1)
    assert all(0.8 < row["length_ratio_mean"] < 1.2 for row in rows)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("0 0 0 3 3 3 5.1 1.0", r"m\.3dscen:3: cell \(3, 3, 3\) is occupied"),
        ("0 0 0 6 0 0 5.1 1.0", r"m\.3dscen:3: cell \(6, 0, 0\) is occupied or outside"),
        ("0 0 0 1 0", "expected start x y z"),
        ("0 0 0 1 0 0 -1 1", "length -1"),
    ],
)
def test_broken_problems_are_named(tmp_path, capsys, line, said):
    (tmp_path / "m.3dmap").write_text("voxel 6 6 6\n3 3 3\n")
    file = tmp_path / "m.3dscen"
    file.write_text(f"version 1\nm.3dmap\n{line}\n")
    assert main(["bench", "plan", "--scenarios", str(file)]) == 2
    assert len(error := capsys.readouterr().err.splitlines()) == 1
    assert re.search(said, error[0])


# ---- BARN


def test_barn_scores_by_hand():
    assert barn.barn_score(True, 4.0, 5.0) == 0.5  # faster than 2 OT counts as 2 OT
    assert barn.barn_score(True, 20.0, 5.0) == 0.25
    assert barn.barn_score(True, 49.0, 5.0) == 0.125  # slower than 8 OT counts as 8 OT
    assert barn.barn_score(False, 4.0, 5.0) == 0.0


def test_a_reference_path_is_measured_from_start_to_goal(tmp_path):
    world = barn.read_barn(barn_folder(tmp_path, gap=1.6) / "world_7.world")
    by_hand = math.hypot(0.075, 2.075) + 4.5 + math.hypot(0.075, 3.425)
    assert barn.optimal_time(world) == pytest.approx(by_hand / 2.0, abs=1e-9)
    protocol = json.loads(world.protocol)
    assert (protocol["name"], protocol["speed"], protocol["clip"]) == ("barn", 2.0, [2.0, 8.0])
    assert (world.start, world.goal) == ((-2.25, 3.0, 0.0), (-2.25, 13.0, 0.0))


# The pillars leave 0.3, 0.6 and 1.5 m; the body's least disc with its margin takes 0.52 m.
@pytest.mark.parametrize(("gap", "is_open"), [(0.4, False), (0.6, True), (1.6, True)])
def test_truth_tells_which_worlds_are_open(tmp_path, gap, is_open):
    world = barn.read_barn(barn_folder(tmp_path, gap) / "world_7.world")
    assert (barn.shortest_way(world) is not None) is is_open


@pytest.mark.parametrize("verb", ["bench", "study"])
def test_a_closed_world_is_impossible_and_not_left_out(tmp_path, capsys, verb):
    folder = str(barn_folder(tmp_path, gap=0.3))
    assert main([verb, "barn", "--worlds", folder, "--repeats", "2", "--json"]) == 0
    *rows, summary = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["outcome"], row["seed"]) for row in rows] == [("impossible", 0), ("impossible", 1)]
    assert (summary["episodes"], summary["impossible"], summary["success"]) == (2, 2, 0.0)


def finished(world, config, outcome, time, track):
    told = dict.fromkeys([field.name for field in dataclasses.fields(Result)], 0)
    told |= {"outcome": outcome, "sim_time_s": time, "collisions": 1}
    result = Result(**told)
    return Finished(Trial(world, config, None), result, "", track)


def test_a_barn_trial_ends_a_metre_from_the_goal(tmp_path):
    world = barn.read_barn(barn_folder(tmp_path, gap=1.6) / "world_7.world")
    config = barn.barn_config(world, 4)
    track = ((0.0, -2.25, 3.0, 0.3), (14.0, -2.25, 11.9, 0.3), (14.1, -2.25, 12.1, 0.3))
    row = barn._row(finished(world, config, "collision", 15.0, track), 11.0)
    assert (row.outcome, row.time_s, row.collisions) == ("success", 14.1, 0)
    assert row.score == pytest.approx(barn.optimal_time(world) / 14.1)
    # 10 m at 1 m/s; OT is 10.0 m / 2 m/s = 5.0 s, so at best just below 2 OT
    assert row.best == pytest.approx(0.5, abs=0.01)
    row = barn._row(finished(world, config, "collision", 9.0, track[:2]), 11.0)
    assert (row.outcome, row.score, row.collisions) == ("collision", 0.0, 1)


# ---- dodge


def test_a_flight_ends_at_the_finish(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    config = dodge.dodge_config(world, 1)
    track = ((0.0, 0.0, 0.0, 4.0), (11.0, 16.9, 0.0, 4.0), (11.1, 17.0, 0.0, 4.0))
    row = dodge._row(finished(world, config, "stuck", 30.0, track))
    assert (row.outcome, row.time_s, row.collisions) == ("success", 11.1, 0)
    row = dodge._row(finished(world, config, "success", 12.0, track[:2]))
    assert row.outcome == "timeout"  # the goal is beyond the finish
    summary = dodge.summarise("all", [row, row])
    assert (summary.success, summary.restricted_mean_s) == (0.0, 35.0)


def test_starts_and_goals_are_free_and_of_the_seed(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    assert len(world.solids) == 1  # the other is put away far outside
    ends = [dodge.flight_ends(world, seed) for seed in range(6)]
    assert ends == [dodge.flight_ends(world, seed) for seed in range(6)]
    assert len({start for start, _ in ends}) == 6
    for start, goal in ends:
        assert (start[:2], goal[:2]) == ((0.0, 0.0), (18.0, 0.0))
        assert 2.0 <= start[2] == goal[2] <= 8.0


def test_a_world_that_cannot_start_is_an_outcome(tmp_path):
    world = dodge.read_field(field_folder(tmp_path) / "easy_0.csv")
    config = override(dodge.dodge_config(world, 0), ["start=[8.0,0.0,4.0]"])
    done = run_trial(Trial(world, config, tmp_path / "a.mcap"))
    assert done.result is None
    assert "within the body's radius" in done.refused
    assert dodge._row(done).outcome == "refused"


# ---- world files in episodes


def test_a_log_holds_the_world_of_its_file(tmp_path, capsys):
    field_folder(tmp_path)
    out = tmp_path / "field.xml"
    command = ["import", str(tmp_path / "easy_0.csv"), "--out", str(out), "--json"]
    assert main([*command, "--start", "0,0", "--goal", "12,0"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["notes"] == ["1 spheres more than 500 m away: left out"]
    config = override(
        Config(str(out), "drone", 5), ["episode.time_limit=1.0", "motion.altitude_high=6"]
    )
    first = run_episode(build(config), tmp_path / "first.mcap")
    log = open_log(tmp_path / "first.mcap")
    assert log.config.world == told["name"]
    out.unlink()  # neither a replay nor another run needs it
    assert replay(tmp_path / "first.mcap").identical
    again = run_episode(rebuild(log), tmp_path / "again.mcap")
    assert again.chain == first.chain
    with pytest.raises(InputError, match="was read from a file: expected the file, or a log"):
        build(log.config)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bench", "barn"], "bench barn: expected --worlds with the path of its files"),
        (["bench", "rays", "--worlds", "x"], "unknown stage with --worlds 'rays'"),
        (["bench", "barn", "--worlds", "nowhere"], "--worlds: no folder 'nowhere'"),
        (["bench", "plan", "--scenarios", "nowhere"], "nowhere: no such file"),
        (["bench", "plan", "--scenarios", "a", "--worlds", "b"], "got --worlds and --scenarios"),
        (["import", "nowhere.csv"], "nowhere.csv: no such file"),
        (["import", "nowhere.csv", "--start", "1"], "--start: got '1', expected X,Y"),
        (["import", "nowhere.csv", "--out", "a.json"], "expected a name that ends in .xml"),
        (["import", "nowhere.csv", "--scale", "0"], "scale: got 0"),
        (["run", "nowhere.xml", "--robot", "drone", "--seed", "1"], "no such file"),
    ],
)
def test_bad_words_are_refused_in_one_line(capsys, arguments, said):
    assert main(arguments) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert said in error[0]


def test_every_benchmark_names_its_files():
    assert {name: one.option for name, one in BENCHMARKS.items()} == {
        "plan": "--scenarios",
        "barn": "--worlds",
        "dodge": "--worlds",
    }


def test_the_help_tells_the_defaults_that_count(capsys):
    with pytest.raises(SystemExit):
        main(["import", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    own = ImportOptions()
    for value in (own.height, own.resolution, own.scale, own.unknown):
        text = value if isinstance(value, str) else f"{value:g}"
        assert f"(default: {text})" in told


def test_a_long_body_goes_through_a_gap_in_which_it_cannot_turn(tmp_path):
    """As a disc where that leads on, as its discs in the gap; and the audit agrees."""
    world = barn.read_barn(barn_folder(tmp_path, gap=1.0) / "world_7.world")
    done = run_trial(Trial(world, barn.barn_config(world, 1), tmp_path / "a.mcap"))
    assert done.result is not None
    assert (done.result.outcome, done.result.collisions) == ("success", 0)
    decisions = [m for m in read_messages(tmp_path / "a.mcap") if isinstance(m, pb.Decision)]
    slender, wide = sorted({round(decision.inflation_radius_m, 6) for decision in decisions})
    assert wide - slender == pytest.approx(0.245)
    found = audit(tmp_path / "a.mcap")
    assert found.violations == ()
    assert found.swept > 50
    assert replay(tmp_path / "a.mcap").identical
