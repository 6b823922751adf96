"""Check of the reasons of decisions, by code that shares nothing with the planner.

A reason names one obstruction, or one plain fact (`harness.stack.reasons`). Of an obstruction the
judge asks whether the cell is what it is said to be, whether the body at the place named is too
near to it, and whether that place is on the way; of a fact, whether it holds.
"""

from __future__ import annotations

import math
import string
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.judge.cells import HEIGHT_SHIFT, NAMES, OUTSIDE, SLIVER, cells_around
from wayproof.harness.log.paths import Array, arc_at, arc_lengths, densely, place_at
from wayproof.harness.replay.audit.committed import Committed
from wayproof.harness.replay.audit.facts import FACTS, Past, point_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reasons import MEANINGS, Kind, logged_reason, sentence
from wayproof.maps import OCCUPIED, UNKNOWN, states_in

FARTHEST = 10.0
"""Greatest distance of a point outside the operating area, m."""

GREATEST = 1e5
"""Greatest length, m, time, s, or angle, rad."""

MADE_OF = {"turn_degrees": "turn_rad", "delay_ms": "delay_s", "deadline_ms": "deadline_s"}
"""Logged figure behind each figure of a sentence that has another unit."""


def false_parts(now: Committed, past: Past) -> list[str]:
    """Return one text for each false part of the reason of the decision after some others."""
    if not now.decision.HasField("predicate"):
        return ["there is no reason with figures"]
    if now.config.recording is not None:
        past.stand(now.decision)
    return list(_contradictions(now, past))


def _contradictions(now: Committed, past: Past) -> Iterator[str]:
    decision, reason = now.decision, now.reason
    if reason.kind not in MEANINGS:
        yield f"there is no reason '{reason.kind[:40]}'"
        return
    kind: Kind = reason.kind
    meaning = MEANINGS[kind]
    missing = [name for name in figures_of(meaning.text) if not reason.HasField(name)]
    if missing:
        yield f"{kind} without {', '.join(missing)}"
        return
    if text := _out_of_bounds(now):
        yield f"{kind}: {text}"
        return
    if decision.reason != sentence(logged_reason(reason)):
        yield "its sentence is not that of its figures"
    if decision.action not in meaning.actions:
        yield f"{kind} is no reason to {decision.action}"
    if decision.label not in meaning.labels:
        yield f"{kind} does not go with label {decision.label}"
    try:
        for text in (*is_named_truly(now, past), *FACTS[kind](now, past)):
            yield f"{kind}: {text}"
    except (ArithmeticError, LookupError, ValueError) as error:
        yield f"{kind}: nothing can be worked out from its figures ({error})"


def _out_of_bounds(now: Committed) -> str:
    """Return a text for the first figure that is out of range; empty without one."""
    low, high = np.array([now.mission.low, now.mission.high])
    for field, value in now.reason.ListFields():
        if isinstance(value, pb.Point):
            point = np.array([value.x, value.y, value.z])
            if not ((low - FARTHEST <= point) & (point <= high + FARTHEST)).all():
                return f"{field.name} is not in the operating area"
        elif isinstance(value, float) and not abs(value) <= GREATEST:
            return f"{field.name} is {value:g}"
    return ""


def figures_of(text: str) -> list[str]:
    """Return the names of the logged figures in a sentence."""
    names = [name for _, name, _, _ in string.Formatter().parse(text) if name]
    return [MADE_OF.get(name, name) for name in names]


NEEDED = ("slowing_for_unknown", "leaving_inflation", "goal_blocked")
"""Kinds that always name a cell; those that brake do, unless a guard brakes at the border."""

ON_THE_WAY = ("following", "slowing_for_unknown", "braking_for_blocked", "braking_for_unknown")
"""Kinds whose cell gives the label."""

UNKNOWNS = ("unknown", "floor not seen")
"""What a body may not overlap only because it was not seen."""

BENT = 0.1
"""Greatest distance of a logged path from the whole one: every fifth point of it is logged, m."""

ROUNDING = 1e-6
"""Tolerance of distances between centres of cells, m."""


def is_named_truly(now: Committed, past: Past) -> Iterator[str]:
    """Yield what is false about the cell that a reason names, its state, and its place."""
    reason = now.reason
    if not reason.HasField("cell"):
        braking = reason.kind.startswith("braking_for_") and reason.kind != "braking_for_goal"
        if reason.kind in NEEDED or (braking and not now.decision.verdict.cut):
            yield "it names no cell"
        return
    if not reason.HasField("place") or not reason.cell_state:
        yield "it names no place, or no state of its cell"
        return
    cell, place = point_of(reason.cell), point_of(reason.place)
    yield from _has_state(now, cell)
    yield from _agrees_with_kind(now)
    indices = np.floor(np.stack([cell, place]) / now.map.resolution + HEIGHT_SHIFT)[:, : now.axes]
    steps = np.abs(indices[0] - indices[1])
    steps[:2] = np.maximum(steps[:2] - (tuple(now.decision.widening) or (0, 0)), 0)
    away = float(np.linalg.norm(steps)) * now.map.resolution
    if away > _reach(now) + ROUNDING:
        yield f"the cell is {away:.2f} m from the place, out of reach of the body"
    yield from _is_there(now, past, place)


def _reach(now: Committed) -> float:
    """Return the distance between the centres of two cells up to which the body overlaps one, m.

    That of the disc or ball about the body: with the stated margin, and half a cell's diagonal.
    """
    diagonal = now.body.half_diagonal * now.map.resolution
    return now.body.radius + now.decision.localization_margin_m + diagonal


def _has_state(now: Committed, cell: Array) -> Iterator[str]:
    """Check that a cell (3,) is what it is said to be."""
    claimed = now.reason.cell_state
    found = _state_of(now, cell)
    if claimed == "class margin":
        if not now.config.costmap.class_margins or found == "outside":
            yield "no class has a margin"
        return
    if now.config.costmap.max_slope > 0.0 and claimed in ("floor not seen", "no floor"):
        return  # where the floor is, is found from the whole map
    if found != claimed:
        yield f"the cell is {found}, not {claimed}"


def _state_of(now: Committed, cell: Array) -> str:
    """Return what a cell (3,) is; of a walking body's column, for what it blocks."""
    config, mission = now.config, now.mission
    about = cells_around(now.map, cell[None], 0.0, config, mission)
    state = int(about.states[tuple(about.of(cell[None])[0])])
    if not mission.planar or state == OUTSIDE:
        return NAMES[state]
    column, layer = _column_of(now, cell)
    itself = NAMES[int(column[layer(cell[2])])]
    if config.costmap.max_slope > 0.0:
        return itself
    band = column[layer(mission.step_height + SLIVER) : layer(mission.height - SLIVER) + 1]
    if state == UNKNOWN:
        return itself if (band == UNKNOWN).any() else "floor not seen"
    if (band == OCCUPIED).any():
        return itself
    return "no floor" if state == OCCUPIED else "free"


def _column_of(now: Committed, cell: Array) -> tuple[NDArray[np.uint8], Callable[[float], int]]:
    """Return the states (nz,) of a cell's column, and the layer of a height, m.

    From below the floor to above the body and the cell.
    """
    size, spare = now.map.resolution, np.array([0.25, 0.25, 0.0]) * now.map.resolution
    first = math.floor(now.mission.low[2] / size + HEIGHT_SHIFT[2]) - 1
    top = math.floor(max(now.mission.height, cell[2]) / size + HEIGHT_SHIFT[2]) + 2
    low, high = cell.copy(), cell.copy()
    low[2] = (first - HEIGHT_SHIFT[2] + 0.25) * size
    high[2] = (top - HEIGHT_SHIFT[2] - 0.25) * size
    column = states_in(now.map, low - spare, high + spare)[0, 0]
    return column, lambda height: math.floor(height / size + HEIGHT_SHIFT[2]) - first


def _agrees_with_kind(now: Committed) -> Iterator[str]:
    """Check that the cell may not be overlapped, and is what its kind and label say of it."""
    kind, state, label = now.reason.kind, now.reason.cell_state, now.decision.label
    unknown = state in UNKNOWNS
    if unknown and now.config.costmap.unknown_policy != "forbid" and kind != "slowing_for_unknown":
        yield f"the body may overlap what is {state}"
    if "unknown" in kind and not unknown:
        yield f"{state} is not unknown"
    if kind == "braking_for_blocked" and unknown:
        yield f"{state} is not blocked"
    ahead = "unknown_ahead" if unknown else "path_blocked"
    if kind in ON_THE_WAY and label != ahead and not now.on_trial:
        yield f"label {label}, of a cell that is {state}"


def _is_there(now: Committed, past: Past, place: Array) -> Iterator[str]:
    """Check that the place is where the body, its way or its goal is, and as far as is said."""
    reason = now.reason
    spare = now.longest_offset + now.body.half_diagonal * now.map.resolution
    if now.decision.verdict.cut:  # of a command that nobody follows
        return
    if reason.kind in ("leaving_inflation", "goal_blocked", "waiting"):
        here = np.array(now.mission.goal) if reason.kind == "goal_blocked" else now.path[0]
        away, most = now.apart(place, here), reason.free_m
        if reason.kind == "waiting":
            most = _end_of_edge(now, _way(now, past), most)
        if away > most + spare + ROUNDING:
            yield f"the place is {away:.2f} m from there"
        return
    way = _way(now, past)
    if len(way) < 2:
        yield "no way was named"
        return
    points = densely(way, 0.01)
    gaps = np.linalg.norm((points - place)[:, : now.axes], axis=1)
    if gaps.min() > BENT + spare:
        yield f"the place is {gaps.min():.2f} m beside the way"
    from_body = np.linalg.norm((points - now.path[0])[:, : now.axes], axis=1)
    arcs = arc_lengths(points)
    begin = 0.0 if reason.kind == "commanded" else float(arcs[from_body.argmin()])
    nearest = arcs[gaps <= max(gaps.min(), BENT + spare)] - begin
    most = _end_of_edge(now, way, begin + reason.free_m) - begin
    if nearest.min() - spare > most or reason.free_m > nearest.max() + spare:
        yield f"free_m is {reason.free_m:.2f}, the place {nearest.min():.2f} m along the way"


def _end_of_edge(now: Committed, way: Array, free_m: float) -> float:
    """Return the length up to which an obstruction may lie on a way that is free up to a length, m.

    A long body turns at the points of its way: the length that is free ends before a whole edge.
    """
    if now.longest_offset == 0.0 or len(way) < 2:
        return free_m
    arcs = arc_lengths(way)
    return float(arcs[min(int(np.searchsorted(arcs, free_m + ROUNDING)), len(arcs) - 1)])


def _way(now: Committed, past: Past) -> Array:
    """Return the way (n, 3) that the obstruction is on, m."""
    if now.reason.kind == "commanded":
        trajectory = now.decision.trajectory
        begin, arcs = arc_at(trajectory, now.effect_ns), arc_lengths(now.path)
        return np.vstack((place_at(trajectory, now.effect_ns), now.path[arcs > begin]))
    return now.way_ahead if len(now.global_path) > 1 else past.way
