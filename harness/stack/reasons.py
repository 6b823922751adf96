"""Why a decision was made: a closed list of predicates, each with the figures that make it true.

The sentence that a log shows is made from these alone (`reason_sentences`), so the two cannot
contradict each other. `harness.replay.reasons` holds each against the map.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

from wayproof.harness.decision import GRAIN
from wayproof.harness.schema import wayproof_pb2 as pb

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
    "stepping_to_pose",
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
        kind: One of `Kind`.
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
        range_sigma_m: Standard deviation of the ranges of the sweeps, if that costs speed, m.
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
    range_sigma_m: float | None = None

    def __post_init__(self) -> None:
        """Round all figures as they are logged, so that a sentence is that of the logged ones."""
        for name, value in vars(self).items():
            if isinstance(value, float):
                object.__setattr__(self, name, in_grains(value))
            elif isinstance(value, tuple):
                object.__setattr__(self, name, tuple(map(in_grains, value)))


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
