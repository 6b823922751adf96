"""One decision as a card: what it rested on, what it cost, what it chose, what was in its way.

The map at the decision comes from taking the log's inputs up to it into an empty one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.clearance import map_clearance_is_bound, true_clearance_is_bound
from wayproof.harness.errors import InputError
from wayproof.harness.log.paths import densely
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import path_of
from wayproof.harness.stack.labels import combined_version
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED

Array = NDArray[np.float64]

SHOWN_CELLS = 5
"""Blocking cells on a card, the nearest to the path first."""


@dataclass(frozen=True)
class BlockingCell:
    """A cell that keeps the path from going on.

    Attributes:
        state: `occupied` or `unknown`.
        place: (x, y, z) of its centre, m; on the ground of its column.
        distance_m: From the robot.
        age_s: Since the map last looked there; none if it never did.
        probability: Of being occupied, on the ground the greatest in its column.
    """

    state: str
    place: tuple[float, float, float]
    distance_m: float
    age_s: float | None
    probability: float


@dataclass(frozen=True)
class Card:
    """One decision.

    Attributes:
        sequence: Its number.
        time_s: Simulated time.
        action: What the robot does.
        reason: Why.
        label: What stood in the way.
        representation: Sort of map.
        version: Hash of the map's content.
        version_holds: Whether the replayed map has that version.
        resolution_m: Of the map.
        unknown_policy: What unknown space is to the planner.
        inflation_radius_m: Body, margin and half a cell's diagonal.
        margin_m: For localization.
        position: Believed, m.
        position_sigma_m: Of it, as the estimator states it.
        pose_error_m: Believed less true position, its length.
        true_clearance_m: From the body to the nearest thing, by the truth.
        oldest_evidence_s: Along the committed path.
        median_evidence_s: Likewise.
        greatest_probability: Of being occupied, along it.
        mean_entropy_bits: Along it; 1 for a cell of which nothing is known.
        stages_ms: Wall time by stage.
        delay_s: That the robot felt.
        expected_delay_s: That the stack reckoned with.
        deadline_s: Of it.
        deadline_missed: Whether the decision was discarded for it.
        planner: Of this decision's search; empty if the path was kept.
        iterations: Of it.
        goal_distance_m: Straight, from the believed position to the goal; in the plane on the
            ground.
        path_leads_to: `the goal`, `a viewpoint`, `admitted space`, or empty if there is no path.
        path_length_m: Of the path; 0 if there is none.
        committed_m: The part that may be entered.
        least_clearance_m: Along it, by the map.
        least_clearance_is_bound: Whether it may be larger, as the map's distances end there.
        true_clearance_is_bound: Whether the true clearance may be larger, likewise.
        blocking: Cells that end the committed part, nearest first.
        perturbation: What is perturbed, and how much; empty for nothing.
    """

    sequence: int
    time_s: float
    action: str
    reason: str
    label: str
    representation: str
    version: str
    version_holds: bool
    resolution_m: float
    unknown_policy: str
    inflation_radius_m: float
    margin_m: float
    position: tuple[float, ...]
    position_sigma_m: float
    pose_error_m: float
    true_clearance_m: float
    oldest_evidence_s: float
    median_evidence_s: float
    greatest_probability: float
    mean_entropy_bits: float
    stages_ms: dict[str, float]
    delay_s: float
    expected_delay_s: float
    deadline_s: float
    deadline_missed: bool
    planner: str
    iterations: int
    goal_distance_m: float
    path_leads_to: str
    path_length_m: float
    committed_m: float
    least_clearance_m: float
    least_clearance_is_bound: bool
    true_clearance_is_bound: bool
    blocking: tuple[BlockingCell, ...]
    perturbation: str


def moment_of(case: Case, number: int) -> Moment:
    """One decision of a case.

    Raises:
        InputError: It has none of that number.
    """
    if not 0 <= number < len(case.moments):
        raise InputError(
            f"decision {number}: expected a decision's number, 0 to {len(case.moments) - 1}"
        )
    return case.moments[number]


def make_card(case: Case, number: int, navigator: Navigator | None = None) -> Card:
    """The card of a decision.

    Args:
        case: The episode.
        number: Of the decision.
        navigator: With the map as it was then, where somebody has it already.

    Raises:
        InputError: There is no such decision.
    """
    moment = moment_of(case, number)
    case = case.as_of(number)
    navigator = navigator or case.navigator_at(number)
    decision = moment.decision
    ages, probabilities = _evidence(navigator, moment)
    stages = decision.stages
    perturbation = case.config.perturbation
    return Card(
        sequence=decision.sequence,
        time_s=moment.time_ns * 1e-9,
        action=decision.action,
        reason=decision.reason,
        label=decision.label,
        representation=decision.representation,
        version=decision.map_version,
        version_holds=combined_version(navigator.map.version(), navigator.labels)
        == decision.map_version,
        resolution_m=decision.resolution_m,
        unknown_policy=decision.unknown_policy,
        inflation_radius_m=decision.inflation_radius_m,
        margin_m=decision.localization_margin_m,
        position=tuple(decision.position),
        position_sigma_m=decision.position_sigma,
        pose_error_m=float(np.linalg.norm(moment.error[: case.axes])),
        true_clearance_m=moment.truth.clearance_m,
        oldest_evidence_s=float(ages.max()),
        median_evidence_s=float(np.median(ages)),
        greatest_probability=float(probabilities.max()),
        mean_entropy_bits=float(_entropy(probabilities).mean()),
        stages_ms={
            "sense": stages.sense_ms,
            "map": stages.map_ms,
            "costmap": stages.costmap_ms,
            "plan": stages.plan_ms,
        },
        delay_s=decision.delay_s,
        expected_delay_s=case.config.latency.expected,
        deadline_s=decision.deadline_s,
        deadline_missed=decision.deadline_missed,
        planner=decision.planner,
        iterations=decision.planner_iterations,
        goal_distance_m=math.dist(decision.position[: case.axes], case.mission.goal[: case.axes]),
        path_leads_to=_leads_to(decision),
        path_length_m=decision.path_length_m,
        committed_m=decision.committed_length_m,
        least_clearance_m=decision.least_clearance_m,
        least_clearance_is_bound=map_clearance_is_bound(decision, case.config.costmap.cost_range),
        true_clearance_is_bound=true_clearance_is_bound(moment.truth.clearance_m),
        blocking=blocking_cells(case, moment, navigator),
        perturbation=""
        if perturbation is None
        else f"{perturbation.kind} {perturbation.amount:g} {perturbation.unit}",
    )


def _leads_to(decision: pb.Decision) -> str:
    """Where a decision's path leads; in a log of before format 5 an errand looks like the goal."""
    if not len(decision.global_path):
        return ""
    if decision.predicate.kind in ("looking_elsewhere", "backing_up"):
        return "a viewpoint"
    return "admitted space" if decision.action == "recover" else "the goal"


def blocking_cells(case: Case, moment: Moment, navigator: Navigator) -> tuple[BlockingCell, ...]:
    """Cells that first block the way to the goal under the unknown policy; empty if none does.

    The way is the global path beyond the trajectory, or without one the straight line to the goal.
    """
    costmap, decision = navigator.costmap, moment.decision
    # Of the disc or discs that it was made for: a long body has two widths.
    limit, radius = decision.collision_distance_sq, decision.inflation_radius_m
    field, size = costmap.field(), costmap.resolution
    way = densely(_way(case, moment), 0.5 * size)
    cells = np.floor((way - costmap.origin) / size).astype(int)
    inside = ((cells >= 0) & (cells < costmap.shape)).all(axis=1)
    cells, way = cells[inside], way[inside]
    closed = np.flatnonzero(field[tuple(cells.T)] <= limit) if len(cells) else cells[:, 0]
    if not len(closed):
        return ()
    place = way[closed[0]]
    states = costmap.state
    wrong = states != FREE if costmap.config.unknown_policy == "forbid" else states == OCCUPIED
    found = np.argwhere(wrong)
    centres = np.round(costmap.origin + (found + 0.5) * size, 9)  # as a reason prints them
    gaps = np.linalg.norm(centres - place, axis=1)
    nearest = np.argsort(gaps, kind="stable")[:SHOWN_CELLS]
    nearest = nearest[gaps[nearest] <= radius + size]
    here = np.array(moment.pose.position)
    return tuple(
        _blocking(case, moment, navigator, tuple(found[k].tolist()), centres[k], here)
        for k in nearest
    )


def _blocking(
    case: Case,
    moment: Moment,
    navigator: Navigator,
    cell: tuple[int, ...],
    centre: Array,
    here: Array,
) -> BlockingCell:
    occupied = navigator.costmap.state[cell] == OCCUPIED
    column = centre[None]
    if case.mission.planar:
        size = navigator.map.resolution
        heights = np.arange(0.5 * size, case.mission.height, size)
        column = np.column_stack([np.tile(centre[:2], (len(heights), 1)), heights])
    observed = int(navigator.map.observed_ns_at(column).max())
    x, y, z = centre.tolist()
    return BlockingCell(
        state="occupied" if occupied else "unknown",
        place=(x, y, z),
        distance_m=float(np.linalg.norm((centre - here)[: case.axes])),
        age_s=None if observed < 0 else (moment.time_ns - observed) * 1e-9,
        probability=float(navigator.map.probability_at(column).max()),
    )


def _way(case: Case, moment: Moment) -> Array:
    global_path = path_of(moment.decision.global_path)
    committed = path_of(moment.decision.trajectory.path)
    if len(global_path) >= 2:
        return global_path
    goal = np.array(case.mission.goal)
    if case.mission.planar:
        goal[2] = committed[-1, 2]
    return np.vstack([committed[-1], goal])


def _evidence(navigator: Navigator, moment: Moment) -> tuple[Array, Array]:
    """Age (n,), s, and probability (n,) of what is known along the committed path."""
    path = densely(path_of(moment.decision.trajectory.path), navigator.map.resolution)
    observed = np.maximum(navigator.map.observed_ns_at(path), 0)
    ages = (moment.time_ns - observed) * 1e-9
    return ages, np.asarray(navigator.map.probability_at(path), float)


def _entropy(probabilities: Array) -> Array:
    """Of a cell's occupancy, bits (Shannon)."""
    p = np.clip(probabilities, 1e-9, 1.0 - 1e-9)
    return -(p * np.log2(p) + (1.0 - p) * np.log2(1.0 - p))
