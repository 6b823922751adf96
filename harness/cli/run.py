"""`wayproof run`: run one episode and write its log."""

from __future__ import annotations

import argparse
import contextlib
import errno
import hashlib
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, point, warn
from wayproof.harness.errors import InputError, Interrupted

if TYPE_CHECKING:
    from wayproof.harness.config import Config, LatencyConfig
    from wayproof.harness.outputs import Draft
    from wayproof.harness.result import Result

SHOWN_LINES = 8
"""Number of last lines of a traceback that are printed."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Run one episode."""
    from wayproof.harness.config import BUILTIN
    from wayproof.harness.config_document import from_document, override, with_perturbation
    from wayproof.harness.perturbations import perturbation_from
    from wayproof.harness.scenario.robots import refuse_unused
    from wayproof.harness.scenario.worlds import refuse_other_worlds

    named = {"world": options.world, "robot": options.robot, "seed": options.seed}
    config = override(from_document(named), options.set)
    refuse_unused(config, [one.partition("=")[0] for one in options.set])
    refuse_other_worlds(config.world, options.set)
    if options.goal is not None:
        *waypoints, goal = (_goal(text) for text in options.goal)
        config = replace(config, goal=goal, waypoints=tuple(waypoints))
    if options.start is not None:
        config = replace(config, start=options.start)
    if options.perturb is not None:
        config = with_perturbation(config, perturbation_from(options.perturb))
    given = {"prior.source": options.prior, "stack.name": options.stack}
    config = override(
        config, [f"{key}={value}" for key, value in given.items() if value is not None]
    )
    if options.guard:
        if config.stack.name == BUILTIN:
            raise InputError("--guard: expected --stack; the built-in stack has no referee")
        config = replace(config, stack=replace(config.stack, guard=True))
    path = options.log or options.logs / f"{episode_name(config)}.mcap"
    if options.view is not None:
        from wayproof.harness.viewer.rerun_view import check_view

        if config.record != "full":
            raise InputError(f"--view: got record={config.record}, expected full")
        check_view(_saved(options.view))
    result = run_one(config, path, console, view=options.view)
    print_verdict(console, result, config.latency)
    checked = _check(result, options, console)
    code, document = (0 if result.outcome == "success" else 1), document_of(result)
    if checked is not None:
        document["check"] = checked
    return code, document


def _check(result: Result, options: argparse.Namespace, console: Console) -> Document | None:
    """Check the cause of a failure by simulation, and store the verdict in its log."""
    if options.check is None or result.outcome == "success":
        return None
    from wayproof.harness.attribution.case import read_case
    from wayproof.harness.attribution.procedure import find_cause
    from wayproof.harness.cli.cause_text import print_verdict as print_checked
    from wayproof.harness.counterfactual.check import check, refuse_success
    from wayproof.harness.counterfactual.verdict import record_check
    from wayproof.harness.log.reader import open_log

    log = open_log(Path(result.log), allow_plugins=True)
    refuse_success(log)
    finding = find_cause(read_case(log))
    assert finding is not None
    verdict = check(log, finding, thorough=False, most_s=options.check)
    record_check(log.path, verdict)
    print_checked(console, verdict)
    return asdict(verdict)


def _goal(text: str) -> tuple[float, ...] | str:
    """Read `X,Y`, `X,Y,Z` or the name of a place."""
    from wayproof.models.world_parameters import PLACES

    if text in PLACES:
        return text
    if text.replace("_", "").isalpha():
        places = ", ".join(sorted(PLACES))
        raise InputError(f"--goal {text}: expected X,Y or X,Y,Z, or a place: {places}")
    return point("--goal", text)


def episode_name(config: Config) -> str:
    """Return `world-robot-seed`, with eight digits of the config's hash if a setting differs."""
    from wayproof.harness.config import Config
    from wayproof.harness.config_document import to_json

    stem, robot = Path(config.world).stem, Path(config.robot).stem  # of files' paths
    name = f"{stem}-{robot}-{config.seed}"
    if config == Config(stem, robot, config.seed):
        return name
    return f"{name}-{hashlib.sha256(to_json(config)).hexdigest()[:8]}"


WINDOW = ""
"""Value of `--view` without a file."""


def _saved(view: str) -> Path | None:
    """Return the recording that `--view` names; None for a window."""
    return None if view == WINDOW else Path(view)


def run_one(config: Config, path: Path, console: Console, view: str | None = None) -> Result:
    """Build the scenario and run the episode with a live line.

    Kernels are loaded as they are called, unless wall time counts or the first ones had to be
    compiled.

    Args:
        config: Config of the episode.
        path: Name of the log.
        console: Console for the line.
        view: Value of `--view`; None for no view.

    Raises:
        InputError: The config cannot be run, or its log cannot be written; a full disk is named.
    """
    from wayproof.harness.cli.live import LiveLine
    from wayproof.harness.log.writer import hold_log, refuse_inputs
    from wayproof.harness.runner import run_episode
    from wayproof.harness.scenario.scenario import build
    from wayproof.harness.supervision import bound_memory
    from wayproof.harness.user_code import plugins_of
    from wayproof.kernel_cache import any_missed

    refuse_inputs(path, (config.prior.source, config.world, config.robot))
    bound_memory(config.plugins.memory_mib)
    scenario = build(config)
    for warning in scenario.warnings:
        warn(warning)
    line = LiveLine(console, config.robot)
    with hold_log(path) as draft:
        warn_of_kept(draft)
        try:
            if config.latency.mode == "measured" or plugins_of(config) or any_missed():
                from wayproof.harness.warm_up import warm_up  # wall time counts in the episode

                warm_up(config)
            with _viewed(draft, view, console), line:
                return run_episode(scenario, draft, line.observe)
        except KeyboardInterrupt:
            raise interrupted(path, line.decisions) from None
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG):
                raise
            text = f"log '{path}': {error.strerror}; what fitted is in .partial"
            raise InputError(text) from None


def _viewed(
    draft: Draft, view: str | None, console: Console
) -> contextlib.AbstractContextManager[None]:
    """Return the context in which an episode is shown while it runs, if `--view` is given."""
    if view is None:
        return contextlib.nullcontext()
    from wayproof.harness.cli.live import live_view

    return live_view(draft.path, _saved(view), console)


def warn_of_kept(draft: Draft) -> None:
    """Print where the unfinished log of an earlier run of the same name was moved to."""
    if draft.kept is not None:
        text = f"an unfinished log of an earlier run is kept as '{draft.kept}'"
        warn(f"{text}; 'wayproof export' reads it")


def interrupted(log: Path, decisions: int) -> Interrupted:
    """Return the interrupt whose message names the log left of an episode stopped by Ctrl-C."""
    partial = log.with_name(f"{log.name}.partial")
    if decisions == 0:
        partial.unlink(missing_ok=True)
        return Interrupted("nothing was decided yet, and no log is left")
    return Interrupted(f"the log so far: wayproof export {partial} --log {log}")


def document_of(result: Result) -> Document:
    """Return the document that `--json` prints of an episode."""
    from wayproof.harness.clearance import true_clearance_is_bound

    is_bound = true_clearance_is_bound(result.min_clearance_m)
    return {**asdict(result), "min_clearance_is_bound": is_bound}


def print_verdict(console: Console, result: Result, latency: LatencyConfig) -> None:
    """Print the verdict of an episode, and the cause of a failure."""
    from wayproof.harness.clearance import true_in_metres
    from wayproof.harness.result import referee_in_words

    style = "bold green" if result.outcome == "success" else "bold red"
    facts = [result.reason, referee_in_words(asdict(result))]
    if result.decisions:
        facts.append(f"least clearance {true_in_metres(result.min_clearance_m)}")
    facts.append(_slowness(result, latency))
    if result.decisions:
        facts.append(f"{result.decisions} decisions, {result.collisions} collisions")
    facts.append(
        f"{result.sim_time_s:.1f} s simulated in {result.wall_time_s:.1f} s, log "
        f"{result.log_mb_per_min:.1f} MB/min"
    )
    summary = ": " + "; ".join(fact for fact in facts if fact)
    console.print(Text.assemble((result.outcome, style), summary))
    if result.traceback:
        for line in result.traceback.splitlines()[-SHOWN_LINES:]:
            console.print(f"  {line}")
    if result.cause:
        line = f"cause: {result.cause}: {result.cause_evidence}"
        console.print(line)
    if result.cause or result.traceback:
        planner = result.traceback and not result.cause  # of a planner or controller of the user's
        allowed = " --allow-plugins" if planner else ""
        line = f"explain: wayproof explain {result.log}{allowed}"
        console.print(line)
    console.print(f"log: {result.log}  chain: {result.chain}")
    if not result.cause:
        verb = "view" if result.outcome == "success" else "explain"
        console.print(f"next: wayproof {verb} {result.log}")


def _slowness(result: Result, latency: LatencyConfig) -> str:
    from wayproof.harness.result import slowness_in_words

    modelled = latency.mode == "modelled"
    return slowness_in_words(result.decision_ms, latency.deadline, modelled=modelled)


VERB = Verb(
    help="run one episode and write its log",
    add_arguments=arguments(
        arg("WORLD", "name ('wayproof list') or world file"),
        arg("--robot ROBOT", "name ('wayproof list') or spec file", required=True),
        arg("--seed N", "seed of the world and of all randomness", int, required=True),
        arg(
            "--goal X,Y[,Z]",
            "goal, m, or a place: home, world or aisle (default: world, the world's own); given "
            "several times, one after the other",
            action="append",
        ),
        arg("--start X,Y[,Z]", "start, m (default: the world's)", partial(point, "--start")),
        shared.settings,
        shared.perturb,
        shared.prior,
        shared.stack,
        shared.log_file,
        arg(
            "--view FILE.rrd",
            "show the episode in the Rerun viewer while it runs, or write a recording for it",
            nargs="?",
            const=WINDOW,
        ),
        shared.check,
        shared.log_folder,
    ),
    run=run,
    example="wayproof run warehouse --robot drone --seed 3 --set map.resolution=0.05",
)
