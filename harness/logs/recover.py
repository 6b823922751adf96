"""Making a valid log of what can be read of a broken one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import Message

from harness.errors import InputError
from harness.logs.container import Attachment, Metadata, Packet, walk
from harness.logs.log_copy import write_copy
from harness.logs.messages import decode, is_ours
from harness.logs.reader import read_head
from harness.outputs import ENDING
from harness.schema import wayproof_pb2 as pb


@dataclass(frozen=True)
class Recovery:
    """What was made of a broken log.

    Attributes:
        log: The broken log's path.
        written: Of the new one.
        decisions: That could be read, with all that belongs to each.
        sim_time_s: Simulated time of the last of them.
        damage: Where reading ended, and why; empty if the whole file could be read.
    """

    log: str
    written: str
    decisions: int
    sim_time_s: float
    damage: str


def recover(path: Path, target: Path | None = None, allow_plugins: bool = False) -> Recovery:
    """Write the readable part of a log as a log of its own.

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
    if not reading.complete:
        raise InputError(
            f"log '{path}': no whole decision in it ({reading.damage or 'at its end'})"
        )
    last = reading.last
    missed = reading.misses
    result = {
        "outcome": "error",
        "reason": f"recovered: {reading.damage or 'the log ends without a result'}",
        "sim_time_s": str(last.timestamp.ToNanoseconds() * 1e-9),
        "decisions": str(reading.complete),
        "deadline_misses": str(missed),
        "chain": last.chain,
    }
    record = "full" if reading.sweeps else "decisions"
    write_copy(target, head, reading.whole_decisions(), {**reading.result, **result}, record)
    return Recovery(
        str(path), str(target), reading.complete, float(result["sim_time_s"]), reading.damage
    )


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
        self.complete = 0
        self.misses = 0
        self.sweeps = 0
        self.last = pb.Decision()
        self.result: dict[str, str] = {}

    def items(self) -> Iterator[Attachment | Metadata | Packet]:
        """Everything up to the damage, counted on the way."""
        for item in self._sound():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if isinstance(message, pb.Decision):
                    self.complete += 1
                    self.misses += message.deadline_missed
                    self.last = message
                self.sweeps += isinstance(message, pb.Sweep)
            yield item

    def whole_decisions(self) -> Iterator[Message]:
        """Messages up to the last decision and its truth."""
        for item in self._sound():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if getattr(message, "sequence", 0) > self.last.sequence:
                    return
                yield message

    def _sound(self) -> Iterator[Attachment | Metadata | Packet]:
        try:
            yield from walk(self._path)
        except InputError as error:
            self.damage = str(error).partition("': ")[2]
