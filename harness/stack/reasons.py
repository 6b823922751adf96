"""Why a decision was made: one of a few kinds, with the obstruction or the plain fact behind it.

The sentence that a log shows is made from these alone, so the two cannot contradict each other.
`harness.replay.audit.reasons` holds each against the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple, get_args

from wayproof.harness.decision import GRAIN, Action, Label
from wayproof.harness.schema import wayproof_pb2 as pb

Point = tuple[float, float, float]

Kind = Literal[
    "following",
    "slowing_for_unknown",
    "turning",
    "braking_for_blocked",
    "braking_for_unknown",
    "braking_for_goal",
    "waiting",
    "looking_elsewhere",
    "leaving_inflation",
    "going_back",
    "no_path",
    "goal_blocked",
    "localization_lost",
    "old_evidence",
    "late",
    "arrived",
    "commanded",
]
"""Kinds of reason: those of the built-in stack while it drives, `arrived`, its end, and
`commanded`, the referee's of a stack on trial."""


@dataclass(frozen=True)
class Reason:
    """One reason; a figure that its kind lacks is None.

    Attributes:
        kind: One of `Kind`.
        free_m: Length of the way up to the obstruction, or else of what is committed, m; a long
            body's ends with a piece of its path, and it overlaps `cell` on the next piece.
        path_m: Length of the committed path, m.
        distance_m: Distance that the kind is about, m.
        limit_m: Limit of that distance, or of `sigma_m`, m.
        turn_rad: Heading that the body turns to, or angle by which it turns out of the inflation,
            rad.
        waited_s: Time that it has waited at rest, s.
        delay_s: Delay of the decision, or age of the evidence, s.
        deadline_s: Its limit, s.
        since: Number of the decision in which this began.
        places: Number of places that it has looked from.
        iterations: Iterations of the search.
        cell: Centre of the cell that obstructs, m.
        cell_state: What that is: one of `maps.costmap.blockers.STATES`, or `outside`; empty without
            a cell.
        place: Centre of the cell of the body's centre, or of one of its discs', that is too near to
            it, m.
        target: Place that it goes to, m.
        frontier: `none` or `out_of_reach`; empty where none was looked for.
        sigma_m: Stated standard deviation of the position where it decides, m.
        range_sigma_m: Standard deviation of the ranges of the sweeps, if that costs speed, m.
    """

    kind: Kind
    free_m: float | None = None
    path_m: float | None = None
    distance_m: float | None = None
    limit_m: float | None = None
    turn_rad: float | None = None
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


class Meaning(NamedTuple):
    """Sentence of a kind of reason, with the actions and labels that it occurs with.

    Attributes:
        text: The sentence, with the figures that every reason of this kind has.
        actions: Actions that it can explain.
        labels: Labels that it occurs with.
    """

    text: str
    actions: tuple[Action, ...]
    labels: tuple[Label, ...] = ("none",)


DRIVES: tuple[Action, ...] = ("follow", "slow")
RESTS: tuple[Action, ...] = ("stop_and_wait", "abort")
AHEAD: tuple[Label, ...] = ("unknown_ahead", "path_blocked")

MEANINGS: dict[Kind, Meaning] = {
    "following": Meaning("{free_m:.2f} m admitted", DRIVES, ("none", *AHEAD)),
    "slowing_for_unknown": Meaning("slowing: {free_m:.2f} m known", DRIVES, ("unknown_ahead",)),
    "turning": Meaning("turning to a heading of {turn_degrees:.0f} degrees", ("follow",)),
    "braking_for_blocked": Meaning(
        "braking: {free_m:.2f} m admitted", ("slow", "stop_and_wait"), AHEAD
    ),
    "braking_for_unknown": Meaning("braking: {free_m:.2f} m admitted", ("stop_and_wait",), AHEAD),
    "braking_for_goal": Meaning(
        "braking to the end of the path, {path_m:.2f} m", (*DRIVES, "stop_and_wait")
    ),
    "waiting": Meaning("waiting", RESTS, get_args(Label)),
    "looking_elsewhere": Meaning(
        "on the way to {target}, to look from there; looked from {places} places so far",
        ("explore",),
        ("none", *AHEAD),
    ),
    "leaving_inflation": Meaning(
        "inside the inflation", ("recover", "stop_and_wait", "abort"), ("start_blocked",)
    ),
    "going_back": Meaning(
        "going back to {target}", ("recover",), ("none", *AHEAD, "localization_lost")
    ),
    "no_path": Meaning(
        "no path to the goal found in {iterations} iterations",
        RESTS,
        ("no_path", "start_blocked", "goal_blocked"),
    ),
    "goal_blocked": Meaning("the goal is inside the inflation", RESTS, ("goal_blocked",)),
    "localization_lost": Meaning("localization lost", ("recover", *RESTS), ("localization_lost",)),
    "old_evidence": Meaning(
        "what lies on the way was last seen {delay_ms:.0f} ms ago, {deadline_ms:.0f} allowed",
        ("stop_and_wait",),
        ("map_stale",),
    ),
    "late": Meaning(
        "{delay_ms:.0f} ms, {deadline_ms:.0f} allowed: the last trajectory stands",
        ("follow", "stop_and_wait"),
        ("deadline_missed",),
    ),
    "arrived": Meaning("at rest {distance_m:.2f} m from the goal", ("goal",)),
    "commanded": Meaning(
        "commanded by the stack on trial; the referee admits {free_m:.2f} m of it",
        get_args(Action),
        get_args(Label),
    ),
}
"""Sentence, actions and labels by kind of reason."""

FIGURES = tuple(one.name for one in fields(Reason) if one.name != "kind")
POINTS = ("cell", "place", "target")
TEXTS = ("cell_state", "frontier")
COUNTS = ("since", "places", "iterations")


def sentence(reason: Reason) -> str:
    """Return the sentence of a reason, with its figures and nothing else."""
    values: dict[str, Any] = {name: getattr(reason, name) for name in FIGURES}
    for name in POINTS:
        if values[name] is not None:
            values[name] = "(" + ", ".join(f"{value:.2f}" for value in values[name]) + ")"
    values["turn_degrees"] = math.degrees(reason.turn_rad or 0.0)
    values["delay_ms"] = 1e3 * (reason.delay_s or 0.0)
    values["deadline_ms"] = 1e3 * (reason.deadline_s or 0.0)
    text = MEANINGS[reason.kind].text.format(**values)
    if reason.cell is not None:
        joint = ", then" if reason.free_m is not None else ":"
        text = f"{text}{joint} {reason.cell_state} at {values['cell']}"
    return "; ".join([text, *_additions(reason)])


def _additions(reason: Reason) -> list[str]:
    """Return clauses on the figures that only some reasons of a kind have."""
    found = []
    if reason.kind == "leaving_inflation":
        found.append(_way_out(reason))
    if reason.kind == "localization_lost" and reason.distance_m is not None:
        found.append(
            f"{reason.distance_m:.2f} m off the trajectory, {reason.limit_m:.2f} m allowed"
        )
    elif reason.sigma_m is not None and reason.limit_m is not None:
        deviation = f"a standard deviation of {reason.sigma_m:.2f} m"
        found.append(f"the pose has {deviation}, {reason.limit_m:.2f} m allowed")
    elif reason.sigma_m is not None:
        found.append(f"slowed, as the sweeps do not hold the pose to {reason.sigma_m:.2f} m")
    if reason.range_sigma_m is not None:
        found.append(f"slowed, as ranges deviate by {reason.range_sigma_m:.2f} m")
    if reason.kind == "waiting" and reason.since is not None:
        found.append(f"coming to rest, without a path since decision {reason.since}")
    if reason.waited_s is not None:
        found.append(f"waited {reason.waited_s:.1f} s")
    if reason.frontier:
        found.append("no frontier is left" if reason.frontier == "none" else "no way to a frontier")
    if reason.places is not None and reason.kind != "looking_elsewhere":
        found.append(f"gave up after looking from {reason.places} places")
    return found


def _way_out(reason: Reason) -> str:
    if reason.distance_m is not None:
        return f"{reason.distance_m:.2f} m to admitted space"
    if reason.turn_rad is not None:
        return f"free when turned by {math.degrees(reason.turn_rad):.0f} degrees"
    return "no way out of it"


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
