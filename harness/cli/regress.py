"""`wayproof regress`: a test folder of a failure or of a recording, which any stack can run."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import Document, Verb, arg, arguments
from wayproof.harness.errors import InputError


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the test folder."""
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.regress.folder import command_of, write_test

    if options.seeds < 1:
        raise InputError(f"--seeds {options.seeds}: expected at least 1")
    try:
        log = open_log(options.log, options.allow_plugins)
    except InputError as error:
        hint = "of a bag expected the log that 'wayproof shadow BAG --log FILE' writes"
        raise InputError(f"{error}; {hint}") from None
    if log.config.recording is None:
        from wayproof.harness.regress.scene import case_of

        cause = log.result.get("cause", "")
        case = case_of(log, int(log.result.get("cause_decision") or 0), options.robot)
        reason = log.result.get("reason", "")
        ended = f"{log.result['outcome']}: {reason}" if reason else log.result["outcome"]
        what = [f"An episode of `{log.config.world}` ended with {ended}."]
        if cause:
            what.append(f"Cause: {cause}: {log.result.get('cause_evidence', '')}.")
    else:
        from wayproof.harness.regress.recorded import UNSEEN, case_of_recording

        if options.robot is None:
            raise InputError("--robot: of a recording expected the robot that drives in the test")
        case = case_of_recording(log, options.robot, seed=0)
        unseen = sum(part.kind == UNSEEN for part in case.found.parts)
        seconds = case.way[-1].time - case.way[0].time
        what = [
            f"A recorded robot drove from the start to the goal in {seconds:.1f} s; they are the "
            "first and the last place of its way with room for this robot.",
            f"The world is what it saw; {unseen} solids named `{UNSEEN}` stand where it saw "
            "nothing: a verdict that names one of them hangs on what nobody saw.",
        ]
    first = case.config.seed
    seeds = range(first, first + options.seeds)
    test = write_test(case, options.out, options.out.resolve().name, seeds, what)
    for line in what:
        console.print(line)
    command = command_of(test)
    console.print(f"next: {command}", soft_wrap=True)
    return 0, {"test": str(test), "seeds": list(seeds), "command": command}


VERB = Verb(
    help="make a test folder of a failure or a recording, which any stack can run",
    add_arguments=arguments(
        arg("LOG", "log of an episode, or of a recording as 'wayproof shadow' writes it", Path),
        arg("--out FOLDER", "folder of the test", Path, required=True),
        arg("--seeds N", "number of seeds of the noise, from that of the log on", int, 1),
        arg("--robot ROBOT", "robot of a recording's test, or the spec file of your own robot"),
        shared.plugins,
    ),
    run=run,
    example="wayproof regress logs/crossing-quadruped-1.mcap --out tests/crossing",
)
