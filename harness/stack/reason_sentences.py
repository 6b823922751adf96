"""Sentences of reasons: by their kind, with their figures and with nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, get_args

from wayproof.harness.decision import Action, Label
from wayproof.harness.stack.reasons import FIGURES, POINTS, Kind, Reason


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
        DRIVING,
        ("unknown_ahead",),
    ),
    "turning_into_path": Meaning("turning {turn_degrees:.0f} degrees into the path", ("follow",)),
    "stepping_aside": Meaning(
        "stepping {distance_m:.2f} m along the path at its own heading: no room at the path's",
        ("follow",),
    ),
    "stepping_to_pose": Meaning(
        "stepping {distance_m:.2f} m to the next pose of its way, turning "
        "{turn_degrees:.0f} degrees: no room along its path",
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
    if reason.range_sigma_m is not None:
        found.append(f"slowed, as ranges deviate by {reason.range_sigma_m:.2f} m")
    if reason.waited_s is not None:
        found.append(f"waited {reason.waited_s:.1f} s")
    if reason.frontier:
        found.append("no frontier is left" if reason.frontier == "none" else "no way to a frontier")
    if reason.places is not None and "{places}" not in text:
        found.append(f"gave up after looking from {reason.places} places")
    return found
