"""`wayproof shadow`: step the stack through a recording, and judge the way really driven."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, recording_options

if TYPE_CHECKING:
    from wayproof.harness.recordings.recording import Recording
    from wayproof.harness.shadow.prepare import Prepared
    from wayproof.harness.shadow.summary import Summary

SHOWN_PLACES = 10
SHOWN_STOPS = 3

EXIT_CODES = {"admitted": 0, "not admitted": 1, "nothing shown": 3}
STYLES = {"admitted": "bold green", "not admitted": "bold red", "nothing shown": "bold yellow"}


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Decide on a recording, write its log, and judge it."""
    from wayproof.harness.log.writer import refuse_inputs
    from wayproof.harness.recordings.formats import open_recording
    from wayproof.harness.shadow.assess import assess
    from wayproof.harness.shadow.body import find_body
    from wayproof.harness.shadow.prepare import prepare
    from wayproof.harness.shadow.summary import summarize

    body = find_body(options.robot)
    recording = open_recording(options.recording, options=recording_options(options))
    perturbation = None
    if options.perturb is not None:
        from wayproof.harness.perturbations import perturbation_from

        perturbation = perturbation_from(options.perturb)
    prepared = prepare(
        recording,
        body,
        options.set,
        seed=options.seed,
        stack=options.stack,
        perturbation=perturbation,
        prior=options.prior,
    )
    path = options.log or options.logs / f"{log_name(recording, prepared)}.mcap"
    given = [one.partition("=")[2] for one in options.set]
    refuse_inputs(path, (options.recording, options.prior or "", *given))
    console.print(f"{recording.name}: {recording.chosen}")
    if prepared.assumes_height:
        console.print(
            "the recording does not say how high the body is: its origin is taken to be on the "
            "floor; --mount or --set recording.body_height=M says otherwise"
        )
    began = time.perf_counter()
    _run(recording, prepared, path, console)
    stepped = time.perf_counter() - began
    with console.status("judging the way on the maps of each moment"):
        summary = summarize(assess(path, allow_plugins=True))
    wall = time.perf_counter() - began
    print_summary(console, summary)
    minutes = max(summary.duration_s, 1e-9) / 60.0
    console.print(
        f"{stepped:.1f} s for the decisions and {wall - stepped:.1f} s for the verdict: "
        f"{wall / minutes:.1f} s a minute of recording"
    )
    console.print(f"log: {summary.log}  chain: {summary.chain}")
    console.print(f"next: wayproof report {summary.log}")
    document = asdict(summary)
    document |= {"wall_time_s": wall, "seconds_per_minute": wall / minutes}
    return EXIT_CODES[summary.verdict], document


def _run(recording: Recording, prepared: Prepared, path: Path, console: Console) -> None:
    """Write the log, with a live line."""
    from wayproof.harness.cli.live import LiveLine
    from wayproof.harness.cli.run import interrupted, warn_of_kept
    from wayproof.harness.log.writer import hold_log
    from wayproof.harness.shadow.runner import run_recording

    line = LiveLine(console, prepared.config.world.partition("@")[0])
    with hold_log(path) as draft:
        warn_of_kept(draft)
        try:
            with line:
                run_recording(recording, prepared, draft, line)
        except KeyboardInterrupt:
            raise interrupted(path, line.decisions) from None


def log_name(recording: Recording, prepared: Prepared) -> str:
    """Return the recording's name, with eight digits of a hash of the config."""
    import hashlib

    from wayproof.harness.config_document import to_json

    stem = recording.name.partition(".")[0] or "recording"
    kept = "".join(c if c.isalnum() or c in "-_" else "-" for c in stem)[:60]
    return f"{kept}-{hashlib.sha256(to_json(prepared.config)).hexdigest()[:8]}"


def print_summary(console: Console, summary: Summary) -> None:
    """Print the verdict, the worst places, and what the stack would have done."""
    from wayproof.harness.shadow.summary import lines_of

    share = "" if summary.admitted_share is None else f" ({summary.admitted_share:.1%} admitted)"
    text = Text.assemble(
        (summary.verdict, STYLES[summary.verdict]), f": {summary.reason}{share}; {summary.faults}"
    )
    console.print(text)
    _print_places(console, summary)
    for line in lines_of(summary):
        console.print(f"  {line}")
    for stop in summary.stops[:SHOWN_STOPS]:
        at = ", ".join(f"{value:.1f}" for value in stop.position[:2])
        console.print(
            f"    {stop.seconds:.1f} s from {stop.begin_s:.1f} s on (decision {stop.sequence}), at "
            f"({at}): {stop.action}: {stop.reason}"
        )


def _print_places(console: Console, summary: Summary) -> None:
    if not summary.places:
        return
    lengths = ", ".join(f"{why} {length:.2f} m" for why, length in summary.refused_m.items())
    table = Table(title=f"not admitted when entered: {lengths}", title_justify="left")
    for name in ("decision", "from, s", "way, m", "at, m", "why", "cells"):
        table.add_column(name, justify="right" if name != "cells" else "left")
    for place in summary.places[:SHOWN_PLACES]:
        at = ", ".join(f"{value:.1f}" for value in place.position[:2])
        cells = " ".join(_point(cell.place) for cell in place.cells[:2])
        table.add_row(
            str(place.sequence),
            f"{place.begin_s:.1f}",
            f"{place.length_m:.2f}",
            at,
            place.why,
            cells,
        )
    console.print(table)
    if len(summary.places) > SHOWN_PLACES:
        console.print(f"  and {len(summary.places) - SHOWN_PLACES} more places")


def _point(place: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in place) + ")"


VERB = Verb(
    help="judge the way that a recorded robot took, and show what the stack would do; "
    "exit code 1 if part of it was not admitted, 3 if nothing was shown",
    add_arguments=arguments(
        shared.recording,
        arg("--robot ROBOT", "body: a spec file, or a name of 'wayproof list'", required=True),
        arg("--seed N", "seed of the searches", int, 0),
        shared.settings,
        shared.prior,
        shared.perturb,
        arg("--stack STACK", "stack that decides, as of 'wayproof run'; it is run"),
        shared.log_file,
        shared.log_folder,
    ),
    run=run,
    example="wayproof shadow examples/recordings/fr079/fr079-200.clf.bz2 --robot quadruped",
)
