"""Reductions of a scenario, in order: what is tried to be taken away, and how.

A reduction asks for scenarios, batch by batch, is sent which of them fail alike, and returns the
smallest one. A new one is a function and a line of `REDUCTIONS`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import override, setting_names, value_of
from wayproof.harness.regress.scene import Case
from wayproof.models.world_files.ground import FLOOR_KIND
from wayproof.models.worlds.movers import Mover

Steps = Generator[Sequence[Case], Sequence[bool], Case]
"""Generator that asks for scenarios, is sent which fail alike, and returns the smallest."""

Keep = Callable[[Case, Sequence[int]], Case]
"""Function that returns a scenario with some of its things alone, by their numbers."""

SHARES = (0.125, 0.25, 0.5, 0.75)
"""Parts of a length or a severity that are tried, the smallest first."""

LEAST_WINDOW = 0.01
"""Shortest time that a window or a mover lasts, s."""

APART = frozenset(
    {"world", "robot", "seed", "goal", "start", "waypoints", "record", "perturbation", "stack"}
)
"""Settings that make the episode what it is, or that have a reduction of their own."""


def fewest(case: Case, count: int, keep: Keep) -> Steps:
    """Take away as many things as possible: delta debugging by complements.

    Zeller and Hildebrandt, Simplifying and Isolating Failure-Inducing Input, 2002: first all, then
    halves, quarters and so on, down to each alone. All pieces of one size are tried in one batch.
    """
    kept = list(range(count))
    size = len(kept)
    while size and kept:
        pieces = [kept[n : n + size] for n in range(0, len(kept), size)]
        fails = yield [keep(case, _without(kept, piece)) for piece in pieces]
        gone = [piece for piece, failed in zip(pieces, fails, strict=True) if failed]
        together = _without(kept, [one for piece in gone for one in piece])
        if len(gone) > 1 and not (yield [keep(case, together)])[0]:
            kept = _without(kept, gone[0])  # two stand in for one another: the rest once more
            continue
        kept, size = together, size // 2
    return keep(case, kept)


def _without(numbers: Sequence[int], gone: Sequence[int]) -> list[int]:
    return [one for one in numbers if one not in gone]


def first(case: Case, smaller: Sequence[Case]) -> Steps:
    """Take the first of some scenarios, the smallest first, that fails alike, or the given one."""
    if not smaller:
        return case
    fails = yield smaller
    return next((one for one, failed in zip(smaller, fails, strict=True) if failed), case)


def nearer_start(case: Case) -> Steps:
    """Start on the driven way, nearer to where it went wrong, with all that moves where it was."""
    last = len(case.way) - 1
    chosen = [round(last * (1.0 - share)) for share in SHARES if last > 0]
    return (yield from first(case, [_starting_at(case, number) for number in chosen]))


def _starting_at(case: Case, number: int) -> Case:
    place = case.way[number]
    ends = case.ends._replace(
        start=(place.x, place.y, case.ends.start[2]), start_heading=place.heading
    )
    movers = [_later(mover, place.time) for mover in case.found.movers]
    way = tuple(replace(one, time=one.time - place.time) for one in case.way[number:])
    perturbation = case.config.perturbation
    if perturbation is not None and perturbation.window is not None:
        begin, end = (max(time - place.time, 0.0) for time in perturbation.window)
        window = (begin, max(end, begin + LEAST_WINDOW))
        perturbation = msgspec.structs.replace(perturbation, window=window)
    return replace(
        case,
        config=replace(case.config, start=None, perturbation=perturbation),
        found=replace(case.found, movers=movers),
        ends=ends,
        way=way,
    )


def _later(mover: Mover, seconds: float) -> Mover:
    """Return a mover as it is after some time, if nothing stopped it; one by a timetable as it is.

    Args:
        mover: The mover.
        seconds: s.
    """
    if mover.times:
        return mover
    return replace(
        mover,
        begin=mover.begin + mover.speed * seconds,
        appears=max(mover.appears - seconds, 0.0),
        vanishes=max(mover.vanishes - seconds, LEAST_WINDOW),
    )


def fewer_solids(case: Case) -> Steps:
    """Take solids away, all but the floor."""
    parts = case.found.parts
    solids = [n for n, part in enumerate(parts) if part.kind != FLOOR_KIND]

    def keep(case: Case, numbers: Sequence[int]) -> Case:
        chosen = {solids[n] for n in numbers}
        left = [part for n, part in enumerate(parts) if part.kind == FLOOR_KIND or n in chosen]
        return replace(case, found=replace(case.found, parts=left))

    return (yield from fewest(case, len(solids), keep))


def fewer_movers(case: Case) -> Steps:
    """Take movers away."""
    movers = case.found.movers

    def keep(case: Case, numbers: Sequence[int]) -> Case:
        return replace(case, found=replace(case.found, movers=[movers[n] for n in numbers]))

    return (yield from fewest(case, len(movers), keep))


def fewer_goals(case: Case) -> Steps:
    """Take goals before the last one away."""
    goals = case.config.waypoints

    def keep(case: Case, numbers: Sequence[int]) -> Case:
        left = tuple(goals[n] for n in numbers)
        return replace(case, config=replace(case.config, waypoints=left))

    return (yield from fewest(case, len(goals), keep))


def weaker_perturbation(case: Case) -> Steps:
    """Take the perturbation away, or make it weaker."""
    perturbation = case.config.perturbation
    if perturbation is None:
        return case
    levels = [share * perturbation.severity for share in SHARES]
    weaker = [msgspec.structs.replace(perturbation, severity=level) for level in levels]
    smaller = [replace(case, config=replace(case.config, perturbation=one))
               for one in (None, *weaker)]  # fmt: skip
    return (yield from first(case, smaller))


def shorter_perturbation(case: Case) -> Steps:
    """Let the perturbation act only for a while up to where it went wrong."""
    perturbation = case.config.perturbation
    if perturbation is None or not perturbation.windowed or not case.way:
        return case
    begin, end = perturbation.window or (0.0, case.way[-1].time)
    windows = [(round(end - share * (end - begin), 2), round(end, 2)) for share in SHARES]
    shorter = [
        msgspec.structs.replace(perturbation, window=window)
        for window in windows
        if window[0] < window[1]
    ]
    smaller = [replace(case, config=replace(case.config, perturbation=one)) for one in shorter]
    return (yield from first(case, smaller))


def fewer_settings(case: Case) -> Steps:
    """Put settings back to their defaults."""
    changed = changed_settings(case.config)

    def keep(case: Case, numbers: Sequence[int]) -> Case:
        chosen = {changed[n] for n in numbers}
        back = [name for name in changed if name not in chosen]
        return replace(case, config=_with_defaults(case.config, back))

    return (yield from fewest(case, len(changed), keep))


def changed_settings(config: Config) -> list[str]:
    """Return the names of the settings that are not at their defaults."""
    defaults = Config("", "", 0)
    return [
        name
        for name in setting_names()
        if name.partition(".")[0] not in APART
        and value_of(config, name) != value_of(defaults, name)
    ]


def _with_defaults(config: Config, names: Sequence[str]) -> Config:
    defaults = Config("", "", 0)
    texts = [f"{name}={msgspec.json.encode(value_of(defaults, name)).decode()}" for name in names]
    return override(config, texts)


REDUCTIONS: dict[str, Callable[[Case], Steps]] = {
    "start": nearer_start,
    "goals": fewer_goals,
    "movers": fewer_movers,
    "solids": fewer_solids,
    "perturbation": weaker_perturbation,
    "window": shorter_perturbation,
    "settings": fewer_settings,
}
"""Name -> reduction, in the order in which they are tried: what shortens the episodes first."""
