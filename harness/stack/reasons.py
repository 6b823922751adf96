"""Why a decision was made: a closed list of predicates, each with the figures that make it true.

A reason is one of `MEANINGS` with its figures. The sentence that a log shows is made from these
alone, so the two cannot contradict each other. `harness.replay.reasons`
holds each against the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import GRAIN, Action, Label

Point = tuple[float, float, float]

Kind = Literal[
    "path_to_goal",
    "braking_to_goal",
    "path_to_corner",
    "unknown_ahead",
    "blocked_ahead",
    "through_unknown",
    "turning_into_path",
    "stepping_aside",
    "keeping_course",
    "looking_elsewhere",
    "at_viewpoint",
    "backing_up",
    "off_trajectory",
    "returning_to_held",
    "pose_lost",
    "goal_uncertain",
    "escaping_inflation",
    "turning_out_of_inflation",
    "braking_before_unknown",
    "braking_before_blocked",
    "path_too_short",
    "goal_place_moved",
    "coming_to_rest",
    "waiting_before_unknown",
    "waiting_before_blocked",
    "no_path_in_map",
    "no_path_found",
    "goal_blocked",
    "goal_inside_inflation",
    "no_room_to_turn",
    "no_room_along_path",
    "no_way_out",
    "way_out_blocked",
    "at_goal",
    "deadline_missed",
    "commanded",
    "commanded_without_proof",
    "guard_braking",
]


@dataclass(frozen=True)
class Reason:
    """One predicate; a figure that its kind lacks is None.

    Attributes:
        kind: Key of `MEANINGS`.
        free_m: Length of the way ahead that the body may enter, m; a long body's ends with a piece
            of its path, and it overlaps `cell` on the next piece.
        path_m: Length of the rest of the path, m.
        short_m: Straight distance from the path's end to the goal, if it ends elsewhere, m.
        stop_m: Distance that the robot needs to stop, m.
        full_speed_stop_m: Distance that it would need at full speed, m.
        distance_m: Distance named by the sentence of the kind, m.
        limit_m: Limit that the distance is held against, m.
        turn_rad: Angle by which the body turns, rad.
        speed_share: Share of full speed.
        waited_s: Time that it has waited, s.
        delay_s: Delay of the decision, s.
        deadline_s: Deadline of the decision, s.
        since: Number of the decision in which this began.
        places: Number of places that it has looked from.
        iterations: Iterations of the search.
        cell: Centre of the cell that the body would overlap, m.
        cell_state: `occupied`, `unknown` or `outside`; empty without a cell.
        place: Centre of the body, or of one of its discs, that would overlap it, m.
        target: Place that it goes to, m.
        frontier: `none` or `out_of_reach`; empty where none was looked for.
        sigma_m: Stated standard deviation of the position where it decides, m.
    """

    kind: Kind
    free_m: float | None = None
    path_m: float | None = None
    short_m: float | None = None
    stop_m: float | None = None
    full_speed_stop_m: float | None = None
    distance_m: float | None = None
    limit_m: float | None = None
    turn_rad: float | None = None
    speed_share: float | None = None
    waited_s: float | None = None
    delay_s: float | None = None
    deadline_s: float | None = None
    since: int | None = None
    places: int | None = None
    iterations: int | None = None
    cell: Point | None = None
    cell_state: str = ""
    place: Point | None = None
    target: Point | None = None
    frontier: str = ""
    sigma_m: float | None = None

    def __post_init__(self) -> None:
        """Round all figures as they are logged, so that a sentence is that of the logged ones."""
        for name, value in vars(self).items():
            if isinstance(value, float):
                object.__setattr__(self, name, in_grains(value))
            elif isinstance(value, tuple):
                object.__setattr__(self, name, tuple(map(in_grains, value)))


@dataclass(frozen=True)
class Meaning:
    """Sentence of a kind of reason, with the actions and labels that it occurs with.

    Attributes:
        text: The sentence, with the figures that every reason of this kind has.
        actions: Actions that it can explain.
        labels: Labels that it occurs with.
    """

    text: str
    actions: tuple[Action, ...]
    labels: tuple[Label, ...] = ("none",)


WAITING: tuple[Action, ...] = ("stop_and_wait", "abort")
DRIVING: tuple[Action, ...] = ("follow", "slow")

MEANINGS: dict[Kind, Meaning] = {
    "path_to_goal": Meaning("{path_m:.2f} m of path left, all of it admitted", DRIVING),
    "braking_to_goal": Meaning(
        "braking to the end of the path: {path_m:.2f} m left, {stop_m:.2f} m needed to stop",
        DRIVING,
    ),
    "path_to_corner": Meaning(
        "{free_m:.2f} m admitted to a corner to stop at, {path_m:.2f} m of path left", DRIVING
    ),
    "unknown_ahead": Meaning(
        "{free_m:.2f} m admitted, then unknown at {cell}; full speed needs "
        "{full_speed_stop_m:.2f} m to stop",
        DRIVING,
        ("unknown_ahead",),
    ),
    "blocked_ahead": Meaning(
        "{free_m:.2f} m passable, then {cell_state} at {cell}; full speed needs "
        "{full_speed_stop_m:.2f} m to stop",
        DRIVING,
        ("path_blocked",),
    ),
    "through_unknown": Meaning(
        "{free_m:.2f} m known, then unknown at {cell}, entered at {speed_percent:.0f} % of full "
        "speed",
        ("slow",),
        ("unknown_ahead",),
    ),
    "turning_into_path": Meaning("turning {turn_degrees:.0f} degrees into the path", ("follow",)),
    "stepping_aside": Meaning(
        "stepping {distance_m:.2f} m along the path at its own heading: no room at the path's",
        ("follow",),
    ),
    "keeping_course": Meaning(
        "no room to take the new path in motion: following the last trajectory", ("follow",)
    ),
    "looking_elsewhere": Meaning(
        "{path_m:.2f} m to {target}, to look from there; looked from {places} places so far",
        ("explore",),
        ("none", "unknown_ahead", "path_blocked"),
    ),
    "at_viewpoint": Meaning(
        "coming to rest in {path_m:.2f} m, to look from there", ("stop_and_wait",)
    ),
    "backing_up": Meaning(
        "going back {path_m:.2f} m on its trail, to {target}",
        ("recover",),
        ("none", "unknown_ahead", "path_blocked"),
    ),
    "off_trajectory": Meaning(
        "{distance_m:.2f} m off the trajectory, {limit_m:.2f} m allowed: holding here",
        ("recover",),
        ("localization_lost",),
    ),
    "returning_to_held": Meaning(
        "going back {path_m:.2f} m to where the sweeps held the pose, {target}: its standard "
        "deviation is {sigma_m:.2f} m, {limit_m:.2f} m allowed",
        ("recover",),
        ("localization_lost",),
    ),
    "pose_lost": Meaning(
        "the pose is lost: its standard deviation is {sigma_m:.2f} m, {limit_m:.2f} m allowed",
        WAITING,
        ("localization_lost",),
    ),
    "goal_uncertain": Meaning(
        "{distance_m:.2f} m from the goal by a pose of a standard deviation of {sigma_m:.2f} m, "
        "too uncertain to claim it within {limit_m:.2f} m",
        ("abort",),
        ("localization_lost",),
    ),
    "escaping_inflation": Meaning(
        "inside the inflation of what is {cell_state} at {cell}; {distance_m:.2f} m to "
        "admitted space",
        ("recover",),
        ("start_blocked",),
    ),
    "turning_out_of_inflation": Meaning(
        "inside the inflation of what is {cell_state} at {cell}; free when turned by "
        "{turn_degrees:.0f} degrees",
        ("recover",),
        ("start_blocked",),
    ),
    "braking_before_unknown": Meaning(
        "{free_m:.2f} m admitted, then unknown at {cell}; {stop_m:.2f} m needed to stop",
        ("stop_and_wait",),
        ("unknown_ahead",),
    ),
    "braking_before_blocked": Meaning(
        "{free_m:.2f} m passable, then {cell_state} at {cell}; {stop_m:.2f} m needed to stop",
        ("stop_and_wait",),
        ("path_blocked",),
    ),
    "path_too_short": Meaning(
        "{path_m:.2f} m of path left, {stop_m:.2f} m needed to stop", ("stop_and_wait",)
    ),
    "goal_place_moved": Meaning(
        "the path ends {distance_m:.2f} m from the goal's place, {target}; {stop_m:.2f} m "
        "needed to stop",
        ("stop_and_wait",),
    ),
    "coming_to_rest": Meaning(
        "coming to rest in {path_m:.2f} m; without a path since decision {since}",
        ("stop_and_wait",),
        (
            "none",
            "no_path",
            "start_blocked",
            "goal_blocked",
            "unknown_ahead",
            "path_blocked",
            "localization_lost",
        ),
    ),
    "waiting_before_unknown": Meaning(
        "{free_m:.2f} m admitted, then unknown at {cell}; less than {limit_m:.2f} m",
        WAITING,
        ("unknown_ahead",),
    ),
    "waiting_before_blocked": Meaning(
        "{free_m:.2f} m passable, then {cell_state} at {cell}; less than {limit_m:.2f} m",
        WAITING,
        ("path_blocked",),
    ),
    "no_path_in_map": Meaning("no path to the goal in the map", WAITING, ("no_path",)),
    "no_path_found": Meaning(
        "no path to the goal found in {iterations} iterations",
        WAITING,
        ("no_path", "start_blocked", "goal_blocked"),
    ),
    "goal_blocked": Meaning(
        "the goal is inside the inflation of what is {cell_state} at {cell}, and so is all within "
        "{limit_m:.2f} m",
        WAITING,
        ("goal_blocked",),
    ),
    "goal_inside_inflation": Meaning(
        "the goal is inside the inflation of what is {cell_state} at {cell}, the nearest place "
        "outside of it {distance_m:.2f} m away",
        WAITING,
        ("goal_blocked",),
    ),
    "no_room_to_turn": Meaning(
        "no room to turn {turn_degrees:.0f} degrees into the path: {cell_state} at {cell}",
        WAITING,
        ("no_path",),
    ),
    "no_room_along_path": Meaning(
        "no room along the path: {cell_state} at {cell} after {free_m:.2f} m", WAITING, ("no_path",)
    ),
    "no_way_out": Meaning(
        "inside the inflation of what is {cell_state} at {cell}, and no admitted space within "
        "{limit_m:.2f} m",
        WAITING,
        ("start_blocked",),
    ),
    "way_out_blocked": Meaning(
        "inside the inflation of what is {cell_state} at {cell}; the way out, {distance_m:.2f} m, "
        "leads nearer to what blocks",
        WAITING,
        ("start_blocked",),
    ),
    "at_goal": Meaning("at rest {distance_m:.2f} m from the goal", ("goal",)),
    "commanded": Meaning(
        "commanded by the stack on trial; the referee admits all of its {free_m:.2f} m",
        get_args(Action),
        get_args(Label),
    ),
    "commanded_without_proof": Meaning(
        "commanded by the stack on trial; the referee admits {free_m:.2f} m of it",
        get_args(Action),
        get_args(Label),
    ),
    "guard_braking": Meaning(
        "braked by the guard; the referee admits {free_m:.2f} m of the command",
        ("stop_and_wait",),
        ("unknown_ahead", "path_blocked"),
    ),
    "deadline_missed": Meaning(
        "{delay_ms:.0f} ms, {deadline_ms:.0f} allowed: the last trajectory stands",
        ("follow", "stop_and_wait"),
        ("deadline_missed",),
    ),
}
"""Sentence, actions and labels by kind of reason."""

STUCK_INSIDE = (
    "escaping_inflation",
    "turning_out_of_inflation",
    "no_way_out",
    "way_out_blocked",
)
"""Kinds of reason of a body that stands inside the inflation."""

FIGURES = tuple(one.name for one in fields(Reason) if one.name != "kind")
POINTS = ("cell", "place", "target")
TEXTS = ("cell_state", "frontier")
COUNTS = ("since", "places", "iterations")


def sentence(reason: Reason) -> str:
    """Return the sentence of a reason, with its figures."""
    values: dict[str, Any] = {name: getattr(reason, name) for name in FIGURES}
    for name in POINTS:
        if values[name] is not None:
            values[name] = "(" + ", ".join(f"{value:.2f}" for value in values[name]) + ")"
    values["turn_degrees"] = math.degrees(reason.turn_rad or 0.0)
    values["speed_percent"] = 100.0 * (reason.speed_share or 0.0)
    values["delay_ms"] = 1e3 * (reason.delay_s or 0.0)
    values["deadline_ms"] = 1e3 * (reason.deadline_s or 0.0)
    text = MEANINGS[reason.kind].text
    parts = [text.format(**values), *_additions(reason, text)]
    return "; ".join(parts)


def _additions(reason: Reason, text: str) -> list[str]:
    """Return clauses on the figures that only some reasons of a kind have."""
    found = []
    if reason.cell is not None and "{cell}" not in text:
        x, y, z = reason.cell
        found.append(f"then {reason.cell_state} at ({x:.2f}, {y:.2f}, {z:.2f})")
    if reason.short_m is not None:
        found.append(f"it ends {reason.short_m:.2f} m from the goal")
    if reason.stop_m is not None and "{stop_m" not in text:
        found.append(f"{reason.stop_m:.2f} m needed to stop")
    if reason.sigma_m is not None and "{sigma_m" not in text:
        found.append(f"slowed, as the sweeps do not hold the pose to {reason.sigma_m:.2f} m")
    if reason.waited_s is not None:
        found.append(f"waited {reason.waited_s:.1f} s")
    if reason.frontier:
        found.append("no frontier is left" if reason.frontier == "none" else "no way to a frontier")
    if reason.places is not None and "{places}" not in text:
        found.append(f"gave up after looking from {reason.places} places")
    return found


def reason_message(reason: Reason) -> pb.Reason:
    """Return a reason as it is logged; figures in whole grains."""
    message = pb.Reason(kind=reason.kind)
    for name in FIGURES:
        value = getattr(reason, name)
        if value is None or value == "":
            continue
        if name in POINTS:
            x, y, z = value
            getattr(message, name).CopyFrom(pb.Point(x=x, y=y, z=z))
        else:
            setattr(message, name, value)
    return message


def logged_reason(message: pb.Reason) -> Reason:
    """Return a logged reason; its kind may be one that this version does not know."""
    values: dict[str, Any] = {}
    for name in FIGURES:
        if name in TEXTS:
            values[name] = getattr(message, name)
        elif message.HasField(name):
            value = getattr(message, name)
            values[name] = (value.x, value.y, value.z) if name in POINTS else value
    return Reason(message.kind, **values)  # type: ignore[arg-type]


def in_grains(value: float) -> float:
    """Return a figure as it is logged: a whole multiple of 2^-20."""
    return round(value / GRAIN) * GRAIN + 0.0
