"""Commands of a stack on trial that led to a contact against the referee's verdict.

Each trajectory is judged to its rest, so an admitted command ends in space that the map held free,
whatever came before it. What led to a contact are therefore the commands after the last admitted
one, up to that which the body followed at the contact: at the first of them a guard would have
braked. A command that keeps its place is admitted wherever that is, so one within the inflation
ends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.decision import path_of
from wayproof.harness.interface.command_messages import CommandError, planned_path_of
from wayproof.harness.log.paths import arc_at, arc_lengths, densely
from wayproof.harness.mission import Mission
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps import Costmap
from wayproof.maps.states import OCCUPIED

Array = NDArray[np.float64]

ADMITTED = "admitted"

OWN_REACH = 0.3
"""Greatest distance of an occupied cell from the obstacle that it represents, pose error apart, m:
ranges, attitude and calibration all contribute."""


@dataclass(frozen=True)
class CommandedFacts:
    """The commands that led to a contact and that the referee had not admitted.

    Attributes:
        first: Number of the first of them, at which a guard would have braked.
        count: Number of them.
        verdict: Verdict of the last of them after which the body could have stopped, or of the
            first.
        free_m: Length of the way of that one that the referee admitted, m.
        in_the_way: Number of cells that the map held occupied on its way, within body and margin,
            and that represent the touched obstacle.
        blocked: Number of the commands whose verdict is `blocked`.
    """

    first: int
    count: int
    verdict: str
    free_m: float
    in_the_way: int
    blocked: int


def on_trial(case: Case) -> bool:
    """Return whether a stack on trial commanded, whom the referee judged."""
    return any(moment.answer is not None for moment in case.moments)


def commands_to(case: Case, time_s: float) -> tuple[int, ...]:
    """Return the numbers of the commands not admitted that led to where the body is at a time.

    In order; none if the command that it follows then was admitted for the space that it sweeps, or
    the guard had braked.
    """
    numbers: list[int] = []
    for number in range(len(case.moments) - 1, -1, -1):
        moment = case.moments[number]
        decision = moment.decision
        if moment.effect_ns > time_s * 1e9 or decision.deadline_missed:
            continue  # the body does not follow it
        if against(decision):
            numbers.append(number)
        elif not _keeps_place_within_inflation(moment, long_body=bool(case.mission.discs)):
            break
    return tuple(reversed(numbers))


def _keeps_place_within_inflation(moment: Moment, *, long_body: bool) -> bool:
    """Return whether an admitted command sweeps nothing, at a place that the map has no room at."""
    decision = moment.decision
    trajectory, verdict = decision.trajectory, decision.verdict
    if verdict.verdict != ADMITTED or verdict.cut or not trajectory.arc_length:
        return False
    moves = trajectory.arc_length[-1] > arc_at(trajectory, moment.effect_ns)
    turns = long_body and np.ptp(trajectory.heading) > 0.0
    return not moves and not turns and decision.least_clearance_m < decision.inflation_radius_m


def answer_s(moment: Moment) -> float:
    """Return the time that a stack on trial took to answer, s; 0 where it does not count.

    Its share of the logged delay, which is an input, and not the measured stage, which no
    simulation repeats.
    """
    if moment.answer is None or moment.latency.mode != "measured":
        return 0.0
    return moment.latency.delay_s - moment.added_delay_s


def against(decision: pb.Decision) -> bool:
    """Return whether a command was followed that the referee did not admit."""
    verdict = decision.verdict
    return bool(verdict.verdict) and verdict.verdict != ADMITTED and not verdict.cut


def commanded_facts(
    case: Case, numbers: tuple[int, ...], navigator: Navigator, decision: int, name: str
) -> CommandedFacts | None:
    """Return the facts of the commands that led to a contact; None without any.

    Args:
        case: The episode.
        numbers: As `commands_to` returns them.
        navigator: Navigator with map and costmap of the decision.
        decision: The last of them after which the body could have stopped.
        name: Name of the touched obstacle.
    """
    if not numbers:
        return None
    moment = case.moments[decision]
    verdicts = [case.moments[number].decision.verdict.verdict for number in numbers]
    return CommandedFacts(
        first=numbers[0],
        count=len(numbers),
        verdict=moment.decision.verdict.verdict,
        free_m=moment.decision.verdict.free_m,
        in_the_way=_cells_in_the_way(case, navigator, moment, name),
        blocked=verdicts.count("blocked"),
    )


def _cells_in_the_way(case: Case, navigator: Navigator, moment: Moment, name: str) -> int:
    """Return how many occupied cells on the way of a command represent an obstacle.

    Args:
        case: The episode.
        navigator: Navigator with map and costmap of that decision.
        moment: The decision.
        name: Name of the obstacle.
    """
    case.space.place_movers(moment.truth)
    cells = _occupied_about(case, navigator, moment) - moment.error
    near = [cell for cell in cells if case.space.distance_to(cell, name) <= OWN_REACH]
    return sum(case.space.distance(cell)[1] == name for cell in near)


def _occupied_about(case: Case, navigator: Navigator, moment: Moment) -> Array:
    """Return the centres (n, 3) of occupied cells within body and margin of a command's path.

    A body that lags behind the start of the path has to get there first.
    """
    costmap, axes = navigator.costmap, case.axes
    path = np.vstack([moment.pose.position, path_of(moment.decision.trajectory.path)])
    if axes == 2:
        path[0, 2] = path[1, 2]
    path = densely(path, costmap.resolution)
    reach = costmap.inflation_radius + costmap.resolution
    held = np.argwhere(costmap.state == OCCUPIED)
    centres: Array = costmap.origin + (held + 0.5) * costmap.resolution
    low, high = path.min(axis=0) - reach, path.max(axis=0) + reach
    centres = centres[((centres >= low) & (centres <= high))[:, :axes].all(axis=1)]
    gaps = np.linalg.norm(centres[:, None, :axes] - path[None, :, :axes], axis=2)
    near: Array = centres[(gaps <= reach).any(axis=1)]
    return near if axes == 3 else _solid_cells(case, navigator, near)


def _solid_cells(case: Case, navigator: Navigator, columns: Array) -> Array:
    """Return the occupied cells (n, 3) of columns at the heights of a body on the ground."""
    size = navigator.map.resolution
    heights = np.arange(case.mission.step_height + 0.5 * size, case.mission.height + size, size)
    cells = np.repeat(columns, len(heights), axis=0)
    cells[:, 2] = np.tile(heights, len(columns))
    solid: Array = cells[navigator.map.state_at(cells) == OCCUPIED]
    return solid


def admitted_length(
    decision: pb.Decision, mission: Mission, costmap: Costmap, path: Array
) -> float:
    """Return the length of a path (n, 3) up to the first cell that the body may not enter, m.

    The body is that of the decision: its circumscribed disc or ball, or its discs headed along the
    path.
    """
    points = densely(path, 0.5 * costmap.resolution)
    ahead = np.gradient(points, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    body = decision.inflation_radius_m - decision.localization_margin_m
    offsets = [along for along, _ in mission.discs] if body < mission.radius - 1e-6 else [0.0]
    closed: NDArray[np.bool_] = np.zeros(len(points), np.bool_)
    for along in offsets:
        closed |= _is_closed(costmap, points + along * ahead, decision.collision_distance_sq)
    return float(arc_lengths(points)[closed.argmax() if closed.any() else -1])


def _is_closed(costmap: Costmap, points: Array, limit: int) -> NDArray[np.bool_]:
    """Return whether each point (n, 3) is too near to forbidden cells, or off the map."""
    cells = np.floor((points - costmap.origin) / costmap.resolution).astype(int)
    if costmap.shape[2] == 1:  # on the ground, whatever height the stack plans at
        cells[:, 2] = 0
    inside = ((cells >= 0) & (cells < costmap.shape)).all(axis=1)
    closed: NDArray[np.bool_] = np.logical_not(inside)
    closed[inside] = costmap.field()[tuple(cells[inside].T)] <= limit
    return closed


def own_plan(moment: Moment) -> Array | None:
    """Return the path (n, 3) that a stack on trial says it plans, m; None without one."""
    if moment.answer is None:
        return None
    try:
        return planned_path_of(sb.Command.FromString(moment.answer.command))
    except (DecodeError, CommandError):
        return None
