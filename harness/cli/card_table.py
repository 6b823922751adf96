"""Card of a decision as a table of two columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from wayproof.harness.explain import Card
    from wayproof.harness.explain.blocking_cells import BlockingCell

Row = tuple[str, str]
"""Name and text of a row."""


def print_card(console: Console, card: Card) -> None:
    """Print the card of a decision as a table of two columns."""
    label = "" if card.label == "none" else f" [{card.label}]"
    table = Table(
        title=f"decision {card.sequence} at {card.time_s:.1f} s: {card.action}{label}",
        title_justify="left",
        show_header=False,
    )
    table.add_column(style="dim")
    table.add_column()
    for name, text in _rows(card):
        table.add_row(name, text)
    console.print(table)


def _rows(card: Card) -> Iterator[Row]:
    yield "why", card.reason
    if card.stack:
        yield "stack", f"{card.stack}: {card.answer}"
        yield "referee", card.verdict
    yield "map", _map(card)
    yield "evidence on the path", _evidence(card)
    yield "pose", _pose(card)
    yield "inflation", _inflation(card)
    yield "stages", ", ".join(f"{name} {ms:.1f}" for name, ms in card.stages_ms.items()) + " ms"
    yield "delay", _delay(card)
    yield "path", _path(card)
    if card.floor:
        yield "floor", card.floor
    if card.unmeasured:
        yield "not measured", card.unmeasured
        yield "committed rests on", _rests(card.committed_evidence)
        yield "global path rests on", _rests(card.global_evidence)
    if card.perturbation:
        yield "perturbed", card.perturbation
    for cell in card.blocking:
        yield "blocked by", _blocking(cell)


def _map(card: Card) -> str:
    held = "" if card.version_holds else " (the replayed map differs)"
    if card.keyframe is not None:
        held += f", from the log's map after decision {card.keyframe}"
    return (
        f"{card.representation}, {card.resolution_m:g} m cells, unknown: "
        f"{card.unknown_policy}, version {card.version[:12]}{held}"
    )


def _evidence(card: Card) -> str:
    return (
        f"oldest {card.oldest_evidence_s:.1f} s, median {card.median_evidence_s:.1f} s; "
        f"occupied with p at most {card.greatest_probability:.2f}; "
        f"{card.mean_entropy_bits:.2f} bits open"
    )


def _pose(card: Card) -> str:
    place = ", ".join(f"{value:.2f}" for value in card.position)
    error = f"{card.pose_error_m:.3f} m"
    error = f"off the recorded pose by {error}" if _recorded(card) else f"truly {error} off"
    return f"({place}) m, sigma {card.position_sigma_m:.3f} m; {error}"


def _inflation(card: Card) -> str:
    from wayproof.harness.clearance import true_in_metres

    text = f"{card.inflation_radius_m:.2f} m, of it {card.margin_m:.2f} m margin{card.widened}"
    if _recorded(card):
        return text
    return f"{text}; true clearance {true_in_metres(card.true_clearance_m)}"


def _recorded(card: Card) -> bool:
    """Return whether the decision is of a recording, which has no truth."""
    return math.isnan(card.true_clearance_m)


def _delay(card: Card) -> str:
    missed = ": MISSED" if card.deadline_missed else ""
    return (
        f"{card.delay_s * 1e3:.0f} ms, {card.expected_delay_s * 1e3:.0f} expected, deadline "
        f"{card.deadline_s * 1e3:.0f}{missed}"
    )


def _path(card: Card) -> str:
    from wayproof.harness.clearance import in_metres

    least = in_metres(card.least_clearance_m, card.least_clearance_is_bound)
    text = f"{_way(card)}, {card.committed_m:.2f} m committed, least clearance there {least}"
    if card.stack:  # it did its own search
        return text
    if not card.planner:
        return f"{text}; path kept"
    return f"{text}; {card.planner}, {card.iterations} iterations"


def _way(card: Card) -> str:
    """Return where the path leads and how far the goal is, in words."""
    if card.stack:
        return _planned(card)
    straight = f"{card.goal} is {card.goal_distance_m:.2f} m away"
    if not card.path_leads_to:
        return f"none; {straight}"
    to_goal = card.path_leads_to == "the goal"
    path = f"{card.path_length_m:.2f} m to {card.goal if to_goal else card.path_leads_to}"
    return path if to_goal else f"{path}; {straight}"


def _planned(card: Card) -> str:
    """Return the length of a stack's planned path, and how much the referee admits of it."""
    if not card.planned_m:
        return f"the stack gave no planned path; {card.goal} is {card.goal_distance_m:.2f} m away"
    return (
        f"{card.planned_m:.2f} m planned by the stack, the referee's map admits "
        f"{card.planned_admitted_m:.2f} m of it"
    )


def _rests(lengths: Mapping[str, float]) -> str:
    """Describe the evidence that a path rests on."""
    parts = [f"{metres:.2f} m {name}" for name, metres in lengths.items() if metres > 0.0]
    return ", ".join(parts) or "no path"


def _blocking(cell: BlockingCell) -> str:
    place = ", ".join(f"{value:.2f}" for value in cell.place)
    age = "never looked at" if cell.age_s is None else f"looked at {cell.age_s:.1f} s ago"
    where = f"{cell.state} ({place}), {cell.distance_m:.2f} m away"
    return f"{where}, p {cell.probability:.2f}, {age}"
