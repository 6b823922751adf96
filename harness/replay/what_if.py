"""Decisions of changed settings on the inputs of a log, compared with the recorded ones."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.decision import differences, path_of
from wayproof.harness.errors import InputError
from wayproof.harness.log.paths import Array, densely, place_at
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.recompute.side_by_side import SideBySide
from wayproof.harness.schema import wayproof_pb2 as pb

SAME_PLACE = 0.01
"""Distance at equal times up to which two trajectories count as the same, m."""

SPACING = 0.1
"""Spacing of the points at which two routes are compared, m."""

SENSED = ("world", "robot", "start", "sensors", "estimate", "pose_model")
"""Settings that change the sensed data, which the inputs of a log cannot show."""

PLACED = ("source", "x", "y", "z", "yaw", "height", "scale", "up")
"""Settings of a prior map from which its cells followed, which a log holds."""


@dataclass(frozen=True)
class Answer:
    """Summary of one decision.

    Attributes:
        action: Action.
        label: Label.
        reason: Reason, in words.
        path_length_m: Length of the path to the goal; 0 without one.
        verdict: The referee's on the command of a stack on trial; empty of the built-in one.
    """

    action: str
    label: str
    reason: str
    path_length_m: float
    verdict: str = ""


@dataclass
class Verdicts:
    """Numbers of the referee's verdicts on the commands of a stack on trial.

    Attributes:
        admitted: Commands that it admits.
        unknown: Commands into unknown space.
        blocked: Commands into occupied space or out of the operating area.
        cut: Commands that a guard cuts or would cut: all that are not admitted.
        first_cut: Number of the first of these; None without any.
    """

    admitted: int = 0
    unknown: int = 0
    blocked: int = 0
    cut: int = 0
    first_cut: int | None = None

    def count(self, decision: pb.Decision) -> None:
        """Count another decision, if it has a verdict."""
        verdict = decision.verdict.verdict
        if not verdict:
            return
        setattr(self, verdict, getattr(self, verdict) + 1)
        if verdict != "admitted":
            self.cut += 1
            self.first_cut = decision.sequence if self.first_cut is None else self.first_cut


@dataclass(frozen=True)
class Change:
    """A decision that differs with the changed settings.

    Attributes:
        sequence: Number of the decision.
        time_s: Simulated time.
        recorded: Recorded decision.
        changed: Decision with the changed settings.
        departure_m: Greatest distance between the two trajectories at equal times, m.
        route_difference_m: Greatest distance between the two routes to the goal, m; None if there
            is only one.
    """

    sequence: int
    time_s: float
    recorded: Answer
    changed: Answer
    departure_m: float
    route_difference_m: float | None


@dataclass(frozen=True)
class WhatIf:
    """Comparison of the decisions of changed settings with those of a log.

    Attributes:
        log: The log's path.
        settings: Changes.
        decisions: Number of decisions in the log.
        faithful: Whether the recorded settings still give the recorded decisions, bit by bit.
        changes: Decisions that differ, in order.
        actions: Number of those whose action differs.
        first_action: Number of the first of these, if any.
        recorded_verdicts: The referee's verdicts with the recorded settings, on a stack on trial.
        changed_verdicts: The referee's verdicts with the changed settings.
        wall_time_s: Wall time, s.
    """

    log: str
    settings: tuple[str, ...]
    decisions: int
    faithful: bool
    changes: tuple[Change, ...]
    actions: int
    first_action: int | None
    recorded_verdicts: Verdicts
    changed_verdicts: Verdicts
    wall_time_s: float


def what_if(path: Path, settings: Sequence[str], allow_plugins: bool = False) -> WhatIf:
    """Decide again with changed settings, from the recorded inputs and state of each decision.

    Args:
        path: The log.
        settings: Changes as `section.field=value`.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: There is no such log or setting, or it changes the sensed data.
    """
    log = open_log(path, allow_plugins)
    changed = changed_config(log, settings)
    if changed.stack.name != log.config.stack.name:
        raise InputError(
            "--set stack.name: a log holds no answers of another stack; expected run --stack"
        )
    refuse_sensed(log.config, changed, "these need the simulator: replay fork forks the episode")
    _refuse_other_predictions(log.config, changed)
    began = time.perf_counter()
    twin = SideBySide(log, log.config, changed)
    changes = []
    decisions, faithful = 0, True
    old, new = Verdicts(), Verdicts()
    for record in log.records():
        recorded, other = twin.step(record)
        faithful = faithful and not differences(record.decision, recorded)
        change = compare(recorded, other, log.mission.planar)
        if change is not None:
            changes.append(change)
        old.count(recorded)
        new.count(other)
        decisions += 1
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    acts = [one.sequence for one in changes if one.recorded.action != one.changed.action]
    return WhatIf(
        log=str(path),
        settings=tuple(settings),
        decisions=decisions,
        faithful=faithful,
        changes=tuple(changes),
        actions=len(acts),
        first_action=acts[0] if acts else None,
        recorded_verdicts=old,
        changed_verdicts=new,
        wall_time_s=time.perf_counter() - began,
    )


def changed_config(log: Log, settings: Sequence[str]) -> Config:
    """Return the config of a log with changed settings.

    Raises:
        InputError: A setting is unknown or refused, or the log was forked.
    """
    if log.fork is not None:
        raise InputError(
            f"log '{log.path}': forked at {log.fork.at}, so it has no settings of its own to "
            "change; expected the log forked from, or replay fork"
        )
    return override(log.config, settings)


def refuse_sensed(old: Config, new: Config, advice: str, names: Sequence[str] = SENSED) -> None:
    """Raise an InputError if one of the named settings, which change the sensed data, differs."""
    for name in names:
        if getattr(old, name) != getattr(new, name):
            raise InputError(f"--set {name}: changes what is sensed; {advice}")
    for name in PLACED:
        if getattr(old.prior, name) != getattr(new.prior, name):
            raise InputError(
                f"--set prior.{name}: the log holds the cells of the prior map as placed; "
                "expected prior.policy"
            )


def _refuse_other_predictions(old: Config, new: Config) -> None:
    """Raise an InputError if settings need predictions that a log does not hold."""
    before, after = old.prediction, new.prediction
    outside = is_outside(before.source) or is_outside(after.source)
    if outside and (before.source, before.reach) != (after.source, after.reach):
        raise InputError(
            "--set prediction.source or reach: the log holds what the predictor said; expected "
            "prediction.policy, occupied_from or free_below, or replay fork"
        )
    if new.runs_predictor and not old.runs_predictor:
        raise InputError(
            "--set prediction.policy: the predictor was not run, so the log holds no predictions"
        )


def compare(old: pb.Decision, new: pb.Decision, flat: bool) -> Change | None:
    """Return the difference between two decisions; None if it makes none to the robot.

    Args:
        old: Recorded decision.
        new: Decision with the changed settings.
        flat: Whether the robot walks, so that heights do not count.
    """
    axes = 2 if flat else 3
    departure = _greatest_distance(old.trajectory, new.trajectory, axes)
    first, second = path_of(old.global_path)[:, :axes], path_of(new.global_path)[:, :axes]
    route = None if min(len(first), len(second)) == 0 else _route_difference(first, second)
    same_route = len(first) == len(second) == 0 or (route is not None and route <= SAME_PLACE)
    acts, would = ((d.action, d.label, d.verdict.verdict, d.verdict.cut) for d in (old, new))
    if acts == would and departure <= SAME_PLACE and same_route:
        return None
    return Change(
        sequence=old.sequence,
        time_s=old.timestamp.ToNanoseconds() * 1e-9,
        recorded=_answer(old),
        changed=_answer(new),
        departure_m=departure,
        route_difference_m=route,
    )


def _answer(decision: pb.Decision) -> Answer:
    verdict = decision.verdict.verdict
    return Answer(decision.action, decision.label, decision.reason, decision.path_length_m, verdict)


def _greatest_distance(old: pb.Trajectory, new: pb.Trajectory, axes: int) -> float:
    """Return the greatest distance between two trajectories at equal times, m."""
    begin = min(old.start.ToNanoseconds(), new.start.ToNanoseconds())
    ends = [one.start.ToNanoseconds() + one.duration_s * 1e9 for one in (old, new)]
    times = np.arange(begin, max(ends) + 1e8, 1e8)
    places = [
        np.array([place_at(one, int(time)) for time in times])[:, :axes] for one in (old, new)
    ]
    return float(np.linalg.norm(places[0] - places[1], axis=1).max())


def _route_difference(old: Array, new: Array) -> float:
    """Return the greatest distance of a point of either route from the other one, m."""
    first, second = densely(old, SPACING), densely(new, SPACING)
    gaps = np.linalg.norm(first[:, None] - second[None], axis=2)
    between = max(gaps.min(axis=0).max(), gaps.min(axis=1).max())
    # Two samplings of one line are up to half a spacing apart.
    return max(0.0, float(between) - 0.5 * SPACING)
