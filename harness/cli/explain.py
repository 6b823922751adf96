"""`wayproof explain`: a card of one decision, or the course of an episode and its failure."""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.card_table import print_card
from wayproof.harness.cli.cause_text import print_finding, print_verdict
from wayproof.harness.cli.metrics import print_metrics
from wayproof.harness.cli.verb import (
    Document,
    Verb,
    arg,
    arguments,
    check_ending,
    check_log,
    one_or_all,
    warn_of_changed_plugins,
)
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.attribution import Case, Finding
    from wayproof.harness.counterfactual.verdict import Verdict
    from wayproof.harness.explain import Card, Phase
    from wayproof.harness.log.reader import Log
    from wayproof.harness.stack.pipeline import Navigator

SHOWN_STDERR = 8


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Explain a decision, or one or more episodes, or print their metrics."""
    paths, number = _logs_and_number(options.log)
    _check_options(options, paths, number)
    if number is not None:
        return 0, _explain_decision(paths[0], number, options, console)
    explain = print_metrics if options.metrics else _explain_episode
    documents = []
    for path in paths:
        check_log(path, options)
        log = open_checked(path, options)
        documents.append(explain(log, options, console))
    return 0, one_or_all("logs", documents)


def _logs_and_number(words: Sequence[str]) -> tuple[list[Path], int | None]:
    """Return the logs, and the number of a decision if the last word is one."""
    *before, last = words
    if before and last.lstrip("-").isdecimal():
        return [Path(word) for word in before], int(last)
    return [Path(word) for word in words], None


def _check_options(options: argparse.Namespace, paths: Sequence[Path], number: int | None) -> None:
    check_ending("--png", options.png, ".png")
    if options.png is not None and not options.png.parent.is_dir():
        raise InputError(f"--png: got '{options.png}', expected a file in a folder that exists")
    if len(paths) > 1 and (options.png is not None or number is not None):
        raise InputError(f"N, --png: got {len(paths)} logs, expected one")
    if options.check and number is not None:
        raise InputError("--check: goes with the whole episode, expected no decision's number")
    if options.metrics and (options.check or options.png or number is not None):
        raise InputError("--metrics: of the whole episode, goes with neither N, --png nor --check")


def open_checked(path: Path, options: argparse.Namespace) -> Log:
    """Open a log; warn where a class that it names has changed, if that may run."""
    from wayproof.harness.log.reader import open_log

    log = open_log(path, options.allow_plugins)
    if options.allow_plugins:
        warn_of_changed_plugins(log)
    return log


def _explain_decision(
    path: Path, number: int, options: argparse.Namespace, console: Console
) -> Document:
    """Explain a decision; the log is checked in another process meanwhile, where there is a core.

    Nothing is printed of a log that contradicts itself.
    """
    from wayproof.harness.forked import beside, cores

    log = open_checked(path, options)
    if options.unchecked or cores() == 1:
        check_log(path, options)
        case, card, navigator = _card(log, number)
    else:
        check = partial(check_log, path, options)
        (case, card, navigator), _ = beside([check], partial(_card, log, number))
    print_card(console, card)
    if options.png is not None:
        _draw(log, case, card, navigator, target=options.png, console=console)
    return card.document()


def _card(log: Log, number: int) -> tuple[Case, Card, Navigator]:
    """Return the case of a decision, its card, and a stack with its map."""
    from wayproof.harness.attribution import read_case
    from wayproof.harness.explain.card import make_card, moment_of

    case = read_case(log)
    moment_of(case, number)
    case = case.as_of(number)
    keyframe = case.keyframe_at(number)
    navigator = case.navigator_at(number, keyframe)
    begin = None if keyframe is None else keyframe.sequence
    return case, make_card(case, number, navigator, begin), navigator


def _explain_episode(log: Log, options: argparse.Namespace, console: Console) -> Document:
    from wayproof.harness.counterfactual.verdict import read_check

    if log.config.recording is not None and options.check:
        raise InputError("--check: simulates again, which a recording cannot")
    course = _course(log)
    _print_course(log, course, console)
    case, finding = _why(log)
    verdict = _check(log, finding, options.stack) if options.check else read_check(log)
    if verdict is not None:
        finding = verdict.finding
    if finding is not None:
        print_finding(console, finding, log.result["outcome"])
    if verdict is not None:
        print_verdict(console, verdict)
    if options.png is not None:
        draw_episode(log, case, finding, target=options.png, console=console)
    document: Document = {
        "log": str(log.path),
        "outcome": log.result["outcome"],
        "reason": log.result.get("reason", ""),
        "traceback": log.traceback,
        "stderr": log.stderr,
        "phases": [asdict(phase) for phase in course],
        "cause": None if finding is None else asdict(finding),
    }
    if verdict is not None:
        document["check"] = asdict(verdict)
    return document


def _course(log: Log) -> list[Phase]:
    """Return the phases of an episode or a recording."""
    from wayproof.harness.explain import phases
    from wayproof.harness.log.reader import as_truth

    recorded = log.config.recording is not None
    truths = [as_truth(motion) for motion in log.motions()] if recorded else list(log.truth())
    return phases(list(log.decisions()), truths)


def _print_course(log: Log, course: Sequence[Phase], console: Console) -> None:
    """Print the outcome, the phases, and what a failed stack left behind."""
    from wayproof.harness.clearance import true_in_metres
    from wayproof.harness.result import fate_of, referee_in_words, slowness_in_words

    outcome, reason = log.result["outcome"], log.result.get("reason", "")
    facts = [reason, referee_in_words(log.result)]
    if log.config.recording is None and "min_clearance_m" in log.result:
        facts.append(f"least clearance {true_in_metres(float(log.result['min_clearance_m']))}")
    took = statistics.median([fate_of(one).took_ms for one in log.decisions()] or [0.0])
    latency = log.config.latency
    facts.append(slowness_in_words(took, latency.deadline, modelled=latency.mode == "modelled"))
    console.print(f"{outcome}: {'; '.join(fact for fact in facts if fact)}; {log.path}")
    stderr = [f"stderr: {line}" for line in _last_lines(log)]
    for line in [*map(str, course), *log.traceback.splitlines(), *stderr]:
        console.print(f"  {line}")


def draw_episode(
    log: Log, case: Case | None, finding: Finding | None, target: Path, console: Console
) -> None:
    """Draw the decision of the cause, or the last one.

    Raises:
        InputError: The log has no sweeps.
    """
    from wayproof.harness.explain import make_card

    if case is None:
        raise InputError(f"log '{log.path}': no sweeps in it, so there is no map")
    number = len(case.moments) - 1 if finding is None else finding.decision
    case, navigator = case.as_of(number), case.navigator_at(number)
    _draw(log, case, make_card(case, number, navigator), navigator, target, console)


def _last_lines(log: Log) -> list[str]:
    """Return the last lines of a stack's standard error, if it failed and sent no traceback."""
    if log.result["outcome"] != "error" or log.traceback:
        return []
    return [line for line in log.stderr.splitlines() if line.strip()][-SHOWN_STDERR:]


def _why(log: Log) -> tuple[Case | None, Finding | None]:
    """Return case and cause; of a log without sweeps, the cause in its result alone."""
    from wayproof.harness.attribution import find_cause, read_case

    failed = log.result["outcome"] == "error"
    if log.record == "decisions" or (failed and next(iter(log.decisions()), None) is None):
        return None, _stored_cause(log)
    case = read_case(log)
    if log.config.recording is not None:
        return case, None  # without truth there is neither failure nor cause
    return case, _stored_cause(log) if failed else find_cause(case)


def _stored_cause(log: Log) -> Finding | None:
    """Return the cause stored by the run, at the contact or at the last place of the robot.

    Such is that of an `error` of a stack on trial: nothing in the log shows it again.
    """
    from wayproof.harness.attribution import Finding
    from wayproof.harness.result import Contact

    if not log.result.get("cause"):
        return None
    contact = Contact.from_text(log.result.get("contact", ""))
    places = [contact.position] if contact else [(*truth.position,) for truth in log.truth()]
    x, y, z = places[-1] if places else log.mission.start
    return Finding(
        cause=log.result["cause"],
        evidence=log.result["cause_evidence"],
        decision=int(log.result["cause_decision"]),
        place=(x, y, z),
    )


def _check(log: Log, finding: Finding | None, stack: str | None) -> Verdict:
    from wayproof.harness.counterfactual.check import check, refuse_success

    refuse_success(log)
    assert finding is not None
    return check(log, finding, stack=stack or "")


def _draw(
    log: Log, case: Case, card: Card, navigator: Navigator, target: Path, console: Console
) -> None:
    from wayproof.harness.viewer.top_view import draw_card

    draw_card(log, case, card, navigator, target)
    console.print(f"picture: {target}")


VERB = Verb(
    help="explain a decision, or an episode and why it failed; print metrics",
    add_arguments=arguments(
        arg("LOG", "log file, repeatable; after one log, N: number of a decision", nargs="+"),
        arg("--png FILE", "draw the decision, or that of the cause, into FILE", Path),
        arg("--check", "check the cause by simulating again with one thing corrected at a time"),
        arg(
            "--stack STACK",
            "stack that was on trial, run again",
            needs=["--check"],
        ),
        arg("--metrics", "print the metrics of each log instead, computed from it alone"),
        arg("--long", "print the formula and source of each metric as well", needs=["--metrics"]),
        shared.unchecked,
        shared.plugins,
    ),
    run=run,
    example="wayproof explain logs/warehouse-drone-3.mcap 42 --png moment.png",
)
