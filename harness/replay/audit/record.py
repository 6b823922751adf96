"""Checks of the recorded inputs, settings and figures of a decision."""

from __future__ import annotations

import math

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
