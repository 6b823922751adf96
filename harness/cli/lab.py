"""`wayproof lab`: one log or recording through maps of other settings, side by side."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import (
    Document,
    Verb,
    arg,
    arguments,
    check_ending,
    recording_options,
)
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.lab.policies import Policy
    from wayproof.harness.lab.source import Source
    from wayproof.harness.lab.trials import Rays, Trial

COLUMNS = ("varied", "ms", "MiB", "occupied", "free", "misses", "ghosts", "gone", "same")
"""Heads of the columns of the table."""

SWEEPS = 200
"""Default number of sweeps."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Integrate the same sweeps into every map, and print the table."""
    from wayproof.harness.lab.trials import against_octomap, cast_rays, run_trial, variants

    if not 1 <= options.sweeps <= 100_000:
        raise InputError(f"--sweeps: got {options.sweeps}, expected 1 to 100000")
    check_ending("--plot", options.plot, ".png")
    source = _source(options)
    if options.kind is not None:
        source = replace(source, config=replace(source.config, kind=options.kind))
    trials: list[Trial] = []
    refused: dict[str, str] = {}
    with console.status("integrating") as status:
        for group, setting, config in variants(source.config):
            status.update(f"{group} {setting}")
            try:
                trials.append(run_trial(source, group, setting, config))
            except (ValueError, MemoryError) as error:
                refused[f"{group} {setting}"] = str(error) or "out of memory"
        peers = against_octomap(source)
        rays = cast_rays(source)
        status.update("judging the way under each policy")
        policies = _policies(options)
    trials += peers or ()
    _print(console, source, trials, refused, rays)
    _print_policies(console, policies)
    if peers is None:
        console.print("  no OctoMap beside it: pip install pyoctomap")
    if options.plot is not None:
        from wayproof.harness.lab.plots import plot

        plot(trials, options.plot)
        console.print(f"plot: {options.plot}")
    document: Document = {
        "source": source.name,
        "sweeps": len(source.sweeps),
        "trials": [asdict(trial) for trial in trials],
        "refused": refused,
        "rays": None if rays is None else asdict(rays),
        "policies": [asdict(one) for one in policies],
    }
    return 0, document


def _source(options: argparse.Namespace) -> Source:
    """Return the sweeps of a log, or of a recording."""
    from wayproof.harness.lab.source import of_log, of_recording

    path: Path = options.recording
    if _names_log(options):
        return of_log(path, options.sweeps)
    from wayproof.harness.recordings.formats import open_recording
    from wayproof.harness.shadow.body import find_body
    from wayproof.harness.shadow.prepare import prepare

    if options.robot is None:
        raise InputError("--robot: expected a body for a recording, whose region is mapped")
    recording = open_recording(path, options=recording_options(options))
    prepared = prepare(recording, find_body(options.robot), options.set)
    return of_recording(recording, prepared, options.sweeps)


def _policies(options: argparse.Namespace) -> list[Policy]:
    """Judge the way of a recording's log under each policy; None for other sources."""
    from wayproof.harness.lab.policies import policies_of
    from wayproof.harness.log.reader import open_log

    path: Path = options.recording
    if not _names_log(options) or open_log(path).config.recording is None:
        return []
    return policies_of(path)


def _names_log(options: argparse.Namespace) -> bool:
    """Return whether the recording is a log of Wayproof, and not a bag."""
    from wayproof.harness.log.codec.container import is_log

    path: Path = options.recording
    return options.format is None and path.is_file() and is_log(path)


def _print_policies(console: Console, policies: list[Policy]) -> None:
    if not policies:
        console.print("  no way judged by policy: expected the log of 'wayproof shadow'")
    for one in policies:
        share = "nothing shown" if one.admitted_share is None else f"{one.admitted_share:.1%}"
        refused = ", ".join(f"{why} {length:.2f} m" for why, length in one.refused_m.items())
        console.print(
            f"  unknown {one.policy}: {share} of {one.driven_m:.2f} m admitted"
            f"{f'; not: {refused}' if refused else ''}"
        )


def _print(
    console: Console,
    source: Source,
    trials: list[Trial],
    refused: dict[str, str],
    rays: Rays | None,
) -> None:
    title = f"{source.name}: {len(source.sweeps)} sweeps, map {source.config.kind}"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for name in COLUMNS:
        table.add_column(name, justify="left" if name == "varied" else "right", no_wrap=True)
    for one in trials:
        table.add_row(
            f"{one.kind if one.group == 'peer' else one.group} {one.setting}",
            f"{one.ms_p50:.2f}",
            f"{one.memory_mib:.2f}",
            str(one.occupied),
            str(one.free),
            "-" if one.misses_to_free is None else str(one.misses_to_free),
            "" if one.ghosts is None else str(one.ghosts),
            "" if one.sweeps_to_free is None else f"{one.sweeps_to_free:g}",
            "" if one.agreement is None else f"{one.agreement:.3%}",
        )
    console.print(table)
    console.print(
        "  ms: median of a sweep; misses: sweeps through a cell until it is free again, on a plain "
        "wall; ghosts: occupied cells of these sweeps that became free; gone: sweeps from their "
        "last hit until then, median; same: cells as in OctoMap"
    )
    for setting, why in refused.items():
        console.print(f"  not made: {setting}: {why}")
    if rays is not None:
        console.print(
            f"  rays from the last place: {rays.occupied:.0%} meet something within 10 m, "
            f"{rays.unknown:.0%} meet unknown space before it; "
            f"{rays.mean_free_m:.2f} m are free on average"
        )


VERB = Verb(
    help="compare resolutions, clamps and decay of the map on the sweeps of a log or a recording",
    add_arguments=arguments(
        shared.recording,
        arg("--robot ROBOT", "body of a recording: a spec file, or a robot's name"),
        shared.settings,
        arg("--sweeps N", "number of sweeps that are integrated", int, SWEEPS),
        arg("--kind NAME", "kind of the maps (default: the log's)"),
        arg("--plot FILE.png", "draw memory and time", Path),
    ),
    run=run,
    example="wayproof lab logs/warehouse-drone-3.mcap",
)
