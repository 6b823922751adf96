"""`wayproof shrink`: the smallest scenario that fails as a log did."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.engine_options import Watch, add_engine, check_engine, open_engine
from wayproof.harness.cli.explain import draw_episode
from wayproof.harness.cli.verb import Document, Verb, arg, arguments
from wayproof.harness.errors import InputError, Interrupted

MOST_EPISODES = 300


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Shrink a failure, or continue to."""
    from wayproof.harness.attribution import find_cause, read_case
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.regress.shrink import command_of, shrink
    from wayproof.harness.worker_pool import Bounds

    check_engine(options)
    if options.at_most < 1:
        raise InputError(f"--at-most {options.at_most}: expected at least 1")
    log = open_log(options.log, options.allow_plugins)
    folder = options.out or options.log.with_suffix(".shrunk")
    with open_engine(options, Bounds()) as engine, Watch(console, None) as watch:
        try:
            shrunk = shrink(
                log, folder, engine, options.at_most, watch.finished, console.print, options.robot
            )
        except KeyboardInterrupt:
            text = "what was tried is kept, and the same command continues"
            raise Interrupted(text) from None
    console.print(f"before: {shrunk.before.in_words()}")
    console.print(f"after:  {shrunk.after.in_words()}")
    small = open_log(shrunk.log, allow_plugins=True)
    case = read_case(small)
    finding = find_cause(case)
    assert finding is not None
    console.print(f"{shrunk.outcome}, cause: {finding.cause}, {shrunk.check}: {finding.evidence}")
    if not shrunk.ended:
        console.print(
            f"stopped by --at-most {options.at_most}; the same command with more continues"
        )
    draw_episode(small, case, finding, folder / "shrunk.png", console)
    command = command_of(small, shrunk.world)
    for line in (f"log: {shrunk.log}", f"again: {command}"):
        console.print(line, soft_wrap=True)
    document = {**asdict(shrunk), "world": str(shrunk.world), "log": str(shrunk.log)}
    return 0, {**document, "command": command}


VERB = Verb(
    help="find the smallest scenario that fails as a log did, for the same cause",
    add_arguments=arguments(
        arg("LOG", "log of a failure", Path),
        arg("--out FOLDER", "folder of the result (default: LOG with the ending .shrunk)", Path),
        arg("--at-most N", "maximum number of episodes", int, MOST_EPISODES),
        arg("--robot FILE", "spec file of the robot, if it is your own"),
        add_engine,
        shared.plugins,
    ),
    run=run,
    example="wayproof shrink logs/crossing-quadruped-1.mcap",
)
