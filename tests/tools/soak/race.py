"""Soak of two runs that write the same log: one must be refused, the other's log complete."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.tools.soak.child import Ended, listen, scratch, start_child
from wayproof.harness.bench.table import Progress
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.outputs import ENDING
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up

SETTING = "episode.time_limit=0.5"
SILENCE_S = 60.0
REFUSAL = "another run is writing it, expected a name of its own for each"

Report = Callable[[str], None]


@dataclass(frozen=True)
class Raced:
    """Results of races.

    Attributes:
        count: Number of rounds, of two runs each.
        refused: Number of runs that ended with exit code 2 and one line.
        first_won: Number of rounds whose log is that of the run that was started first.
        second_won: Number of rounds whose log is that of the other run.
        decisions: Number of decisions in the logs, all of them compared.
        failures: Broken guarantees; empty without any.
    """

    count: int
    refused: int
    first_won: int
    second_won: int
    decisions: int
    failures: tuple[str, ...]


def soak_race(count: int, seed: int, progress: Progress, first: int = 0) -> Raced:
    """Start two episodes for one log `count` times; both wait for each other before they open it.

    Args:
        count: Number of rounds.
        seed: Seed of the first run; the second run has the next one.
        progress: Called with a line about the progress.
        first: Number of the first round.
    """
    seeds = (seed, seed + 1)
    warm_up(override(Config("empty", "drone", seed), (SETTING,)))
    expected = [_chains_of(one) for one in seeds]
    won, refused, decisions = [0, 0], 0, 0
    failures: list[str] = []
    for number in range(first, first + count):
        with tempfile.TemporaryDirectory(dir=scratch()) as name:
            path = Path(name) / "raced.mcap"
            # By turns, since the one that is released first has a little of a start.
            order = seeds if number % 2 == 0 else seeds[::-1]
            ended = _race(path, order)
            wrong = _faults(ended)
            refused += sum(one.code == 2 for one in ended)
            try:
                winner, chains = _read(path)
            except InputError as error:
                wrong.append(str(error))
            else:
                won[order.index(winner)] += 1
                decisions += len(chains)
                if chains != expected[seeds.index(winner)]:
                    wrong.append(f"{len(chains)} decisions, not those of the episode")
                if not wrong and ended[order.index(winner)].code == 2:
                    wrong.append("the log is that of the run that was refused")
            wrong += [f"{one} left" for one in sorted(os.listdir(name)) if one != path.name]
        failures += [f"round {number}: {one}" for one in wrong]
        if (number + 1) % 20 == 0:
            progress(f"race: up to {number + 1}, {len(failures)} failures")
    return Raced(
        count=count,
        refused=refused,
        first_won=won[0],
        second_won=won[1],
        decisions=decisions,
        failures=tuple(failures),
    )


def _chains_of(seed: int) -> list[str]:
    """Return the chain after each decision of an undisturbed episode."""
    with tempfile.TemporaryDirectory(dir=scratch()) as folder:
        path = Path(folder) / "alone.mcap"
        run_episode(build(override(Config("empty", "drone", seed), (SETTING,))), path)
        return _read(path)[1]


def _read(path: Path) -> tuple[int, list[str]]:
    """Return the seed and the chains of a log, with its checksums verified.

    Raises:
        InputError: The log is not complete.
    """
    log = open_log(path)
    found = [one.chain for one in read_messages(path) if isinstance(one, pb.Decision)]
    if not found or log.result["chain"] != found[-1]:
        raise InputError(f"log '{path}': its result is of other decisions")
    return log.config.seed, found


def _race(path: Path, seeds: tuple[int, int]) -> list[Ended]:
    """Run both, each held when it opens the partial file until the other does as well."""
    here, there = os.pipe(), os.pipe()  # a byte by each that waits; closed when both may go on

    def started(seed: int) -> tuple[int, int]:
        def work(report: Report) -> None:
            os.close(there[1])
            _run(path, seed, lambda: _wait(here[1], there[0]), report)

        return start_child(work)

    children = [started(seed) for seed in seeds]
    os.close(here[1])
    os.close(there[0])
    waiting = 0
    while waiting < len(seeds) and os.read(here[0], 1):  # nothing: one of them ended before
        waiting += 1
    os.close(there[1])
    os.close(here[0])
    ended = [listen(*child, SILENCE_S) for child in children]
    if waiting < len(seeds):
        raise InputError(f"only {waiting} runs came to open the log: {[e.lines for e in ended]}")
    return ended


def _wait(here: int, there: int) -> None:
    os.write(here, b".")
    os.read(there, 1)


def _run(path: Path, seed: int, wait: Callable[[], None], report: Report) -> None:
    """Run `wayproof run` as from the command line; end the process with its exit code."""
    partial = str(path) + ENDING
    waited = False

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal waited
        if event == "open" and not waited and str(arguments[0]) == partial:
            waited = True
            wait()

    sys.addaudithook(hook)
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()) as said,
    ):
        arguments = ["run", "empty", "--robot", "drone", "--seed", str(seed), "--set", SETTING]
        code = main([*arguments, "--log", str(path)])
    for line in said.getvalue().splitlines():
        report(line)
    os._exit(code)


def _faults(ended: list[Ended]) -> list[str]:
    """Return the faults: one run must be refused in a line, the other must end in silence."""
    wrong = []
    codes = sorted(one.code for one in ended)
    if codes[1] != 2 or codes[0] not in (0, 1):
        wrong.append(f"exit codes {codes}, expected one refusal")
    for one in ended:
        if one.overdue or (one.code == 2 and not _is_refusal(one.lines)):
            wrong.append(f"exit code {one.code} with {len(one.lines)} lines: {one.lines[:3]}")
    return wrong


def _is_refusal(lines: tuple[str, ...]) -> bool:
    return len(lines) == 1 and REFUSAL in lines[0]
