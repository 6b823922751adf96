"""Metrics on hand-made episodes, on which the wrong formulas known from elsewhere differ."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.tools.small_log import COMMITTED
from wayproof.harness.cli.main import main
from wayproof.harness.metrics import METRICS, score
from wayproof.harness.trace import Beliefs, Trace, read_trace
from wayproof.harness.trajectory_error import Track, ate, relative_errors, rotations, rpe

UPRIGHT = np.tile([1.0, 0, 0, 0], (4, 1))
"""Quaternions of four poses without a turn."""


def trace(**changes: object) -> Trace:
    """Four seconds along x: 1 m/s, 1 m/s, at rest, and at rest at the end."""
    made = Trace(
        outcome="success",
        duration=4.0,
        collisions=0,
        goal_distance=0.1,
        route_length=2.0,
        times=np.array([0.0, 1.0, 2.0, 3.0]),
        positions=np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0.5, 0]]),
        velocities=np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]]),
        clearances=np.array([0.5, 0.4, 0.3, 0.6]),
        actions=("follow", "explore", "explore", "stop_and_wait"),
        latencies=np.array([10.0, 20.0, 30.0, 40.0]),
        missed=np.array([False, True, False, False]),
        arrival=4.0,
        start_distance=2.0,
        goals=4,
        goals_reached=3,
        verdicts=("admitted", "unknown", "blocked", "admitted"),
        cuts=np.array([False, False, True, False]),
        admitted_share=0.9,
        predicting=np.array([2.0, 3.0, 9.0]),
        committed_evidence=np.array([[3.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 4.0]]),
        global_evidence=np.array([[1.0, 2.0, 1.0, 4.0]]),
        evidence_ages=np.array([0.0, 0.4, 0.3, 2.0]),
        beliefs=Beliefs(
            np.array([[0.2, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.9]]),
            np.array([np.diag([0.01, 0.04, 0.09])] * 3),
        ),
        tracks=(
            Track(np.array([[0.0, 0, 0], [1, 0.3, 0], [2, 0.3, 0.4], [2, 0.8, 0.4]]), UPRIGHT),
            Track(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0.5, 0]]), UPRIGHT),
        ),
    )
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


def test_every_metric_by_hand() -> None:
    assert score(trace()) == pytest.approx(
        {
            "success": 1.0,
            "progress": 0.75,
            "spl": 2.0 / 2.5,
            "soft_spl": 0.95 * 2.0 / 2.5,
            "barn_score": 0.25,  # OT = 1 s, 4 s lie within [2, 8]
            "collisions": 0.0,
            "least_clearance": 0.3,
            "path_length": 2.5,
            "path_ratio": 1.25,
            "time_to_goal": 4.0,
            "time_near_goal": 4.0,
            "time_stopped": 2.0,
            "explorations": 1.0,
            "stops": 1.0,
            # Accelerations 0, -1, 0; their differences -1, 1.
            "jerk": 1.0,
            # Distances 0, 0.3, 0.5, 0.5 m; differences of the steps 0.3, 0.4, 0 m.
            "ate": math.sqrt(0.59 / 4),
            "rpe": math.sqrt(0.25 / 3),
            # Of (2, 0, 0), (0, 0, 0) and (0, 1, 3) standard deviations.
            "nees": (4.0 + 0.0 + 10.0) / 9.0,
            "coverage_x": 1.0,
            "coverage_y": 1.0,
            "coverage_z": 2.0 / 3.0,
            "latency_p50": 25.0,
            "latency_p99": 39.7,
            "latency_max": 40.0,
            "predict_p50": 3.0,
            "deadline_misses": 1.0,
            "not_admitted": 0.5,
            "guard_cuts": 1.0,
            "admitted_share": 0.9,
            "unmeasured_share": 1.0 / 8.0,
            "guided_share": 3.0 / 8.0,
            "stale_way": 1.0,
        }
    )


@pytest.mark.parametrize(
    ("metric", "changes", "value"),
    [
        ("not_admitted", {"verdicts": None}, None),  # no referee judges the built-in stack
        ("guard_cuts", {"cuts": None}, None),
        ("not_admitted", {"verdicts": ("admitted",) * 4}, 0.0),
        ("guard_cuts", {"cuts": np.zeros(4, bool)}, 0.0),
        ("not_admitted", {"verdicts": ("unknown",) * 3}, 1.0),
        ("time_stopped", {"duration": 10.0}, 8.0),  # a stop that is open at the end counts
        ("soft_spl", {"goal_distance": 5.0}, 0.0),  # progress is clipped
        ("barn_score", {"arrival": 0.5}, 0.5),  # clipped at both ends
        ("barn_score", {"arrival": 100.0}, 0.125),
    ],
)
def test_the_ends_of_a_metric(metric: str, changes: dict[str, object], value: float | None) -> None:
    assert METRICS[metric].function(trace(**changes)) == value


def test_jerk_does_not_scale_with_the_rate() -> None:
    """v = 0.25 t^3 has jerk 1.5 t; dividing by one sample too many would make it n / (n - 1)."""
    figures = []
    for rate in (50, 200):
        times = np.arange(2 * rate + 1) / rate
        velocities = np.stack([0.25 * times**3, 0 * times, 0 * times], axis=1)
        figures.append(METRICS["jerk"].function(trace(times=times, velocities=velocities)))
    assert figures[0] == pytest.approx(np.sqrt(3.0), rel=1e-2)  # rms of 1.5 t over 0 to 2 s
    assert figures == pytest.approx([np.sqrt(3.0)] * 2, rel=2e-2)


def test_jerk_of_a_constant_acceleration_is_none_at_uneven_times() -> None:
    times = np.array([0.0, 0.1, 0.3, 0.35, 1.0])
    velocities = np.stack([2.0 * times, 0 * times, 0 * times], axis=1)
    assert METRICS["jerk"].function(trace(times=times, velocities=velocities)) == pytest.approx(0.0)
    assert METRICS["jerk"].function(trace(times=times[:2], velocities=velocities[:2])) is None


@pytest.mark.parametrize("outcome", ["timeout", "stuck", "error", "collision", "aborted"])
def test_no_failure_is_dropped_or_renamed(outcome: str) -> None:
    scores = score(trace(outcome=outcome, goal_distance=1.0, arrival=None))
    assert scores["success"] == scores["spl"] == scores["barn_score"] == 0.0
    assert scores["collisions"] == 0.0  # a timeout is no collision
    assert scores["time_to_goal"] is scores["path_ratio"] is None
    assert scores["soft_spl"] == pytest.approx(0.5 * 0.8)


def test_an_episode_that_starts_at_its_goal_has_every_score() -> None:
    """OT is 0, and the least time that counts, 2 OT, is too."""
    scores = score(trace(route_length=0.0, start_distance=0.0, duration=0.0))
    assert scores["barn_score"] == 0.5
    late = trace(route_length=0.0, start_distance=0.0, outcome="timeout", arrival=None)
    assert score(late)["barn_score"] == 0.0


def test_unknown_routes_leave_their_metrics_open() -> None:
    scores = score(trace(route_length=None))
    assert [name for name, value in scores.items() if value is None] == [
        "spl",
        "soft_spl",
        "barn_score",
        "path_ratio",
    ]


def test_a_real_log_scores_as_its_result_says(recorded) -> None:
    from wayproof.harness.log.reader import open_log

    log = open_log(Path(recorded("empty", "drone", 1).log))
    read = read_trace(log)
    assert read.path_length == pytest.approx(float(log.result["path_length_m"]), abs=1e-9)
    assert len(read.actions) == len(read.times) == int(log.result["decisions"])
    assert score(read)["least_clearance"] == pytest.approx(float(log.result["min_clearance_m"]))


@pytest.mark.parametrize(("least", "said"), [(1.999, "1.999"), (2.0, ">= 2.000")])
def test_a_least_clearance_that_is_a_bound_says_so(
    least: float, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is measured beyond 2 m."""
    log, far = str(COMMITTED), trace(clearances=np.full(4, least))
    monkeypatch.setattr("wayproof.harness.trace.read_trace", lambda _: far)
    assert main(["explain", log, "--metrics"]) == 0
    assert f"│ least_clearance │ {said} │" in " ".join(capsys.readouterr().out.split())
    assert main(["explain", log, "--metrics", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["least_clearance_is_bound"] == (least == 2.0)


LEFT = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]  # a quarter turn about z
FACING = [1.0, 0.0, 0.0, 0.0]


def test_a_shift_of_all_poses_is_an_absolute_error_alone():
    truth = Track(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.tile(FACING, (3, 1)))
    shifted = Track(truth.positions + np.array([0.3, 0.4, 0.0]), truth.quaternions)
    assert ate(shifted, truth) == pytest.approx(0.5)
    assert rpe(shifted, truth) == pytest.approx(0.0, abs=1e-15)


def test_motions_are_compared_in_the_frame_of_the_body():
    """The estimate is turned by a quarter, and so are its steps: each walked one metre ahead."""
    truth = Track(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.tile(FACING, (3, 1)))
    turned = Track(np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]]), np.tile(LEFT, (3, 1)))
    assert relative_errors(turned, truth) == pytest.approx([0.0, 0.0], abs=1e-15)
    # Without the turn of its body, the same steps go to the side: (0, 1) against (1, 0).
    sideways = Track(turned.positions, truth.quaternions)
    assert rpe(sideways, truth) == pytest.approx(math.sqrt(2.0))


def test_a_scale_of_the_quaternion_does_not_matter():
    quarter = rotations(np.array([LEFT, [2.0 * one for one in LEFT]]))
    assert quarter[0] == pytest.approx(quarter[1])
    assert quarter[0] == pytest.approx(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))


def test_too_few_moments_have_no_error():
    none = Track(np.zeros((0, 3)), np.zeros((0, 4)))
    one = Track(np.zeros((1, 3)), np.array([FACING]))
    assert ate(none, none) is None
    assert rpe(one, one) is None
