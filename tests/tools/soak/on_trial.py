"""Planted faults of stacks on trial: the cause found, and all that a broken stack may do to us.

`python -m tests.tools.soak.on_trial --count 20` runs each kind of fault in the
registered worlds, as `wayproof run` does, half of those that can be a class behind `exec:`. Of each
episode: is the cause the planted one, is there no traceback, does no process outlive it, does it
end within its deadline, does its log replay, and can it be explained. An episode in which the fault
did no harm is drawn again.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.tools.soak.child import scratch
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


@dataclass(frozen=True)
class Drawn:
    """One episode with a fault."""

    kind: str
    seed: int
    outcome: str
    cause: str
    evidence: str
    check: str
    failures: tuple[str, ...]

    @property
    def right(self) -> bool:
        """Whether the cause is that of the fault."""
        return self.cause in KINDS[self.kind].causes and "audit" not in " ".join(self.failures)


@dataclass
class Tally:
    """Results of one kind."""

    drawn: list[Drawn] = field(default_factory=list)
    harmless: int = 0


def run_kind(kind: str, count: int, first: int, folder: Path) -> Iterator[Drawn | None]:
    """Yield each episode of a kind; None for one in which the fault did no harm."""
    for number in range(count):
        for draw in range(MOST_DRAWS):
            drawn = run_planted(kind, first + number + 1000 * draw, folder)
            yield drawn
            if drawn is not None:
                break


def run_planted(kind: str, seed: int, folder: Path) -> Drawn | None:
    """Run one episode with a fault, and all that reads its log; None if the fault did no harm."""
    log, mark, began = folder / f"{kind}-{seed}.mcap", uuid.uuid4().hex, time.monotonic()
    failures: list[str] = []
    text = _command(_words(kind, seed, log), mark, failures, expected=(0, 1))
    took_s = time.monotonic() - began
    failures += [f"orphan process {pid}" for pid in marked(mark)]
    if not log.is_file():
        return Drawn(kind, seed, "none", "", text[-200:], "", (*failures, "no log"))
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
    check = ""
    if outcome in CONTACT:
        check = _check(_command(["explain", str(log), "--check"], mark, failures))
        failures += _contradicted(log, cause)
    log.unlink()
    evidence = result.get("cause_evidence", "")
    return Drawn(kind, seed, outcome, cause, evidence, check, tuple(failures))


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


def _check(text: str) -> str:
    """Return the answer of a check."""
    last = next((line for line in text.splitlines() if line.startswith("check: ")), "")
    return next((word for word in ("confirmed", "changed", "inconclusive") if word in last), "none")


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


def table(tallies: dict[str, Tally]) -> Table:
    """Return a line for each kind."""
    lines = Table(
        "fault", "episodes", "drawn again", "cause right", "causes found", "check", "troubles"
    )
    for kind, tally in tallies.items():
        drawn = tally.drawn
        causes = Counter(one.cause or one.outcome for one in drawn)
        checks = Counter(one.check for one in drawn if one.check)
        lines.add_row(
            kind,
            str(len(drawn)),
            str(tally.harmless),
            str(sum(one.right for one in drawn)),
            ", ".join(f"{name} {n}" for name, n in causes.most_common()),
            ", ".join(f"{name} {n}" for name, n in checks.most_common()),
            str(sum(bool(one.failures) for one in drawn)),
        )
    return lines


def main() -> int:
    """Run the faults and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="episodes of each kind")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="of this kind only")
    options = parser.parse_args()
    console = Console(width=150, markup=False, highlight=False)
    tallies: dict[str, Tally] = {}
    with tempfile.TemporaryDirectory(dir=scratch()) as folder:
        for kind in options.kind or KINDS:
            tally = tallies.setdefault(kind, Tally())
            for drawn in run_kind(kind, options.count, options.first, Path(folder)):
                if drawn is None:
                    tally.harmless += 1
                    continue
                tally.drawn.append(drawn)
                mark = " " if drawn.right and not drawn.failures else "*"
                line = f"{mark} {kind} {drawn.seed}: {drawn.outcome}, {drawn.cause}, {drawn.check}"
                console.print(f"{line}: {drawn.evidence}", soft_wrap=True)
                sys.stdout.flush()
                for failure in drawn.failures:
                    console.print(f"    {failure}", soft_wrap=True)
    console.print(table(tallies))
    every = [one for tally in tallies.values() for one in tally.drawn]
    right = sum(one.right for one in every)
    troubled = sum(bool(one.failures) for one in every)
    console.print(f"{right} of {len(every)} causes right; {troubled} with troubles")
    return 1 if troubled or right < 0.95 * len(every) else 0


if __name__ == "__main__":
    sys.exit(main())
