"""Card of one decision: its inputs, its costs, its result, and the cells that block it.

The map of the decision is rebuilt from the inputs of the log.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.attribution.commanded import admitted_length
from wayproof.harness.config import Config
from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError
from wayproof.harness.explain.commanded import command_in_words, commanded
from wayproof.harness.goals import goal_name
from wayproof.harness.log.paths import densely, length
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.prior_config import NO_PRIOR
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.labels import combined_version
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]


SHOWN_CELLS = 5
"""Maximum number of blocking cells on a card, those nearest to the path."""


@dataclass(frozen=True)
class BlockingCell:
    """Cell that blocks the path.

    Attributes:
        state: `occupied`, `unknown`, or `floor not seen`: the column is free above its floor.
        place: (x, y, z) of its centre, m; on the ground of its column.
        distance_m: Distance from the robot, m.
        age_s: Time since its last observation, s; None without one.
        probability: Probability of occupancy; on the ground the greatest in its column.
    """

    state: str
    place: tuple[float, float, float]
    distance_m: float
    age_s: float | None
    probability: float


@dataclass(frozen=True)
class Card:
    """One decision, and what its map, its inputs and the truth say of it.

    Attributes:
        decision: The decision, as logged.
        config: Settings of the decision.
        time_s: Simulated time, s.
        version_holds: Whether the rebuilt map has the version that the decision names.
        pose_error_m: Distance between estimated and true position, m.
        true_clearance_m: True distance from the body to the nearest thing, m.
        oldest_evidence_s: Age of the oldest measurement along the committed path, s.
        median_evidence_s: Median age of the measurements along it, s.
        greatest_probability: Greatest probability of occupancy along it.
        mean_entropy_bits: Mean entropy along it, bits; 1 for an unknown cell.
        goal: The goal that it leads to, in words.
        goal_distance_m: Straight distance from the estimated position to the goal, m; in the plane
            on the ground.
        blocking: Cells that end the committed path, nearest first.
        unmeasured: Sources of a prior map and of predictions with their policies; empty without.
        stack: Name of the stack on trial; empty of the built-in one.
        answer: The stack's description of its command: motion, reason and scalars, in one line.
        planned_m: Length of the stack's own planned path, m; 0 without one.
        planned_admitted_m: Length of it up to the first cell that the policy does not let the body
            enter in the referee's map, m.
        keyframe: Number of the decision after whose map in the log this map was made again; None
            from the start.
    """

    decision: pb.Decision
    config: Config
    time_s: float
    version_holds: bool
    pose_error_m: float
    true_clearance_m: float
    oldest_evidence_s: float
    median_evidence_s: float
    greatest_probability: float
    mean_entropy_bits: float
    goal: str
    goal_distance_m: float
    blocking: tuple[BlockingCell, ...]
    unmeasured: str
    stack: str
    answer: str
    planned_m: float
    planned_admitted_m: float
    keyframe: int | None = None

    @property
    def path_leads_to(self) -> str:
        """`the goal`, `a viewpoint`, `admitted space`, or empty without a path."""
        if not len(self.decision.global_path):
            return ""
        if self.decision.predicate.kind in ("looking_elsewhere", "going_back"):
            return "a viewpoint"
        return "admitted space" if self.decision.action == "recover" else "the goal"

    def document(self) -> dict[str, Any]:
        """Return the figures and words of decision and card, by name, for JSON."""
        stated = {
            one.name: getattr(self.decision, one.name)
            for one in self.decision.DESCRIPTOR.fields
            if one.message_type is None and not isinstance(getattr(self.decision, one.name), bytes)
        }
        stated = {k: v if isinstance(v, str | float | int) else list(v) for k, v in stated.items()}
        own = {one.name: getattr(self, one.name) for one in fields(self)[2:]}
        return {**stated, **own, "blocking": [asdict(one) for one in self.blocking]}


def moment_of(case: Case, number: int) -> Moment:
    """Return one decision of a case.

    Raises:
        InputError: There is no such decision.
    """
    if not 0 <= number < len(case.moments):
        raise InputError(
            f"decision {number}: expected a decision's number, 0 to {len(case.moments) - 1}"
        )
    return case.moments[number]


def make_card(
    case: Case, number: int, navigator: Navigator | None = None, keyframe: int | None = None
) -> Card:
    """Return the card of a decision.

    Args:
        case: The episode.
        number: Number of the decision.
        navigator: Stack with the map of the decision, if it exists already.
        keyframe: Number of the decision of the keyframe that the map was made from, if it was.

    Raises:
        InputError: There is no such decision.
    """
    moment = moment_of(case, number)
    case = case.as_of(number)
    navigator = navigator or case.navigator_at(number)
    decision, axes = moment.decision, case.axes
    ages, probabilities = _evidence(navigator, moment)
    version = combined_version(navigator.map.version(), navigator.labels)
    command = commanded(moment.answer, decision)
    plan = np.zeros((0, 3)) if command is None else command.planned_path
    planned = len(plan) >= 2
    return Card(
        decision=decision,
        config=case.config,
        time_s=moment.time_ns * 1e-9,
        version_holds=version == decision.map_version,
        pose_error_m=float(np.linalg.norm(moment.error[:axes])),
        true_clearance_m=moment.truth.clearance_m,
        oldest_evidence_s=float(ages.max()),
        median_evidence_s=float(np.median(ages)),
        greatest_probability=float(probabilities.max()),
        mean_entropy_bits=float(_entropy(probabilities).mean()),
        goal=goal_name(case.segments[-1].mission, 0 if moment.goal is None else moment.goal.index),
        goal_distance_m=math.dist(decision.position[:axes], case.mission.goal[:axes]),
        blocking=blocking_cells(case, moment, navigator),
        unmeasured="; ".join(_unmeasured(case.config, moment)),
        stack="" if moment.answer is None else case.config.stack.name,
        answer="" if command is None else command_in_words(command.message),
        planned_m=length(plan) if planned else 0.0,
        planned_admitted_m=(
            admitted_length(decision, case.mission, navigator.costmap, plan) if planned else 0.0
        ),
        keyframe=keyframe,
    )


def _unmeasured(config: Config, moment: Moment) -> list[str]:
    """Return the sources of a prior map and of predictions, in words."""
    prior, prediction, used = config.prior, config.prediction, []
    if prior.source != NO_PRIOR:
        used.append(f"prior map {prior.source}, {prior.policy}")
    if prediction.source != NO_PREDICTOR:
        answered = ""
        if moment.prediction is not None:
            late = ", too late" if moment.prediction.late else ""
            answered = f" ('{moment.prediction.predictor}'{late})"
        used.append(f"prediction {prediction.source}, {prediction.policy}{answered}")
    return used


def _evidence(navigator: Navigator, moment: Moment) -> tuple[Array, Array]:
    """Return age (n,), s, and probability (n,) of the known cells along the committed path."""
    path = densely(path_of(moment.decision.trajectory.path), navigator.map.resolution)
    observed = np.maximum(navigator.map.observed_ns_at(path), 0)
    ages = (moment.time_ns - observed) * 1e-9
    return ages, np.asarray(navigator.map.probability_at(path), float)


def _entropy(probabilities: Array) -> Array:
    """Return the Shannon entropy of the occupancy of cells, bits."""
    p = np.clip(probabilities, 1e-9, 1.0 - 1e-9)
    return -(p * np.log2(p) + (1.0 - p) * np.log2(1.0 - p))


def blocking_cells(case: Case, moment: Moment, navigator: Navigator) -> tuple[BlockingCell, ...]:
    """Return the cells that first block the way to the goal by the unknown policy; maybe none.

    The way is the global path, of a stack on trial its planned path; or without one the straight
    line to the goal.
    """
    costmap, decision = navigator.costmap, moment.decision
    # Of the disc or discs of the decision: an elongated body has two widths.
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
        _blocking(
            case, moment, navigator, cell=tuple(found[k].tolist()), centre=centres[k], here=here
        )
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
    """Describe one cell, whose centre is (3,) m, as seen from the body at `here` (3,), m."""
    occupied = navigator.costmap.state[cell] == OCCUPIED
    column, state = centre[None], "occupied" if occupied else "unknown"
    if case.mission.planar:
        size = navigator.map.resolution
        heights = np.arange(0.5 * size, case.mission.height, size)
        column = np.column_stack([np.tile(centre[:2], (len(heights), 1)), heights])
        floor = np.array([[*centre[:2], 0.0]])
        unseen = navigator.map.state_at(floor)[0] == UNKNOWN
        if not occupied and unseen and (navigator.map.state_at(column[1:]) == FREE).all():
            column, centre, state = floor, floor[0], "floor not seen"
    observed = int(navigator.map.observed_ns_at(column).max())
    if state == "floor not seen":
        observed = -1  # the beams that passed above it looked at no floor
    x, y, z = centre.tolist()
    return BlockingCell(
        state=state,
        place=(x, y, z),
        distance_m=float(np.linalg.norm((centre - here)[: case.axes])),
        age_s=None if observed < 0 else (moment.time_ns - observed) * 1e-9,
        probability=float(navigator.map.probability_at(column).max()),
    )


def _way(case: Case, moment: Moment) -> Array:
    """Return the way (n, 3) to the goal that the cells block, m; see `blocking_cells`."""
    global_path = path_of(moment.decision.global_path)
    committed = path_of(moment.decision.trajectory.path)
    if len(global_path) >= 2:
        return global_path
    goal = np.array(case.mission.goal)
    if case.mission.planar:
        goal[2] = committed[-1, 2]
    return np.vstack([committed[-1], goal])
