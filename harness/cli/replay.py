"""`wayproof replay`: recompute every decision of a log and compare it bit by bit."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli.verb import (
    Document,
    Verb,
    add_log_paths,
    add_settings,
    one_or_all,
    warn_of_changed_plugins,
)
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.decision import Difference
    from wayproof.harness.log.reader import Log
    from wayproof.harness.replay.answers import RestartedStack
    from wayproof.harness.replay.closed_loop import ClosedLoop
    from wayproof.harness.replay.replay import Replay
    from wayproof.harness.replay.scope import Scope
    from wayproof.harness.replay.what_if import Answer, WhatIf

SHOWN_DIFFERENCES = 8
SHOWN_CHANGES = 5
MOST_JOBS = 1024


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Recompute the decisions of one or more logs, with their own settings or with others."""
    from wayproof.harness.log.reader import open_log

    _check(options)
    if options.at is not None:
        return _fork(options, console)
    check = {True: _simulate, False: _what_if if options.set else _replay}[options.closed_loop]
    if options.stack is not None:
        check = _compare_answers
    outcomes = []
    for path in options.log:
        changed = warn_of_changed_plugins(open_log(path, True)) if options.allow_plugins else []
        good, document = check(path, options, console)
        outcomes.append((good, {**document, "changed_plugins": changed}))
    code = 0 if all(good for good, _ in outcomes) else 1
    return code, one_or_all("replays", [document for _, document in outcomes])


def _check(options: argparse.Namespace) -> None:
    if options.closed_loop and (options.set or options.at is not None):
        raise InputError(
            "--closed-loop: simulates what was recorded, so it goes with neither --set nor --from"
        )
    compares = options.stack is not None and options.at is None
    if compares and (options.closed_loop or options.set):
        raise InputError(
            "--stack: queries the stack again, so it goes with no other way to replay but --from N"
        )
    single = options.at is not None or options.out is not None
    if single and len(options.log) > 1:
        raise InputError(f"--from, --log: got {len(options.log)} logs, expected one")
    if options.out is not None and not (options.closed_loop or options.at is not None):
        raise InputError("--log: nothing to write, expected --closed-loop or --from N with it")
    if options.threads is not None and not 1 <= options.threads <= 64:
        raise InputError(f"--threads: got {options.threads}, expected 1 to 64")
    if options.threads is not None and (options.closed_loop or single or options.set):
        raise InputError("--threads: goes with a plain replay, otherwise --set threads=N")
    if options.jobs is not None and not 1 <= options.jobs <= MOST_JOBS:
        raise InputError(f"--jobs: got {options.jobs}, expected 1 to {MOST_JOBS}")
    if options.at is not None and options.at < 0:
        raise InputError(f"--from: got {options.at}, expected a decision's number, 0 or more")


def _replay(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.forked import cores
    from wayproof.harness.replay.replay import replay

    jobs = options.jobs or cores()
    replayed = replay(path, options.allow_plugins, options.threads, jobs=jobs)
    print_replay(console, replayed)
    return replayed.identical, asdict(replayed)


def _compare_answers(
    path: Path, options: argparse.Namespace, console: Console
) -> tuple[bool, Document]:
    from wayproof.harness.replay.compare_answers import compare_answers

    comparison = compare_answers(path, options.stack)
    if comparison.identical:
        verdict = Text.assemble(("identical", "bold green"), f": {comparison.answers} answers")
    else:
        verdict = Text.assemble(
            ("differs", "bold red"),
            f": {comparison.differing} of {comparison.answers} answers, "
            f"first {comparison.first_difference}",
        )
    verdict.append(
        f" of stack '{comparison.stack}'; {comparison.wall_time_s:.1f} s; {comparison.log}"
    )
    console.print(verdict, soft_wrap=True)
    print_differences(console, comparison.differences)
    return comparison.identical, asdict(comparison)


def _what_if(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.replay.what_if import what_if

    _refuse_worlds(options.set)
    answer = what_if(path, options.set, options.allow_plugins)
    print_what_if(console, answer)
    return not answer.changes, asdict(answer)


def _refuse_worlds(settings: Sequence[str]) -> None:
    """Refuse parameters of the world, of which a log has the scene.

    Raises:
        InputError: There is one.
    """
    for setting in settings:
        if setting.startswith("world."):
            raise InputError(f"--set {setting}: the log holds its world; expected 'wayproof run'")


def _simulate(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.replay.closed_loop import simulate_again

    again = simulate_again(path, options.allow_plugins, options.out)
    print_closed_loop(console, again)
    return again.identical, asdict(again)


def _fork(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.cli.live import LiveLine
    from wayproof.harness.cli.run import document_of, interrupted, print_verdict
    from wayproof.harness.config_document import override
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.fork import fork, fork_name

    path = options.log[0]
    log = open_log(path, options.allow_plugins)
    if options.allow_plugins or log.config.runs_predictor:
        warn_of_changed_plugins(log)
    _refuse_worlds(options.set)
    config = override(log.as_of(options.at).config, options.set)
    target = options.out or fork_name(path, options.at, config)
    line = LiveLine(console, config.robot)
    try:
        with _restarted_stack(log, options.stack) as restarted, line:
            result = fork(
                path, options.at, options.set, target, options.allow_plugins, line, restarted
            )
    except KeyboardInterrupt:
        raise interrupted(target, line.decisions) from None
    if restarted is not None:
        _print_answers_before(console, restarted)
    before = log.result["outcome"]
    console.print(f"recorded: {before}; from decision {options.at} on: {result.outcome}")
    print_verdict(console, result)
    code = 0 if result.outcome == "success" else 1
    document = {**document_of(result), "recorded_outcome": before, "from": options.at}
    if restarted is not None:
        document["answers_before"] = restarted.answers
        document["answers_differing"] = restarted.differing
        document["first_answer_differing"] = restarted.first_difference
    return code, document


@contextlib.contextmanager
def _restarted_stack(log: Log, stack: str | None) -> Iterator[RestartedStack | None]:
    """Yield the stack on trial that a fork goes on with; None without `--stack`."""
    from wayproof.harness.replay.answers import restarted_stack

    if stack is None:
        yield None
        return
    with restarted_stack(log, stack) as restarted:
        yield restarted


def _print_answers_before(console: Console, restarted: RestartedStack) -> None:
    """Print whether a stack answered as recorded before it went on."""
    first = restarted.first_difference
    differ = "all as recorded" if first is None else f"{restarted.differing} differ, first {first}"
    console.print(
        f"stack '{restarted.stack}' queried on {restarted.answers} decisions before: {differ}",
        soft_wrap=True,
    )
    print_differences(console, restarted.differences)


def print_replay(console: Console, replayed: Replay) -> None:
    """Print the verdict of a replay, the first differences, and what the verdict covers."""
    if replayed.identical:
        text = Text.assemble(
            ("identical", "bold green"), f": {replayed.decisions} of {replayed.decisions} decisions"
        )
    else:
        first = replayed.first_difference
        where = "" if first is None else f", first {first}"
        if first is None and not replayed.contradictions:
            where = ", only the log's own chain"
        text = Text.assemble(
            ("differs", "bold red"),
            f": {replayed.differing} of {replayed.decisions} decisions{where}",
        )
    text.append(_not_compared(replayed.not_compared))
    text.append(f"; {replayed.wall_time_s:.1f} s; chain {replayed.chain}; {replayed.log}")
    console.print(text, soft_wrap=True)
    print_differences(console, [*replayed.differences, *replayed.contradictions])
    print_scope(console, replayed.scope)


def print_scope(console: Console, scope: Scope) -> None:
    """Print what a verdict covers and what it does not, a line each."""
    for title, parts in (
        ("recomputed", scope.recomputed),
        ("only --closed-loop shows", scope.simulation),
        ("claims", scope.claims),
    ):
        if parts:
            console.print(f"  {title}: {', '.join(parts)}", soft_wrap=True, highlight=False)


def _not_compared(fields: Sequence[str]) -> str:
    """Return the note on fields that a log of an older format does not have."""
    return f" ({', '.join(fields)} not compared: an older format)" if fields else ""


def print_what_if(console: Console, answer: WhatIf) -> None:
    """Print which decisions change under other settings, and how."""
    changes, settings = answer.changes, ", ".join(answer.settings)
    if not answer.faithful:
        console.print("the log's own settings no longer decide what is recorded: see replay")
    if not changes:
        console.print(
            f"nothing changes: {answer.decisions} of {answer.decisions} decisions by {settings}; "
            f"{answer.wall_time_s:.1f} s; {answer.log}",
            soft_wrap=True,
        )
        _print_verdicts(console, answer)
        return
    first = changes[0]
    console.print(
        Text.assemble(
            (f"{len(changes)} of {answer.decisions} decisions change", "bold yellow"),
            f" by {settings}, from {first.sequence} ({first.time_s:.1f} s) on; "
            f"{answer.wall_time_s:.1f} s; {answer.log}",
        ),
        soft_wrap=True,
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
            f"apart, {apart}",
            soft_wrap=True,
        )
        console.print(f"    was {_answer(change.recorded)}", soft_wrap=True)
        console.print(f"    now {_answer(change.changed)}", soft_wrap=True)
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
                f"{one.blocked} blocked; a guard cuts {one.cut}{first}",
                soft_wrap=True,
            )


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
            f": {kept} of {again.decisions} decisions, {ended}{_not_compared(again.not_compared)}; "
            f"{again.wall_time_s:.1f} s; chain {again.chain}; {again.log}",
        ),
        soft_wrap=True,
    )
    if again.made_otherwise:
        console.print("  the seed makes another episode in this version; the log's was simulated:")
        print_differences(console, again.made_otherwise)
    for kind, place in (("input", again.first_input), ("record", again.first_record)):
        if place is not None:
            console.print(
                f"  first {kind} that differs: {place.stream} of decision {place.sequence} "
                f"({place.time_s:.1f} s)",
                soft_wrap=True,
            )
            print_differences(console, place.differences)
    if again.first_difference is not None:
        console.print(f"  first decision that differs: {again.first_difference}")
    print_differences(console, [*again.differences, *again.result])
    if not again.identical and again.elsewhere:
        print_elsewhere(console, again.elsewhere)
    if again.written:
        console.print(f"log: {again.written}", soft_wrap=True, highlight=False)


def print_elsewhere(console: Console, elsewhere: Sequence[Difference]) -> None:
    """Print in which respects the machine of the recording differs from this one."""
    names = ", ".join(one.field for one in elsewhere)
    console.print(
        f"  recorded with another {names}: a simulation is repeated to the bit only on like "
        "machines, with the same versions",
        soft_wrap=True,
        highlight=False,
    )


def print_differences(console: Console, differences: Sequence[Difference]) -> None:
    """Print the first few differences, a line each."""
    for one in differences[:SHOWN_DIFFERENCES]:
        console.print(f"  {one.field}: {one.recorded} -> {one.recomputed}", soft_wrap=True)
    if len(differences) > SHOWN_DIFFERENCES:
        console.print(f"  and {len(differences) - SHOWN_DIFFERENCES} more")


def _answer(answer: Answer) -> str:
    label = "" if answer.label == "none" else f" [{answer.label}]"
    route = f", {answer.path_length_m:.2f} m to go" if answer.path_length_m else ", no route"
    return f"{answer.action}{label}: {answer.reason}{route}"


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_paths(parser)
    parser.add_argument(
        "--closed-loop",
        action="store_true",
        help="simulate the episode again and compare the sensor data as well",
    )
    add_settings(parser)
    parser.add_argument(
        "--stack",
        metavar="STACK",
        help="query a stack again on the log's inputs, and compare its answers; it is run; with "
        "--from it goes on from there",
    )
    parser.add_argument(
        "--from",
        dest="at",
        type=int,
        metavar="N",
        help="fork: continue the simulation from decision N with these settings, in a new log",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="most processes of a plain replay, each from a state in the log (default: all cores)",
    )
    parser.add_argument(
        "--threads", type=int, metavar="N", help="number of threads (default: the log's)"
    )
    parser.add_argument("--log", dest="out", type=Path, metavar="FILE", help="name of the new log")


VERB = Verb(
    help="recompute every decision of a log and compare bit by bit, or with other settings",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof replay logs/warehouse-drone-3.mcap --set costmap.localization_margin=0.15",
)
