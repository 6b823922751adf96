"""Recovery of a valid log from the readable part of a broken one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from google.protobuf.message import Message

from wayproof.harness.errors import InputError, printable
from wayproof.harness.goals import distance_left, goals_before_last
from wayproof.harness.log.codec.container import Attachment, Metadata, Packet, walk
from wayproof.harness.log.codec.messages import decode, is_ours
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import check_readable, read_head
from wayproof.harness.log.writer import TRACEBACK
from wayproof.harness.mission import Mission
from wayproof.harness.outputs import ENDING
from wayproof.harness.result import RECOVERED, figures_of, recorded_figures
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.user_code import plugins_of

PARTIAL_NAME = re.compile(rf"{re.escape(ENDING)}(\.\d+)?$")
"""Ending of the name of an unfinished log."""


class Recovery(NamedTuple):
    """Outcome of the recovery of a broken log.

    Attributes:
        decisions: Number of decisions that could be read completely.
        sim_time_s: Simulated time of the last of them, s.
        damage: Place and cause of the damage.
    """

    decisions: int
    sim_time_s: float
    damage: str


def recover(path: Path, target: Path, allow_plugins: bool = False) -> Recovery:
    """Write the readable part of a log as a log of its own.

    A log that is whole but for its name, because the process was killed before the rename, is
    copied with its result.

    Args:
        path: The broken log; its bytes are left unchanged. One whose name the new log has while it
            is written is renamed to end in `.ended`.
        target: Name of the new log.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No such file, or it may not be read; the log is whole; no whole decision in it,
            or the folder cannot be written to.
    """
    check_readable(path)
    if target.resolve() == path.resolve():
        raise InputError(f"--log {target}: the log itself, expected another name")
    if target.with_name(f"{target.name}{ENDING}").resolve() == path.resolve():
        path = path.rename(path.with_name(f"{path.name}.ended"))  # the copy is written by its name
    reading = _Reading(path)
    head = read_head(reading.items(), path, allow_plugins)
    damage = reading.damage or "the log ends without a result"
    decisions = len(reading.decisions)
    if not decisions:
        raise InputError(
            f"log '{path}': no whole decision in it ({reading.damage or 'at its end'})"
        )
    result = None if reading.damage else head.metadata.get("result")
    if result is not None and not PARTIAL_NAME.search(path.name.removesuffix(".ended")):
        raise InputError(f"log '{path}': whole, nothing to recover")
    result = result or _result_of(reading, head.mission, f"{RECOVERED}{damage}")
    record = "full" if reading.sweeps else "decisions"
    write_copy(target, head, messages=reading.whole_decisions(), result=result, record=record)
    return Recovery(decisions, reading.decisions[-1].timestamp.ToNanoseconds() * 1e-9, damage)


def _result_of(reading: _Reading, mission: Mission, reason: str) -> dict[str, str]:
    """Return the figures of an episode up to its last complete decision, if there is one."""
    decisions, truths = reading.decisions, reading.truths
    result: dict[str, object] = {"outcome": "error", "reason": reason, "decisions": len(decisions)}
    result |= {"sim_time_s": 0.0, "chain": ""}
    if reading.motions:
        result |= recorded_figures(decisions, reading.motions)
    elif decisions:
        last, reached = truths[-1], goals_before_last(decisions)
        result |= {
            "goal_distance_m": distance_left(mission, reached, np.array(last.position)),
            "sim_time_s": decisions[-1].timestamp.ToNanoseconds() * 1e-9,
            "collisions": last.collisions,
            "struck": last.hit_by_mover,
            **figures_of(decisions, truths),
            "route_length_m": None,
            "chain": decisions[-1].chain,
        }
    return {name: str(value) for name, value in result.items()}


def finish_partial(
    partial: Path, target: Path, what: str, traceback: str, stack_cause: str = ""
) -> tuple[str, int]:
    """Finish the log of a process that ended without doing so, with the outcome `error`.

    Args:
        partial: File of that process; it is removed.
        target: Name of the finished log.
        what: End of the process, in words that follow its name.
        traceback: Printable lines for the log; may be empty.
        stack_cause: Cause of the error if a stack on trial is the only code of the user's in that
            process; none by default.

    Returns:
        Reason in the log, and its number of decisions, which may be 0.

    Raises:
        InputError: There is no such file, its head is not whole, or the folder cannot be written.
    """
    if not partial.is_file():
        raise InputError(f"log '{partial}': no such file")
    source = partial.with_name(f"{partial.name}.ended")  # the copy is written by the other name
    partial.replace(source)
    reading = _Reading(source)
    head = read_head(reading.items(), source, allow_plugins=True)
    names = plugins_of(head.config)
    who = ", ".join(names) or head.config.robot
    decisions = len(reading.decisions)
    reason = printable(f"{who}: the process {what} after {decisions} decisions")
    result = _result_of(reading, head.mission, reason)
    if stack_cause and names == [head.config.stack.name]:
        result |= {"cause": stack_cause, "cause_evidence": reason, "cause_decision": str(decisions)}
    if traceback:
        head.attachments[TRACEBACK] = traceback.encode()
    record = "full" if reading.sweeps or not decisions else "decisions"
    write_copy(target, head, messages=reading.whole_decisions(), result=result, record=record)
    source.unlink()
    return reason, decisions


class _Reading:
    """Passes over a broken file up to its damage; complete decisions are counted."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damage = ""
        self.sweeps = 0
        self.decisions: list[pb.Decision] = []  # each with its truth or motion
        self.truths: list[pb.Truth] = []
        self.motions: list[pb.RecordedMotion] = []  # of a recording, in the place of truths

    def items(self) -> Iterator[Attachment | Metadata | Packet]:
        """Yield all items up to the damage, and count the decisions."""
        decision, motion = None, None
        for item in self._sound_records():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if isinstance(message, pb.RecordedMotion):
                    motion = message
                elif isinstance(message, pb.Decision):
                    decision = message
                    if motion is not None:
                        self.decisions.append(message)
                        self.motions.append(motion)
                        decision = motion = None
                elif isinstance(message, pb.Truth) and decision is not None:
                    self.decisions.append(decision)
                    self.truths.append(message)
                    decision = None
                self.sweeps += isinstance(message, pb.Sweep)
            yield item

    def whole_decisions(self) -> Iterator[Message]:
        """Yield the messages up to the last decision and its truth."""
        last = self.decisions[-1].sequence if self.decisions else 0
        for item in self._sound_records():
            if isinstance(item, Packet) and is_ours(item):
                message = decode(item, self._path)
                if getattr(message, "sequence", 0) > last:
                    return
                yield message

    def _sound_records(self) -> Iterator[Attachment | Metadata | Packet]:
        try:
            yield from walk(self._path)
        except InputError as error:
            self.damage = str(error).partition("': ")[2]
