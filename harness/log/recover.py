"""Making a valid log of what can be read of a broken one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from google.protobuf.message import Message

from wayproof.harness.ending import goal_distance
from wayproof.harness.errors import InputError, printable
from wayproof.harness.log.codec.container import Attachment, Metadata, Packet, walk
from wayproof.harness.log.codec.messages import decode, is_ours
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.reader import read_head
from wayproof.harness.log.writer import TRACEBACK
from wayproof.harness.mission import Mission
from wayproof.harness.outputs import ENDING
from wayproof.harness.result import RECOVERED, figures_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.user_code import plugins_of

PARTIAL_NAME = re.compile(rf"{re.escape(ENDING)}(\.\d+)?$")
"""How the name ends of a log that was not finished."""


@dataclass(frozen=True)
class Recovery:
    """What was made of a broken log.

    Attributes:
        log: The broken log's path.
        written: Of the new one; none if the log is whole, so that there was nothing to recover.
        decisions: That could be read, with all that belongs to each.
        sim_time_s: Simulated time of the last of them.
        damage: Where reading ended, and why; empty if the whole file could be read.
    """

    log: str
    written: str | None
    decisions: int
    sim_time_s: float
    damage: str


def recover(path: Path, target: Path | None = None, allow_plugins: bool = False) -> Recovery:
    """Write the readable part of a log as a log of its own.

    Of a log that is whole nothing is written, unless it has only its partial name: the process was
    killed before it could give the log its own. Then the copy is the log, with its result.

    Args:
        path: The broken log; it stays as it is.
        target: Name of the new one; by default the broken one's name with `-recovered`.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No such file, no whole decision in it, or the folder cannot be written to.
    """
    if not path.is_file():
        raise InputError(f"log '{path}': no such file")
    target = target or recovered_name(path)
    if target.resolve() == path.resolve():
        raise InputError(f"--out {target}: the log itself, expected another name")
    reading = _Reading(path)
    head = read_head(reading.items(), path, allow_plugins)
    decisions = len(reading.decisions)
    if not decisions:
        raise InputError(
            f"log '{path}': no whole decision in it ({reading.damage or 'at its end'})"
        )
    sim_time_s = reading.decisions[-1].timestamp.ToNanoseconds() * 1e-9
    result = None if reading.damage else head.metadata.get("result")
    if result is not None and not PARTIAL_NAME.search(path.name):
        return Recovery(str(path), None, decisions, sim_time_s, "")
    reason = f"{RECOVERED}{reading.damage or 'the log ends without a result'}"
    result = result or _result_of(reading, head.mission, reason)
    record = "full" if reading.sweeps else "decisions"
    write_copy(target, head, reading.whole_decisions(), result, record)
    return Recovery(str(path), str(target), decisions, sim_time_s, reading.damage)


def _result_of(reading: _Reading, mission: Mission, reason: str) -> dict[str, str]:
    """What is known of an episode up to its last whole decision, if there is one."""
    decisions, truths = reading.decisions, reading.truths
    result: dict[str, object] = {"outcome": "error", "reason": reason, "decisions": len(decisions)}
    result |= {"sim_time_s": 0.0, "chain": ""}
    if not decisions:
        return {name: str(value) for name, value in result.items()}
    last = truths[-1]
    result |= {
        "goal_distance_m": goal_distance(mission, np.array(last.position)),
        "sim_time_s": decisions[-1].timestamp.ToNanoseconds() * 1e-9,
        "collisions": last.collisions,
        "struck": last.hit_by_mover,
        **figures_of(decisions, truths),
        "route_length_m": None,
        "chain": decisions[-1].chain,
    }
    return {name: str(value) for name, value in result.items()}


def finish_partial(partial: Path, target: Path, what: str, traceback: str) -> tuple[str, int]:
    """Make a whole log, with the outcome `error`, of one whose process ended without finishing it.

    Args:
        partial: What that process wrote; it is gone afterwards.
        target: Name of the whole log.
        what: What became of the process, after its name.
        traceback: Printable lines that tell more; may be empty.

    Returns:
        The reason, as the log has it, and the decisions in it; there may be none.

    Raises:
        InputError: There is no such file, its head is not whole, or the folder cannot be written.
    """
    if not partial.is_file():
        raise InputError(f"log '{partial}': no such file")
    source = partial.with_name(f"{partial.name}.ended")  # the copy is written by the other name
    partial.replace(source)
    reading = _Reading(source)
    head = read_head(reading.items(), source, allow_plugins=True)
    who = ", ".join(plugins_of(head.config)) or head.config.robot
    decisions = len(reading.decisions)
    reason = printable(f"{who}: the process {what} after {decisions} decisions")
    result = _result_of(reading, head.mission, reason)
    if traceback:
        head.attachments[TRACEBACK] = traceback.encode()
    record = "full" if reading.sweeps or not decisions else "decisions"
    write_copy(target, head, reading.whole_decisions(), result, record)
    source.unlink()
    return reason, decisions


def recovered_name(path: Path) -> Path:
    """`run.mcap.partial` becomes `run-recovered.mcap`, and `.partial.2` `run-recovered-2.mcap`."""
    stem, _, number = path.name.partition(f"{ENDING}.")
    stem = stem.removesuffix(ENDING).removesuffix(".mcap")
    return path.with_name(f"{stem}-recovered{number and '-'}{number}.mcap")


class _Reading:
    """Passes over a broken file that end where it breaks, and count what is whole before."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damage = ""
        self.sweeps = 0
        self.decisions: list[pb.Decision] = []  # each with its truth
        self.truths: list[pb.Truth] = []

    def items(self) -> Iterator[Attachment | Metadata | Packet]:
        """Everything up to the damage, counted on the way."""
        decision = None
        for item in self._sound():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if isinstance(message, pb.Decision):
                    decision = message
                elif isinstance(message, pb.Truth) and decision is not None:
                    self.decisions.append(decision)
                    self.truths.append(message)
                    decision = None
                self.sweeps += isinstance(message, pb.Sweep)
            yield item

    def whole_decisions(self) -> Iterator[Message]:
        """Messages up to the last decision and its truth."""
        last = self.decisions[-1].sequence if self.decisions else 0
        for item in self._sound():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if getattr(message, "sequence", 0) > last:
                    return
                yield message

    def _sound(self) -> Iterator[Attachment | Metadata | Packet]:
        try:
            yield from walk(self._path)
        except InputError as error:
            self.damage = str(error).partition("': ")[2]
