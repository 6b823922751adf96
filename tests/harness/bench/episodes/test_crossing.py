"""What the bench makes of episodes among movers, and how it goes on from rows that are there."""

import json
from dataclasses import asdict

import pytest

from tests.harness.bench.episodes.halves import Half, half
from wayproof.harness.bench.episodes.crossing import ALONE, CrossingRow, run_one, summarise
from wayproof.harness.bench.jobs import KeptRows, rows_of
from wayproof.harness.bench.stages import STAGES, run_stage
from wayproof.harness.errors import InputError


def row(way, seed, outcome, time_s, own=0, at_rest=0):
    return CrossingRow("drone", way, seed, outcome, own, at_rest, time_s, 0.1 * seed, "", "")


def test_what_traffic_costs_by_hand():
    alone = [row(ALONE, 1, "success", 10.0), row(ALONE, 2, "success", 12.0)]
    alone += [row(ALONE, 3, "stuck", 30.0), row(ALONE, 4, "success", 11.0)]
    rows = [row("voxel", 1, "success", 15.0), row("voxel", 2, "collision", 5.0, own=1)]
    rows += [row("voxel", 3, "success", 20.0), row("voxel", 4, "collision", 6.0, at_rest=1)]
    summary = summarise(rows, {(one.robot, one.seed): one for one in alone})
    assert (summary.episodes, summary.reached) == (4, 2)
    assert (summary.own_collisions, summary.hit_at_rest) == (1, 1)
    assert summary.mean_time_s == 17.5
    assert (summary.lost_s, summary.most_lost_s) == (5.0, 5.0)  # of seed 1; 3 did not arrive alone
    assert summary.least_clearance_m == pytest.approx(0.1)


def test_a_drone_stops_short_of_a_person_who_comes_into_its_way():
    among = run_one("drone", "voxel", 9)
    assert (among.outcome, among.own, among.at_rest) == ("success", 0, 0)
    assert among.job == ("drone", "voxel", 9)


def test_rows_are_kept_as_they_come_and_not_run_again(tmp_path):
    path = tmp_path / "rows.jsonl"
    jobs = [(parity, n) for n in range(3) for parity in ("odd", "even")]
    first = KeptRows(path, Half)
    for job in jobs[:4]:
        first.add(half(*job))
    with path.open("a") as file:
        file.write('{"parity": "o')  # killed while it wrote
    kept = KeptRows(path, Half)
    assert list(kept.rows) == jobs[:4]
    lines = []
    rows = rows_of(jobs, half, kept, lines.append)
    assert [one.job for one in rows] == jobs
    assert len(lines) == 2
    assert lines[0].startswith("5 of 6: ")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines[:4] == [asdict(one) for one in rows[:4]]
    assert len(lines) == 6


def test_a_file_of_something_else_is_refused(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_text('{"robot": "drone"}\n')
    with pytest.raises(InputError, match=r"--rows .*rows\.jsonl: line 1: "):
        KeptRows(path, CrossingRow)
    with pytest.raises(InputError, match="--rows"):
        KeptRows(tmp_path / "no" / "rows.jsonl", CrossingRow)
    with pytest.raises(InputError, match="got bench rays, expected one of: crossing, worlds"):
        run_stage("rays", 1, 0, kept=path)
    assert STAGES["crossing"].keeps
