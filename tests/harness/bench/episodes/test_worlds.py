"""Episodes among movers, and what the bench makes of episodes."""

from pathlib import Path

import pytest

from wayproof.harness.bench.episodes.worlds import WorldRow, _summarise, run_one
from wayproof.harness.bench.stages import STAGES
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.scenario.scenario import build

SHORT = ("episode.time_limit=3",)


def row(outcome, time_s, spl, clearance_m):
    return WorldRow("maze", "drone", 0, outcome, time_s, clearance_m, spl, 0, "")


def test_an_episode_among_movers_logs_them_and_replays(recorded):
    result = recorded("crossing", "drone", 0, *SHORT)
    world = build(override(Config("crossing", "drone", 0), SHORT)).world
    log = open_log(Path(result.log))
    truths = list(log.truth())
    assert {len(truth.movers) for truth in truths} == {len(world.movers)}
    first, last = truths[0], truths[-1]
    for mover, logged, later in zip(world.movers, first.movers, last.movers, strict=True):
        assert logged.name == mover.name
        assert logged.present
        assert tuple(logged.position) == pytest.approx(mover.place(0).position)
        assert tuple(later.position) != tuple(logged.position)
    assert 'mocap="true"' in log.scene
    assert replay(Path(result.log)).identical


def test_a_mover_that_is_not_there_is_logged_as_absent(recorded):
    result = recorded("ghosts", "drone", 0, *SHORT)
    first = next(open_log(Path(result.log)).truth())
    assert {mover.present for mover in first.movers} == {True, False}


def test_a_difficulty_is_a_setting():
    easy, hard = (
        build(override(Config("crossing", "drone", 0), [f"difficulty={d}"])).world for d in (0, 1)
    )
    assert (len(easy.movers), len(hard.movers)) == (2, 8)
    with pytest.raises(InputError, match="difficulty: got 2, expected 0 to 1"):
        override(Config("crossing", "drone", 0), ["difficulty=2"])


def test_the_shortest_way_through_an_empty_room_is_the_straight_line(recorded):
    result = recorded("empty", "drone", 1)
    assert result.struck == 0
    assert result.route_length_m <= result.path_length_m + 0.3
    assert result.route_length_m >= 6.0


def test_an_episode_becomes_a_row():
    row = run_one("empty", "drone", 1)
    assert row.outcome == "success"
    assert 0.8 < row.spl <= 1.0
    assert row.clearance_m > 0.0


def test_rows_are_summed_up():
    rows = [
        row("success", 20.0, 0.8, 0.3),
        row("success", 30.0, 0.9, 0.4),
        row("stuck", 60.0, 0.0, 0.1),
    ]
    summary = _summarise(rows)
    assert (summary.episodes, summary.reached) == (3, 2)
    assert summary.mean_time_s == 25.0
    assert summary.mean_spl == pytest.approx(1.7 / 3.0)
    assert summary.least_clearance_m == 0.1
    assert _summarise([row("stuck", 60.0, 0.0, 0.1)]).mean_time_s is None


def test_the_bench_knows_the_stage():
    assert STAGES["worlds"].repeats == 3
