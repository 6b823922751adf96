"""Planted faults of stacks on trial: the cause found, and all that a broken stack may do to us.

Each kind of fault runs in the registered worlds, as `wayproof run` does, half of those that can be
a class behind `exec:`. Of each episode: is the cause the planted one, is there no traceback, does
no process outlive it, does it end within its deadline, does its log replay, and can it be
explained. An episode in which the fault did no harm is drawn again.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.tools.faults.judged import Judged
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit

MODULE = "tests.tools.faults.faulty_stacks"
GARBAGE = f"exec:{sys.executable} -m tests.tools.faults.garbage_stack"

WALL_S = 5.0
"""`plugins.wall_s` of all episodes: wall time after which a stack is taken to hang, s."""

GRACE_S = 60.0
"""Wall time that starting and ending a stack and attributing its failure may take besides, s."""

LONGEST_S = 300.0
"""Wall time after which a command is killed: it hangs itself, s."""

QUICK = ("episode.time_limit=15", "episode.stuck_after=3", f"plugins.wall_s={WALL_S:g}")

ROOMS = ("cylinders", "forest", "office", "warehouse", "maze", "corridor")
MARK = "WAYPROOF_PLANTED"
"""Environment variable by which processes of an episode are recognized."""

MOST_DRAWS = 12
"""Number of seeds that are tried for one episode in which the fault does harm."""


@dataclass(frozen=True)
class Kind:
    """A kind of fault."""

    stack: str
    outcomes: tuple[str, ...]
    causes: tuple[str, ...]
    remote: bool = False
    worlds: tuple[str, ...] = ("empty", "cylinders")
    settings: tuple[str, ...] = ()


CONTACT = ("collision", "out_of_bounds")
STOOD = ("stuck", "timeout")

KINDS = {
    "into_mapped": Kind("IntoReturns", CONTACT, ("disregarded_obstacle",), worlds=ROOMS),
    "into_unknown": Kind(
        "IntoTheUnknown", CONTACT, ("unseen_obstacle",),
        worlds=ROOMS, settings=("map.minimum_range=4",),
    ),
    "wrong_frame": Kind(
        "WrongFrame", CONTACT, ("disregarded_obstacle", "unseen_obstacle"), worlds=ROOMS
    ),
    "answers_late": Kind(
        "AnswersLate", STOOD, ("plugin_failed",),
        settings=("latency.mode=measured", "latency.deadline=0.2"),
    ),
    "dies": Kind("Dies", ("error",), ("plugin_failed",), remote=True),
    "hangs": Kind("Hangs", ("error",), ("plugin_failed",), remote=True),
    "not_a_number": Kind("NotANumber", ("error",), ("plugin_failed",)),
    "starts_elsewhere": Kind("StartsElsewhere", ("error",), ("plugin_failed",)),
    "floods_stderr": Kind("FloodsStderr", ("error",), ("plugin_failed",), remote=True),
    "garbage": Kind("", ("error",), ("plugin_failed",), remote=True),
}  # fmt: skip
"""Kinds of faults. A stack in the wrong frame goes anywhere, so what is right of it is what an
audit of its last second says: through occupied space, or through unknown."""


def judge_kind(kind: str, count: int, first: int, folder: Path) -> Iterator[Judged]:
    """Yield episodes of a kind in which the fault did harm."""
    for number in range(first, first + count):
        drawn = (run_planted(kind, number + 1000 * draw, folder) for draw in range(MOST_DRAWS))
        yield from itertools.islice((one for one in drawn if one is not None), 1)


def run_planted(kind: str, seed: int, folder: Path) -> Judged | None:
    """Run one episode with a fault, and all that reads its log; None if the fault did no harm."""
    log, mark, began = folder / f"{kind}-{seed}.mcap", uuid.uuid4().hex, time.monotonic()
    failures: list[str] = []
    text = _command(_words(kind, seed, log), mark, failures, expected=(0, 1))
    took_s = time.monotonic() - began
    failures += [f"orphan process {pid}" for pid in marked(mark)]
    if not log.is_file():
        return Judged(kind, (), "none", seed, "none", text[-200:], (*failures, "no log"))
    result = open_log(log).result
    outcome, cause = result["outcome"], result.get("cause", "")
    if outcome not in KINDS[kind].outcomes and not failures:
        log.unlink()
        return None
    if kind == "hangs" and took_s > WALL_S + GRACE_S:
        failures.append(f"took {took_s:.1f} s, and hung for {WALL_S:g} s")
    _command(["replay", str(log)], mark, failures)
    if "cause: " not in _command(["explain", str(log)], mark, failures):
        failures.append("explain: no cause")
    said = result.get("cause_evidence", "")
    if outcome in CONTACT:
        checked = _command(["explain", str(log), "--check"], mark, failures).splitlines()
        said = " ".join([said, *(line for line in checked if line.startswith("check: "))])
        failures += _contradicted(log, cause)
    log.unlink()
    return Judged(kind, KINDS[kind].causes, cause or outcome, seed, outcome, said, tuple(failures))


def _words(kind: str, seed: int, log: Path) -> list[str]:
    """Return words of the command that runs an episode."""
    planted = KINDS[kind]
    rng = np.random.default_rng([seed, *kind.encode()])
    world = planted.worlds[int(rng.integers(len(planted.worlds)))]
    stack = f"{MODULE}:{planted.stack}" if planted.stack else GARBAGE
    if planted.stack and (planted.remote or seed % 2):
        stack = f"exec:{sys.executable} -m wayproof serve {stack}"
    settings = [word for one in (*QUICK, *planted.settings) for word in ("--set", one)]
    robot = ("drone", "quadruped")[int(rng.integers(2))]
    head = ["run", world, "--robot", robot, "--seed", str(seed), "--stack", stack]
    return [*head, "--log", str(log), *settings]


def _command(
    words: list[str], mark: str, failures: list[str], expected: tuple[int, ...] = (0,)
) -> str:
    """Run a command and return its output; add what is wrong with its end to the failures."""
    with tempfile.TemporaryFile("w+", errors="replace") as printed:
        try:
            code = subprocess.run(
                [sys.executable, "-m", "wayproof", *words],
                env={**os.environ, MARK: mark},
                stdout=printed,
                stderr=subprocess.STDOUT,
                timeout=LONGEST_S,
                check=False,
            ).returncode
        except subprocess.TimeoutExpired:
            code = -signal.SIGKILL
        printed.seek(0)
        text = printed.read()
    if code not in expected:
        failures.append(f"{words[0]}: exit code {code}: {text[-200:]}")
    if "Traceback" in text:
        failures.append(f"{words[0]}: a traceback: {text[-200:]}")
    return text


def marked(mark: str) -> list[int]:
    """Process ids that have this mark in their environment, a moment after the end."""
    time.sleep(0.05)
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"{MARK}={mark}".encode() in path.read_bytes().split(b"\0"):
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def _contradicted(log: Path, cause: str) -> Iterator[str]:
    """Say that an audit of the last second contradicts a cause."""
    decisions = int(open_log(log).result["decisions"])
    last = [
        one.text for one in audit(log).violations
        if one.rule == "swept" and one.sequence >= decisions - 10
    ]  # fmt: skip
    word = {"disregarded_obstacle": ("occupied", "outside"), "unseen_obstacle": ("unknown",)}
    if cause in word and not any(one in text for text in last for one in word[cause]):
        yield f"audit: nothing of {' or '.join(word[cause])} space in the last second"
