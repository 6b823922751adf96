"""`wayproof replay simulate`: simulate the episode of a log again, and compare it all."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.differences import print_differences, print_elsewhere
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, replay_each
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.replay.closed_loop import ClosedLoop


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Simulate one or more logs again; exit code 1 if anything differs."""
    if options.out is not None and len(options.log) > 1:
        raise InputError(f"--log: got {len(options.log)} logs, expected one")
    return replay_each(_simulate, options, console)


def _simulate(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.replay.closed_loop import simulate_again

    again = simulate_again(path, options.allow_plugins, options.out)
    print_closed_loop(console, again)
    return again.identical, asdict(again)


def print_closed_loop(console: Console, again: ClosedLoop) -> None:
    """Print whether the repeated simulation gave the recorded episode, and where it departs."""
    verdict = ("identical", "bold green") if again.identical else ("differs", "bold red")
    kept = "all but sweeps and states" if again.regenerated else "all"
    ended = f"{again.outcome} now, {again.recorded_outcome} then"
    if again.outcome == again.recorded_outcome:
        ended = again.outcome
    console.print(
        Text.assemble(
            verdict,
            f": {kept} of {again.decisions} decisions, {ended}; "
            f"{again.wall_time_s:.1f} s; chain {again.chain}; {again.log}",
        )
    )
    if again.made_otherwise:
        console.print("  the seed makes another episode in this version; the log's was simulated:")
        print_differences(console, again.made_otherwise)
    for kind, place in (("input", again.first_input), ("record", again.first_record)):
        if place is not None:
            console.print(
                f"  first {kind} that differs: {place.stream} of decision {place.sequence} "
                f"({place.time_s:.1f} s)"
            )
            print_differences(console, place.differences)
    if again.first_difference is not None:
        console.print(f"  first decision that differs: {again.first_difference}")
    print_differences(console, [*again.differences, *again.result])
    if not again.identical and again.elsewhere:
        print_elsewhere(console, again.elsewhere)
    if again.written:
        console.print(f"log: {again.written}")


VERB = Verb(
    help="simulate the episode of a log again from its seed, and compare the sensor data as well",
    add_arguments=arguments(
        shared.log_paths,
        arg("--log FILE", "write the episode again, in full, as a new log", Path, dest="out"),
    ),
    run=run,
    example="wayproof replay simulate logs/warehouse-drone-3.mcap",
)
