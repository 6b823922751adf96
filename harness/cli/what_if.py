"""`wayproof replay what-if`: decisions of a log by other settings or another stack."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.differences import print_differences
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, replay_each
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.replay.what_if import Answer, WhatIf

SHOWN_CHANGES = 5


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Recompute the decisions of one or more logs; exit code 1 if any changes."""
    if bool(options.set) == bool(options.stack):
        raise InputError("replay what-if: expected either --set KEY=VALUE or --stack STACK")
    return replay_each(_what_if if options.set else _compare_answers, options, console)


def _compare_answers(
    path: Path, options: argparse.Namespace, console: Console
) -> tuple[bool, Document]:
    from wayproof.harness.replay.answers import compare_answers

    restarted = compare_answers(path, options.stack)
    verdict, count = ("identical", "bold green"), f"{restarted.answers} answers"
    if not restarted.identical:
        verdict = ("differs", "bold red")
        count = f"{restarted.differing} of {count}, first {restarted.first_difference}"
    words = f": {count} of stack '{restarted.stack}'; {restarted.log}"
    console.print(Text.assemble(verdict, words))
    print_differences(console, restarted.differences)
    return restarted.identical, restarted.document()


def _what_if(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.replay.what_if import what_if

    refuse_worlds(options.set)
    answer = what_if(path, options.set, options.allow_plugins)
    print_what_if(console, answer)
    return not answer.changes, asdict(answer)


def refuse_worlds(settings: Sequence[str]) -> None:
    """Refuse parameters of the world, whose scene is in the log.

    Raises:
        InputError: There is one.
    """
    for setting in settings:
        if setting.startswith("world."):
            raise InputError(f"--set {setting}: the log holds its world; expected 'wayproof run'")


def print_what_if(console: Console, answer: WhatIf) -> None:
    """Print which decisions change under other settings, and how."""
    changes, settings = answer.changes, ", ".join(answer.settings)
    if not answer.faithful:
        console.print("the log's own settings no longer decide what is recorded: see replay")
    if not changes:
        console.print(
            f"nothing changes: {answer.decisions} of {answer.decisions} decisions by {settings}; "
            f"{answer.wall_time_s:.1f} s; {answer.log}"
        )
        _print_verdicts(console, answer)
        return
    first = changes[0]
    console.print(
        Text.assemble(
            (f"{len(changes)} of {answer.decisions} decisions change", "bold yellow"),
            f" by {settings}, from {first.sequence} ({first.time_s:.1f} s) on; "
            f"{answer.wall_time_s:.1f} s; {answer.log}",
        )
    )
    _print_verdicts(console, answer)
    if answer.first_action is not None:
        console.print(f"  {answer.actions} change the action, from {answer.first_action} on")
    shown = changes[:SHOWN_CHANGES]
    shown += tuple(one for one in changes[SHOWN_CHANGES:] if one.sequence == answer.first_action)
    for change in shown:
        route = change.route_difference_m
        routes = change.recorded.path_length_m, change.changed.path_length_m
        apart = "only one has a route" if any(routes) else "no routes"
        apart = apart if route is None else f"routes {route:.2f} m apart"
        console.print(
            f"  {change.sequence} ({change.time_s:.1f} s): trajectories {change.departure_m:.2f} m "
            f"apart, {apart}"
        )
        console.print(f"    was {_answer(change.recorded)}")
        console.print(f"    now {_answer(change.changed)}")
    if len(changes) > len(shown):
        console.print(f"  and {len(changes) - len(shown)} more")


def _print_verdicts(console: Console, answer: WhatIf) -> None:
    """Print how the referee judges the commands of a stack on trial, then and now."""
    verdicts = {"recorded": answer.recorded_verdicts, "changed": answer.changed_verdicts}
    for when, one in verdicts.items():
        first = "" if one.first_cut is None else f", the first at {one.first_cut}"
        if one.admitted or one.cut:
            console.print(
                f"  {when}: the referee admits {one.admitted} commands, {one.unknown} unknown, "
                f"{one.blocked} blocked; a guard cuts {one.cut}{first}"
            )


def _answer(answer: Answer) -> str:
    label = "" if answer.label == "none" else f" [{answer.label}]"
    route = f", {answer.path_length_m:.2f} m to go" if answer.path_length_m else ", no route"
    return f"{answer.action}{label}: {answer.reason}{route}"


VERB = Verb(
    help="show what other settings, or another stack, decide on the inputs of a log",
    add_arguments=arguments(
        shared.log_paths,
        shared.settings,
        arg("--stack STACK", "query this stack on the log's inputs, and compare its answers"),
    ),
    run=run,
    example="wayproof replay what-if logs/empty-drone-1.mcap --set costmap.localization_margin=0.2",
)
