"""Checks that the body can follow a trajectory and comes to rest."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.decision import SAMPLE_PERIOD
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.log.paths import SAME_PLACE, heading_at, place_at, speed_at
from wayproof.harness.replay.audit.committed import Committed, Violation

LIMIT_SLACK = 1.05
"""Tolerance factor of speeds, rates and accelerations, which are read from samples 0.1 s apart;
the limiter of a stack on trial has the same."""

REST = 0.02
"""Speed below which a body is at rest, m/s; and the tolerance of speeds, m/s, and rates, rad/s,
beyond the factor."""


def check_limits(committed: Committed) -> list[Violation]:
    """Check that the samples keep the limits of the body and end at rest."""
    trajectory, mission = committed.decision.trajectory, committed.mission
    arcs, period = np.array(trajectory.arc_length), trajectory.sample_period_s
    found: list[Violation] = []
    if len(arcs) < 2:
        return found
    speeds = np.diff(arcs) / period
    accelerations = np.diff(speeds) / period
    # The last sample is at or after the end, so the step before it holds the last motion.
    remaining = arcs[-1] - arcs[-2]
    stop = math.sqrt(2.0 * max(remaining, 0.0) * mission.max_acceleration)
    if speeds[-1] > max(REST, stop * LIMIT_SLACK):
        found.append(committed.broken("rest", f"moves at {speeds[-1]:.2f} m/s when it ends"))
    if arcs[-1] > committed.length + SAME_PLACE:
        found.append(committed.broken("rest", "runs on beyond the end of its path"))
    if speeds.max() > mission.max_speed * LIMIT_SLACK + REST:
        text = f"{speeds.max():.2f} m/s, {mission.max_speed:g} allowed"
        found.append(committed.broken("limits", text))
    rate = float(np.abs(np.diff(trajectory.heading)).max()) / period
    if rate > mission.max_yaw_rate * LIMIT_SLACK + REST:
        text = f"turns at {rate:.2f} rad/s, {mission.max_yaw_rate:g} allowed"
        found.append(committed.broken("limits", text))
    hardest = np.abs(accelerations).max() if len(accelerations) else 0.0
    if hardest > mission.max_acceleration * LIMIT_SLACK + REST / period:
        text = f"{hardest:.2f} m/s^2, {mission.max_acceleration:g} allowed"
        found.append(committed.broken("limits", text))
    return found


def check_joint(committed: Committed) -> list[Violation]:
    """Check that the trajectory starts at the position, speed and heading of the one before.

    The heading is that of a body on the ground: what it is in the air sweeps no other space.
    """
    trajectory, before = committed.decision.trajectory, committed.before[-1]
    start_ns = trajectory.start.ToNanoseconds()
    if committed.late:
        return []
    if start_ns < before.start.ToNanoseconds():
        return [committed.broken("joined", "starts before the trajectory before it")]
    off = committed.apart(place_at(trajectory, start_ns), place_at(before, start_ns))
    # Between samples 0.1 s apart the body is off the chord by a t^2 / 8 at most.
    if off > 2.0 * SAME_PLACE:
        text = f"starts {off:.2f} m from where the trajectory before it is then"
        return [committed.broken("joined", text)]
    speeds = speed_at(trajectory, start_ns), speed_at(before, start_ns)
    # A body can change its speed and its heading by so much within a sample period.
    mission, within_s = committed.mission, SAMPLE_PERIOD * LIMIT_SLACK
    allowed = mission.max_acceleration * within_s + REST
    if abs(speeds[0] - speeds[1]) > allowed:
        text = f"starts at {speeds[0]:.2f} m/s, the trajectory before it is at {speeds[1]:.2f} then"
        return [committed.broken("joined", text)]
    turn = abs(wrap_angle(heading_at(trajectory, start_ns) - heading_at(before, start_ns)))
    if mission.planar and turn > mission.max_yaw_rate * within_s + REST:
        text = f"starts at a heading {turn:.2f} rad off that of the trajectory before it"
        return [committed.broken("joined", text)]
    return []


def check_rest(committed: Committed) -> list[Violation]:
    """Check that a robot that has arrived or gives up stays in place."""
    decision = committed.decision
    if decision.action not in ("goal", "abort") or committed.late:
        return []
    moved = committed.length
    if moved < SAME_PLACE:
        return []
    return [committed.broken("rest", f"action {decision.action}: leads on by {moved:.2f} m")]


def check_deadline(committed: Committed) -> list[Violation]:
    """Check that a late decision is marked as such and keeps the trajectory before."""
    decision, found = committed.decision, []
    if decision.deadline_missed != committed.late:
        words = {True: "missed", False: "kept"}
        delay, deadline = committed.record.latency.delay_s, committed.config.latency.deadline
        text = (
            f"says that its deadline was {words[decision.deadline_missed]}, "
            f"took {delay:g} s of {deadline:g} s"
        )
        found.append(committed.broken("deadline", text))
    if not committed.late:
        return found
    if decision.action not in ("stop_and_wait", "follow"):  # the reason decides which
        found.append(committed.broken("deadline", f"late, but its action is {decision.action}"))
    if not committed.keeps_trajectory:
        found.append(committed.broken("deadline", "late, but another trajectory than the last one"))
    return found
