"""`wayproof replay fork`: continue an episode from a decision with other settings."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.differences import print_differences
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, warn_of_changed_plugins
from wayproof.harness.cli.what_if import refuse_worlds
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.replay.answers import RestartedStack


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Simulate from decision N on, into a new log."""
    from wayproof.harness.cli.live import LiveLine
    from wayproof.harness.cli.run import document_of, interrupted, print_verdict
    from wayproof.harness.config_document import override
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.answers import restarted_stack
    from wayproof.harness.replay.fork import fork, fork_name

    path, at = options.log, options.n
    if at < 0:
        raise InputError(f"N: got {at}, expected a decision's number, 0 or more")
    log = open_log(path, options.allow_plugins)
    if options.allow_plugins or log.config.runs_predictor:
        warn_of_changed_plugins(log)
    refuse_worlds(options.set)
    config = override(log.as_of(at).config, options.set)
    target = options.out or fork_name(path, at, config)
    restarting: contextlib.AbstractContextManager[RestartedStack | None] = contextlib.nullcontext()
    if options.stack is not None:
        restarting = restarted_stack(log, options.stack)
    line = LiveLine(console, config.robot)
    try:
        with restarting as restarted, line:
            result = fork(
                path, at, options.set, target, options.allow_plugins, line.observe, restarted
            )
    except KeyboardInterrupt:
        raise interrupted(target, line.decisions) from None
    if restarted is not None:
        _print_answers_before(console, restarted)
    before = log.result["outcome"]
    console.print(f"recorded: {before}; from decision {at} on: {result.outcome}")
    print_verdict(console, result, config.latency)
    code = 0 if result.outcome == "success" else 1
    document = {**document_of(result), "recorded_outcome": before, "from": at}
    if restarted is not None:
        document["answers_before"] = restarted.answers
        document["answers_differing"] = restarted.differing
        document["first_answer_differing"] = restarted.first_difference
    return code, document


def _print_answers_before(console: Console, restarted: RestartedStack) -> None:
    """Print whether a stack answered as recorded before it went on."""
    first = restarted.first_difference
    differ = "all as recorded" if first is None else f"{restarted.differing} differ, first {first}"
    console.print(
        f"stack '{restarted.stack}' queried on {restarted.answers} decisions before: {differ}"
    )
    print_differences(console, restarted.differences)


VERB = Verb(
    help="continue the simulation from decision N with other settings, in a new log",
    add_arguments=arguments(
        shared.log,
        arg("N", "number of the decision", int),
        shared.settings,
        arg("--stack STACK", "stack that was on trial, run again"),
        arg("--log FILE", "name of the new log", Path, dest="out"),
        shared.plugins,
    ),
    run=run,
    example="wayproof replay fork logs/warehouse-drone-3.mcap 10 --log fork.mcap",
)
