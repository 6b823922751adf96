"""Rules for a decision's statements and its trajectory: inputs, figures, limits, joint and rest."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.decision import SAMPLE_PERIOD
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.log.paths import SAME_PLACE, heading_at, place_at, speed_at
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.committed import Committed, Violation

ROUNDING = 1e-9
"""Tolerance of figures computed in another order of operations, m and s."""

CELL_ROUNDING = 1e-6
"""Tolerance of a squared distance, cells^2."""


def check_version(committed: Committed) -> list[Violation]:
    """Check that the map version is that of the sweeps in the log."""
    said = committed.decision.map_version
    if said == committed.version:
        return []
    text = f"names map {said[:8]}, the log's sweeps give {committed.version[:8]}"
    return [committed.broken("version", text)]


def check_inputs(committed: Committed) -> list[Violation]:
    """Check that the recorded inputs are those in the log."""
    decision, inputs = committed.decision, committed.record.inputs
    pose = inputs.pose
    pairs = {
        "timestamp": (decision.timestamp.ToNanoseconds(), inputs.time_ns),
        "position": (list(decision.position), pose.position.tolist()),
        "quaternion": (list(decision.quaternion), pose.quaternion.tolist()),
        "position_sigma": (decision.position_sigma, pose.position_sigma),
        "input_digest": (decision.input_digest, inputs.digest),
        "delay_s": (decision.delay_s, committed.record.latency.delay_s),
    }
    return [
        committed.broken("inputs", f"{name} {said}, the log's input is {logged}")
        for name, (said, logged) in pairs.items()
        if said != logged
    ]


def check_settings(committed: Committed) -> list[Violation]:
    """Check that the recorded settings are those of the log."""
    decision, config = committed.decision, committed.config
    found = [
        committed.broken("settings", f"{name} '{said}', the config says '{expected}'")
        for name, said, expected in (
            ("representation", decision.representation, config.map.kind),
            ("unknown_policy", decision.unknown_policy, config.costmap.unknown_policy),
        )
        if said != expected
    ]
    found += [
        committed.broken("settings", f"{name} {said:g}, the config says {expected:g}")
        for name, said, expected in (
            ("resolution_m", decision.resolution_m, config.map.resolution),
            ("deadline_s", decision.deadline_s, config.latency.deadline),
        )
        if not abs(said - expected) <= ROUNDING  # nor NaN
    ]
    return found


def check_margin(committed: Committed) -> list[Violation]:
    """Check that margin, inflation radius and collision distance follow from settings and pose."""
    decision, margin = committed.decision, committed.margin
    if not abs(decision.localization_margin_m - margin) <= ROUNDING:
        text = f"{decision.localization_margin_m:.4f} m, config and pose give {margin:.4f} m"
        return [committed.broken("margin", text)]
    if tuple(decision.widening) != committed.body.widening:
        text = (
            f"widened by {tuple(decision.widening)} cells, the pose gives {committed.body.widening}"
        )
        return [committed.broken("margin", text)]
    said = decision.inflation_radius_m, decision.collision_distance_sq
    size = committed.config.map.resolution
    expected = []
    for radius in radii_of(committed.mission):
        inflation = radius + margin + size * committed.body.half_diagonal
        least = math.floor((inflation / size) ** 2 + CELL_ROUNDING)
        if abs(said[0] - inflation) <= ROUNDING and said[1] == least:
            return []
        expected.append(f"{inflation:.4f} m and {least}")
    text = (
        f"inflation {said[0]:.4f} m and {said[1]} squared cells, expected {' or '.join(expected)}"
    )
    return [committed.broken("margin", text)]


def radii_of(mission: Mission) -> list[float]:
    """Return the radii that a decision may use, m: of the body, or of its smallest disc."""
    if not mission.discs:
        return [mission.radius]
    about = max(abs(offset) + radius for offset, radius in mission.discs)
    return [about, min(radius for _, radius in mission.discs)]


def check_figures(committed: Committed) -> list[Violation]:
    """Check length, age of evidence and clearance of the committed path.

    Age and clearance of a late decision are those of the discarded path.
    """
    decision = committed.decision
    found = []
    own_length = committed.length
    if not abs(decision.committed_length_m - own_length) <= CELL_ROUNDING:
        text = (
            f"committed_length_m {decision.committed_length_m:.4f}, the path has {own_length:.4f}"
        )
        found.append(committed.broken("figure", text))
    if committed.late:
        return found
    observed = max(int(committed.measured.observed_ns_at(committed.path).min()), 0)
    age = (committed.record.inputs.time_ns - observed) * 1e-9
    if not abs(decision.evidence_age_s - age) <= CELL_ROUNDING:
        text = f"evidence_age_s {decision.evidence_age_s:.3f}, the map's is {age:.3f}"
        found.append(committed.broken("figure", text))
    return [*found, *_check_clearance(committed)]


def _check_clearance(committed: Committed) -> list[Violation]:
    """Check the least clearance to within a cell: a path may touch a neighbour or follow a face."""
    config = committed.config.costmap
    if config.class_margins or config.max_slope > 0.0:  # not the cells of the map count
        return []
    size, mission = committed.config.map.resolution, committed.mission
    radii = radii_of(mission)
    inflation = (min(radii) + committed.margin) / size + 0.5 * math.sqrt(
        2.0 if committed.body.flat else 3.0
    )
    reach = math.ceil(inflation + (config.cost_range + max(radii) - min(radii)) / size)  # cells
    cells = committed.body.cells(committed.map, committed.path, reach * size)
    least = cells.least_distance(cells.touched(committed.path), cells.not_free, float(reach))
    said = committed.decision.least_clearance_m / size
    if abs(said - least) <= 1.0 + CELL_ROUNDING:
        return []
    text = f"least_clearance_m {said * size:.3f}, the map's is {least * size:.3f}"
    return [committed.broken("figure", text)]


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
