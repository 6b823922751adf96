"""Card of a decision as a table of two columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from wayproof.harness.explain import Card
    from wayproof.harness.explain.card import BlockingCell
    from wayproof.harness.schema import wayproof_pb2 as pb

Row = tuple[str, str]
"""Name and text of a row."""


def print_card(console: Console, card: Card) -> None:
    """Print the card of a decision as a table of two columns."""
    one = card.decision
    label = "" if one.label == "none" else f" [{one.label}]"
    table = Table(
        title=f"decision {one.sequence} at {card.time_s:.1f} s: {one.action}{label}",
        title_justify="left",
        show_header=False,
    )
    table.add_column(style="dim")
    table.add_column()
    for name, text in _rows(card):
        table.add_row(name, text)
    console.print(table)


def _rows(card: Card) -> Iterator[Row]:
    one, perturbation = card.decision, card.config.perturbation
    yield "why", one.reason
    if card.stack:
        yield "stack", f"{card.stack}: {card.answer}"
        yield "referee", _verdict(one.verdict)
    yield "map", _map(card)
    yield "evidence on the path", _evidence(card)
    yield "pose", _pose(card)
    yield "inflation", _inflation(card)
    yield "stages", _stages(one.stages)
    yield "delay", _delay(card)
    yield "path", _path(card)
    if card.unmeasured:
        yield "not measured", card.unmeasured
        yield "committed rests on", _rests(one.committed_evidence)
        yield "global path rests on", _rests(one.global_evidence)
    if perturbation is not None:
        yield "perturbed", f"{perturbation.kind} {perturbation.amount:g} {perturbation.unit}"
    for cell in card.blocking:
        yield "blocked by", _blocking(cell)


def _verdict(verdict: pb.Verdict) -> str:
    """Return the referee's verdict in words."""
    limited = "; beyond the body's limits, judged within them" if verdict.limited else ""
    cut = "; the guard braked in its place" if verdict.cut else ""
    return f"{verdict.verdict}, free for {verdict.free_m:.2f} m{limited}{cut}"


def _map(card: Card) -> str:
    one, held = card.decision, "" if card.version_holds else " (the replayed map differs)"
    if card.keyframe is not None:
        held += f", from the log's map after decision {card.keyframe}"
    return (
        f"{one.representation}, {one.resolution_m:g} m cells, unknown: "
        f"{one.unknown_policy}, version {one.map_version[:12]}{held}"
    )


def _evidence(card: Card) -> str:
    return (
        f"oldest {card.oldest_evidence_s:.1f} s, median {card.median_evidence_s:.1f} s; "
        f"occupied with p at most {card.greatest_probability:.2f}; "
        f"{card.mean_entropy_bits:.2f} bits open"
    )


def _pose(card: Card) -> str:
    place = ", ".join(f"{value:.2f}" for value in card.decision.position)
    error = f"{card.pose_error_m:.3f} m"
    error = f"off the recorded pose by {error}" if _recorded(card) else f"truly {error} off"
    return f"({place}) m, sigma {card.decision.position_sigma:.3f} m; {error}"


def _inflation(card: Card) -> str:
    from wayproof.harness.clearance import true_in_metres
    from wayproof.harness.decision import widened_in_words

    one, widened = card.decision, widened_in_words(card.decision)
    margin = f"{one.localization_margin_m:.2f} m margin{widened}"
    text = f"{one.inflation_radius_m:.2f} m, of it {margin}"
    if _recorded(card):
        return text
    return f"{text}; true clearance {true_in_metres(card.true_clearance_m)}"


def _recorded(card: Card) -> bool:
    """Return whether the decision is of a recording, which has no truth."""
    return math.isnan(card.true_clearance_m)


def _stages(stages: pb.StageLatency) -> str:
    names = ("sense", "map", "costmap", "plan", *(["predict"] if stages.predict_ms else []))
    return ", ".join(f"{name} {getattr(stages, f'{name}_ms'):.1f}" for name in names) + " ms"


def _delay(card: Card) -> str:
    one, missed = card.decision, ": MISSED" if card.decision.deadline_missed else ""
    return (
        f"{one.delay_s * 1e3:.0f} ms, {card.config.latency.expected * 1e3:.0f} expected, deadline "
        f"{one.deadline_s * 1e3:.0f}{missed}"
    )


def _path(card: Card) -> str:
    from wayproof.harness.clearance import in_metres, map_clearance_is_bound

    one, bound = (
        card.decision,
        map_clearance_is_bound(card.decision, card.config.costmap.cost_range),
    )
    least = in_metres(one.least_clearance_m, bound)
    text = f"{_way(card)}, {one.committed_length_m:.2f} m committed, least clearance there {least}"
    if card.stack:  # it did its own search
        return text
    if not one.planner:
        return f"{text}; path kept"
    return f"{text}; {one.planner}, {one.planner_iterations} iterations"


def _way(card: Card) -> str:
    """Return where the path leads and how far the goal is, in words."""
    if card.stack:
        return _planned(card)
    straight = f"{card.goal} is {card.goal_distance_m:.2f} m away"
    if not card.path_leads_to:
        return f"none; {straight}"
    to_goal = card.path_leads_to == "the goal"
    end = card.goal if to_goal else card.path_leads_to
    path = f"{card.decision.path_length_m:.2f} m to {end}"
    return path if to_goal else f"{path}; {straight}"


def _planned(card: Card) -> str:
    """Return the length of a stack's planned path, and how much the referee admits of it."""
    if not card.planned_m:
        return f"the stack gave no planned path; {card.goal} is {card.goal_distance_m:.2f} m away"
    return (
        f"{card.planned_m:.2f} m planned by the stack, the referee's map admits "
        f"{card.planned_admitted_m:.2f} m of it"
    )


def _rests(evidence: pb.Evidence) -> str:
    """Describe the evidence that a path rests on."""
    lengths = {one.name: getattr(evidence, one.name) for one in evidence.DESCRIPTOR.fields}
    parts = [f"{m:.2f} m {name.removesuffix('_m')}" for name, m in lengths.items() if m > 0.0]
    return ", ".join(parts) or "no path"


def _blocking(cell: BlockingCell) -> str:
    place = ", ".join(f"{value:.2f}" for value in cell.place)
    age = "never looked at" if cell.age_s is None else f"looked at {cell.age_s:.1f} s ago"
    where = f"{cell.state} ({place}), {cell.distance_m:.2f} m away"
    return f"{where}, p {cell.probability:.2f}, {age}"
