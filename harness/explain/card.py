"""Card of one decision: its inputs, its costs, its result, and the cells that block it.

The map of the decision is rebuilt from the inputs of the log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.attribution.commanded import admitted_length
from wayproof.harness.clearance import map_clearance_is_bound, true_clearance_is_bound
from wayproof.harness.decision import path_of, widened_in_words
from wayproof.harness.errors import InputError
from wayproof.harness.explain.blocking_cells import BlockingCell, blocking_cells
from wayproof.harness.explain.commanded import Commanded, command_in_words, commanded
from wayproof.harness.explain.floor import floor_in_words
from wayproof.harness.goals import goal_name
from wayproof.harness.log.paths import densely, length
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.prior_config import NO_PRIOR
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.labels import combined_version
from wayproof.harness.stack.pipeline import Navigator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Card:
    """One decision.

    Attributes:
        sequence: Number of the decision.
        time_s: Simulated time, s.
        action: Action.
        reason: Reason.
        label: Label.
        representation: Map representation.
        version: Hash of the content of the map.
        version_holds: Whether the rebuilt map has that version.
        resolution_m: Resolution of the map, m.
        unknown_policy: Treatment of unknown space by the planner.
        inflation_radius_m: Body, margin and half the diagonal of a cell, m.
        margin_m: Localization margin, m.
        widened: Its excess along x and y, in words after a comma; empty without one.
        position: Estimated position, m.
        position_sigma_m: Its standard deviation, as the estimator states it, m.
        pose_error_m: Distance between estimated and true position, m.
        true_clearance_m: True distance from the body to the nearest thing, m.
        oldest_evidence_s: Age of the oldest measurement along the committed path, s.
        median_evidence_s: Median age of the measurements along it, s.
        greatest_probability: Greatest probability of occupancy along it.
        mean_entropy_bits: Mean entropy along it, bits; 1 for an unknown cell.
        stages_ms: Wall time by stage, ms.
        delay_s: Delay of the decision, s.
        expected_delay_s: Delay that the stack expected, s.
        deadline_s: Deadline, s.
        deadline_missed: Whether the decision was late and discarded.
        planner: Planner of the search; empty if the path was kept.
        iterations: Its iterations.
        goal: The goal that it leads to, in words.
        goal_distance_m: Straight distance from the estimated position to the goal, m; in the plane
            on the ground.
        path_leads_to: `the goal`, `a viewpoint`, `admitted space`, or empty without a path.
        path_length_m: Length of the path, m; 0 without one.
        committed_m: Length of the committed path, m.
        least_clearance_m: Least clearance along it in the map, m.
        least_clearance_is_bound: Whether it may be larger, beyond the map's greatest distance.
        true_clearance_is_bound: Whether the true clearance may be larger in the same way.
        blocking: Cells that end the committed path, nearest first.
        floor: Floor that its sweeps were levelled by; empty where it was as expected.
        perturbation: Kind and amount of the perturbation; empty without one.
        stack: Name of the stack on trial; empty of the built-in one.
        verdict: Verdict of the referee on its command; empty of the built-in stack.
        answer: The stack's description of its command: motion, reason and scalars, in one line.
        planned_m: Length of the stack's own planned path, m; 0 without one.
        planned_admitted_m: Length of it up to the first cell that the policy does not let the body
            enter in the referee's map, m.
        unmeasured: Sources of a prior map and of predictions with their policies; empty without.
        committed_evidence: Lengths of the committed path by what they rest on, m; empty without
            such.
        global_evidence: Lengths of the global path by what they rest on, m.
        keyframe: Number of the decision after whose map in the log this map was made again; None
            from the start.
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
    widened: str
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
    goal: str
    goal_distance_m: float
    path_leads_to: str
    path_length_m: float
    committed_m: float
    least_clearance_m: float
    least_clearance_is_bound: bool
    true_clearance_is_bound: bool
    blocking: tuple[BlockingCell, ...]
    floor: str
    perturbation: str
    stack: str = ""
    verdict: str = ""
    answer: str = ""
    planned_m: float = 0.0
    planned_admitted_m: float = 0.0
    unmeasured: str = ""
    committed_evidence: dict[str, float] = field(default_factory=dict)
    global_evidence: dict[str, float] = field(default_factory=dict)
    keyframe: int | None = None


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


def make_card(case: Case, number: int, navigator: Navigator | None = None) -> Card:
    """Return the card of a decision.

    Args:
        case: The episode.
        number: Number of the decision.
        navigator: Stack with the map of the decision, if it exists already.

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
    card = Card(
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
        widened=widened_in_words(decision),
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
            **({"predict": stages.predict_ms} if stages.predict_ms else {}),
        },
        delay_s=decision.delay_s,
        expected_delay_s=case.config.latency.expected,
        deadline_s=decision.deadline_s,
        deadline_missed=decision.deadline_missed,
        planner=decision.planner,
        iterations=decision.planner_iterations,
        goal=goal_name(case.segments[-1].mission, 0 if moment.goal is None else moment.goal.index),
        goal_distance_m=math.dist(decision.position[: case.axes], case.mission.goal[: case.axes]),
        path_leads_to=_leads_to(decision),
        path_length_m=decision.path_length_m,
        committed_m=decision.committed_length_m,
        least_clearance_m=decision.least_clearance_m,
        least_clearance_is_bound=map_clearance_is_bound(decision, case.config.costmap.cost_range),
        true_clearance_is_bound=true_clearance_is_bound(moment.truth.clearance_m),
        blocking=blocking_cells(case, moment, navigator),
        floor=floor_in_words(case, moment),
        perturbation=""
        if perturbation is None
        else f"{perturbation.kind} {perturbation.amount:g} {perturbation.unit}",
        stack="" if moment.answer is None else case.config.stack.name,
        verdict=_verdict(decision),
    )
    return _with_stack(_with_prior(card, case, moment), case, number, navigator)


def command_at(case: Case, number: int) -> Commanded | None:
    """Return the command of a stack on trial in one decision; None of the built-in stack.

    Raises:
        InputError: The logged answer is no command.
    """
    moment, before = case.moments[number], case.moments[:number]
    kept = [one.decision.trajectory for one in before if not one.decision.deadline_missed]
    followed = kept[-1] if kept else None
    return commanded(moment.answer, moment.decision, followed, case.config, case.mission)


def _with_prior(card: Card, case: Case, moment: Moment) -> Card:
    """Add what only a decision with a prior map or predictions has."""
    config, decision = case.config, moment.decision
    prior, prediction = config.prior, config.prediction
    used = []
    if prior.source != NO_PRIOR:
        used.append(f"prior map {prior.source}, {prior.policy}")
    if prediction.source != NO_PREDICTOR:
        used.append(f"prediction {prediction.source}, {prediction.policy}{_answered(moment)}")
    if not used:
        return card
    return replace(
        card,
        unmeasured="; ".join(used),
        committed_evidence=_lengths(decision.committed_evidence),
        global_evidence=_lengths(decision.global_evidence),
    )


def _answered(moment: Moment) -> str:
    """Return how a predictor from outside calls itself, and whether its answer came late."""
    if moment.prediction is None:
        return ""
    late = ", too late" if moment.prediction.late else ""
    return f" ('{moment.prediction.predictor}'{late})"


def _lengths(evidence: pb.Evidence) -> dict[str, float]:
    names = [field.name for field in evidence.DESCRIPTOR.fields]
    return {name.removesuffix("_m"): getattr(evidence, name) for name in names}


def _with_stack(card: Card, case: Case, number: int, navigator: Navigator) -> Card:
    """Add what only a decision of a stack on trial has."""
    command = command_at(case, number)
    if command is None:
        return card
    answer, plan = command_in_words(command.message), command.planned_path
    if len(plan) < 2:
        return replace(card, answer=answer)
    decision = case.moments[number].decision
    admitted = admitted_length(decision, case.mission, navigator.costmap, plan)
    return replace(card, answer=answer, planned_m=length(plan), planned_admitted_m=admitted)


def _verdict(decision: pb.Decision) -> str:
    """Return the referee's verdict in words; empty of the built-in stack."""
    verdict = decision.verdict
    if not verdict.verdict:
        return ""
    limited = "; beyond the body's limits, judged within them" if verdict.limited else ""
    cut = "; the guard braked in its place" if verdict.cut else ""
    return f"{verdict.verdict}, free for {verdict.free_m:.2f} m{limited}{cut}"


def _leads_to(decision: pb.Decision) -> str:
    """Return where a path leads; empty without one."""
    if not len(decision.global_path):
        return ""
    if decision.predicate.kind in ("looking_elsewhere", "going_back"):
        return "a viewpoint"
    return "admitted space" if decision.action == "recover" else "the goal"


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
