"""Making a valid log of what can be read of a broken one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import Message

from harness.errors import InputError, printable
from harness.logs.container import Attachment, Metadata, Packet, walk
from harness.logs.log import TRACEBACK
from harness.logs.log_copy import write_copy
from harness.logs.messages import decode, is_ours
from harness.logs.reader import read_head
from harness.outputs import ENDING
from harness.schema import wayproof_pb2 as pb
from harness.user_code import plugins_of


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
    reason = printable(f"{who}: the process {what} after {reading.complete} decisions")
    result = {
        "outcome": "error",
        "reason": reason,
        "sim_time_s": str(reading.last.timestamp.ToNanoseconds() * 1e-9),
        "decisions": str(reading.complete),
        "deadline_misses": str(reading.misses),
        "chain": reading.last.chain,
    }
    if traceback:
        head.attachments[TRACEBACK] = traceback.encode()
    record = "full" if reading.sweeps or not reading.complete else "decisions"
    write_copy(target, head, reading.whole_decisions(), result, record)
    source.unlink()
    return reason, reading.complete


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
