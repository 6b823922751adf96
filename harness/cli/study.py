"""`wayproof study`: run many paired episodes and judge them by gates."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.engine_options import Watch, add_engine, check_engine, open_engine
from wayproof.harness.cli.verb import Document, Verb, arg, arguments
from wayproof.harness.errors import InputError, Interrupted

if TYPE_CHECKING:
    from wayproof.harness.study.analysis import ArmSummary
    from wayproof.harness.study.determinism import Certificate
    from wayproof.harness.study.file import StudyFile
    from wayproof.harness.study.plan import Planned
    from wayproof.harness.study.result import StudyResult
    from wayproof.harness.study.store import Store
    from wayproof.harness.study.study import Engine

SHOWN_FOREIGN = 10
"""Maximum number of lines about logs of other episodes; `--json` has all."""

ACTION = "./wayproof"
"""Where a workflow finds the action unless it is named."""

VERDICT_STYLES = {
    "complete": "green",
    "held": "green",
    "failed": "bold red",
    "inconclusive": "yellow",
    "incomplete": "bold red",
}


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Run a study, or continue it."""
    from wayproof.harness.study.file import read_study
    from wayproof.harness.study.looks import continued, run_until_decided, saved_in_words
    from wayproof.harness.study.plan import plan_episodes
    from wayproof.harness.study.store import Store, merge
    from wayproof.harness.study.study import shard

    if options.new:
        return _new(options, console)
    check_engine(options)
    if options.sample < 1:
        raise InputError(f"--sample {options.sample}: expected at least 1")
    study = read_study(options.file, options.allow_plugins, options.set)
    if study.recordings and options.check is not None:
        raise InputError("--check: of simulated episodes, got a study over recordings")
    if study.searches and (options.check is not None or options.merge):
        raise InputError(f"--check, --merge: of planned episodes, got a study of {study.kind}")
    if options.until_decided and (options.shard or options.merge or options.check is not None):
        raise InputError("--until-decided: of a whole study, got --shard, --merge or --check")
    store = Store(options.out or shared.LOGS / study.folder)
    if not options.until_decided:
        study = _going_on(console, study, continued(study, store))
    whole = [] if options.until_decided else plan_episodes(study)
    planned = shard(whole, options.shard) if options.shard else whole
    if options.merge:
        with store.open():
            copied = merge(store, options.merge, whole, options.allow_plugins)
        console.print(f"{copied} episodes copied to {store.folder}")
    if options.retry_errors:
        store.forget_errors()
    with open_engine(options, study.bounds) as engine:
        run_one = partial(_run, options, console, store, engine)
        if options.until_decided:
            result = run_until_decided(study, store, options.at_most, options.jobs, run_one)
            planned = plan_episodes(store.read_study(allow_plugins=True))
        else:
            result = run_one(study, planned)
    print_study(console, result)
    if options.until_decided:
        console.print(saved_in_words(study, result, options.at_most))
    if options.check is not None:
        console.print(f"causes checked: {options.tally}")
    console.print(f"next: wayproof report {store.folder}")
    document = {**asdict(result), "verdict": result.verdict, "folder": str(store.folder)}
    code = result.exit_code(options.allow_inconclusive)
    if not options.check_determinism:
        return code, document
    certificate = _certify(options, console, study, planned, store)
    code = code if certificate.identical else 1
    return code, {**document, "determinism": asdict(certificate)}


def _new(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write a study file and a workflow in the working folder."""
    from wayproof.harness.study.file import read_study, seeds_of
    from wayproof.harness.study.new import write_new

    file, workflow = write_new(options.file, options.set, options.action, Path())
    seeds = len(seeds_of(read_study(str(file), allow_plugins=True)))
    console.print(f"{file}: {seeds} seeds; {workflow}: runs it for every pull request")
    if options.action == ACTION:
        console.print(f"{ACTION} is a copy of Wayproof: git submodule add ADDRESS {ACTION}")
    console.print(f"next: wayproof study {file} --allow-plugins", soft_wrap=True)
    return 0, {"study": str(file), "workflow": str(workflow), "seeds": seeds}


def _going_on(console: Console, study: StudyFile, going_on: StudyFile) -> StudyFile:
    """Say where a study continues from a look at it, and return it."""
    if going_on.sequential and not study.sequential:
        console.print(
            "seeds were added after a look at the gates, which are now sequential from their first "
            "seed on: they may be looked at after any"
        )
    return going_on


def _run(
    options: argparse.Namespace,
    console: Console,
    store: Store,
    engine: Engine,
    study: StudyFile,
    planned: Sequence[Planned],
) -> StudyResult:
    """Run the missing episodes of a study and judge it."""
    from wayproof.harness.study.kept import kept_in_words
    from wayproof.harness.study.study import count_missing, run_study

    missing = count_missing(planned, store)
    console.print(
        f"study {study.name}: {len(planned)} episodes, {missing} to run, {options.jobs} at a time;"
        f" logs in {store.folder}"
    )
    for line in kept_in_words(planned, store):
        console.print(line)
    with Watch(console, None if study.searches else len(planned), missing) as watch:
        checks = _checks(options, planned, store)
        try:
            return run_study(study, planned, store, engine, watch.finished, checks)
        except KeyboardInterrupt:
            raise kept(len(planned) - count_missing(planned, store), len(planned)) from None


def kept(done: int, episodes: int) -> Interrupted:
    """Return the interrupt whose message says how much of a study is kept."""
    return Interrupted(
        f"{done} of {episodes} episodes are kept, and the same command runs the others"
    )


def _checks(
    options: argparse.Namespace, planned: Sequence[Planned], store: Store
) -> Callable[[], None] | None:
    """Return the function that checks the causes of failures; None without `--check`."""
    if options.check is None:
        return None
    from wayproof.harness.study.checks import check_failures

    def run_checks() -> None:
        options.tally = check_failures(planned, store, options.check, allow_plugins=True)

    return run_checks


def _certify(
    options: argparse.Namespace,
    console: Console,
    study: StudyFile,
    planned: Sequence[Planned],
    store: Store,
) -> Certificate:
    """Run a sample of the episodes again in other arrangements of processes."""
    from wayproof.harness.study.determinism import ARRANGEMENTS, FILE, certify

    with Watch(console, None) as watch:
        certificate = certify(
            study.name, planned, store, study.bounds, watch.finished, options.sample
        )
    differing = [one for one in certificate.reruns if not one.identical]
    for one in differing:
        rerun = f": {one.key}, {one.arrangement}: {one.error or f'chain {one.chain}'}"
        console.print(Text.assemble(("differs", "bold red"), rerun))
    verdict = f"{len(differing)} differ" if differing else "all are identical"
    console.print(
        f"determinism: {len(certificate.sample)} episodes run again in {len(ARRANGEMENTS)} other "
        f"ways: {verdict}; certificate {store.folder / FILE}"
    )
    return certificate


def print_study(console: Console, result: StudyResult) -> None:
    """Print each arm in two lines, then the gates and the verdict."""
    from wayproof.harness.study.gates import gate_in_words
    from wayproof.harness.study.lost import lost_in_words
    from wayproof.harness.study.plan import name_of
    from wayproof.harness.study.study import verdict_in_words

    for one in result.arms:
        console.print(name_of(one.arm), style="bold")
        console.print(f"  {_arm_in_words(one)}")
    if len(result.arms) > 1:
        console.print("each interval of an arm alone holds at 95 %, not all of them together")
    for gate in result.gates:
        line = Text.assemble(
            (gate.verdict, VERDICT_STYLES[gate.verdict]), f": {gate_in_words(gate)}"
        )
        console.print(line)
    for change in [one for one in result.changes if one.side]:
        side = "worse" if change.side == "bad" else "better"
        style = "bold red" if change.side == "bad" else "green"
        console.print(Text.assemble((side, style), f": {change.in_words()}"))
    for text in lost_in_words(result.lost):
        console.print(text)
    for answer in result.answers:
        console.print(name_of(answer.arm), style="bold")
        for text in answer.in_words().splitlines():
            console.print(f"  {text}")
    print_foreign(console, result)
    verdict = (result.verdict, VERDICT_STYLES[result.verdict])
    line = Text.assemble("verdict: ", verdict, f": {verdict_in_words(result)}")
    console.print(line)


def print_foreign(console: Console, result: StudyResult) -> None:
    """Print the logs that are not of the planned episodes."""
    for line in result.foreign[:SHOWN_FOREIGN]:
        console.print(line)
    if len(result.foreign) > SHOWN_FOREIGN:
        console.print(f"and {len(result.foreign) - SHOWN_FOREIGN} more logs of other episodes")


def _arm_in_words(one: ArmSummary) -> str:
    from wayproof.harness.study.gates import interval_in_words

    rate, against = one.success, one.against
    failures = [f"{n} {name}" for name, n in one.outcomes.items() if name != "success"]
    text = (
        f"{one.episodes} episodes, success {interval_in_words(rate, '.2f')}, 95 %, "
        f"{one.mean_time:.1f} s" + "".join(f", {failure}" for failure in failures)
    )
    if against is None:
        return text
    return (
        f"{text}; drop {interval_in_words(against.drop, '+.2f')}, 95 %, "
        f"p {against.p_adjusted:.3f}, lost {len(against.lost)}, won "
        f"{len(against.won)}, acted otherwise in {against.changed} of {against.pairs}, "
        f"inputs as declared in {against.proven}"
    )


VERB = Verb(
    help="run many paired episodes and judge them by gates",
    add_arguments=arguments(
        arg("FILE", "study file (TOML) or name of a packaged study"),
        arg(
            "--set NAME=VALUE",
            "a field of the study, as seeds=4, worlds=office,maze, kind=threshold or "
            "falsify.budget=20, or a setting of its episodes; repeatable",
            default=[],
            action="append",
        ),
        arg(
            "--out FOLDER",
            "folder of the study (default: logs/NAME, with the kind behind it)",
            Path,
        ),
        arg("--new", "run nothing; write the study, with --set, as a file here, and a workflow"),
        arg("--action WHERE", "action of the workflow", default=ACTION, needs=["--new"]),
        arg("--shard I/N", "run only the I-th of N parts"),
        arg("--merge FOLDER", "copy finished episodes from other folders", Path, nargs="+"),
        arg("--until-decided", "add seeds until every gate is held or one fails, then stop"),
        arg("--at-most N", "greatest number of seeds for --until-decided", int, 300),
        arg("--retry-errors", "run episodes again that ended in an error"),
        arg(
            "--check-determinism",
            "run a sample again in other processes and orders; write a certificate",
        ),
        arg("--sample N", "number of episodes run again", int, 8, needs=["--check-determinism"]),
        shared.inconclusive,
        shared.check,
        add_engine,
        shared.plugins,
    ),
    run=run,
    example="wayproof study smoke",
)
