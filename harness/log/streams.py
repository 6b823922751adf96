"""Hashes of everything that reaches a decision, stream by stream, so that pairs can be compared.

After each decision the log holds a running hash of each stream since the start: every sensor, the
pose, the delays, the world's own geometry, and `control`, the setpoints that the body has followed
so far. Two runs of a pair that differ in one perturbation share their past until it acts. Up to the
first decision before which the body was asked for something else, only the streams that the
perturbation declares may differ; from then on the runs are in different places, and all may.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.schema import wayproof_pb2 as pb

COMMAND = "command"
"""The stream of the answers of a stack on trial: inputs that follow from the other streams."""

CONTROL = "control"
"""The stream of what the body was asked for: no input, but what a pair's decisions amount to."""


DIGEST_SIZE = 8
"""Of a stream's hash, bytes: it tells runs apart, and guards against nobody."""


def own_streams(config: Config) -> list[str]:
    """Input streams besides those of the sensors."""
    on_trial = config.stack.name != BUILTIN
    return ["pose", "latency", *([COMMAND] if on_trial else [])]


class StreamHashes:
    """Chained hashes by stream; each exists from the start, so that a silent one is seen too."""

    def __init__(self, names: list[str]) -> None:
        """Start with empty streams."""
        self._hashes = dict.fromkeys(names, bytes(DIGEST_SIZE))

    def update(self, name: str, data: bytes) -> None:
        """Append to a stream: blake2b over the hash so far and the data."""
        chained = hashlib.blake2b(self._hashes[name], digest_size=DIGEST_SIZE)
        chained.update(data)
        self._hashes[name] = chained.digest()

    def message(self, sequence: int, time_ns: int) -> pb.Streams:
        """All hashes so far."""
        hashes = [pb.StreamHash(name=name, hash=one.hex()) for name, one in self._hashes.items()]
        message = pb.Streams(sequence=sequence, streams=hashes)
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def state(self) -> dict[str, NDArray[Any]]:
        """The hashes, (8,) uint8 each, by stream."""
        return {name: np.frombuffer(one, np.uint8) for name, one in self._hashes.items()}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from `state`."""
        self._hashes = {name: state[name].tobytes() for name in self._hashes}


@dataclass(frozen=True)
class Pairing:
    """How the streams of two runs differ before the body was asked for anything else.

    Attributes:
        changed: Streams that differ before that.
        first_change: Sequence number of the first decision with a stream that differs; none if the
            runs are the same.
        first_action: Of the first decision before which the body was asked for something else;
            none if it never was.
        compared: Decisions before that.
    """

    changed: frozenset[str]
    first_change: int | None
    first_action: int | None
    compared: int


def compare(first: Path, second: Path) -> Pairing:
    """Compare two logs stream by stream up to the first differing action.

    Raises:
        InputError: A log breaks off.
    """
    return compare_hashes(_pairs(first, second))


def compare_hashes(
    pairs: Iterable[tuple[int, Mapping[str, object], Mapping[str, object]]],
) -> Pairing:
    """Compare two runs decision by decision: sequence number, and each run's hashes by stream."""
    changed: set[str] = set()
    first_change = None
    compared = 0
    for sequence, one, other in pairs:
        differing = {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}
        differing.discard(COMMAND)
        if differing and first_change is None:
            first_change = sequence
        if CONTROL in differing:
            return Pairing(frozenset(changed), first_change, sequence, compared)
        changed |= differing
        compared += 1
    return Pairing(frozenset(changed), first_change, None, compared)


def _pairs(first: Path, second: Path) -> Iterator[tuple[int, dict[str, str], dict[str, str]]]:
    for one, other in zip(_streams(first), _streams(second), strict=False):
        yield one.sequence, _by_name(one), _by_name(other)


def _streams(path: Path) -> Iterator[pb.Streams]:
    for message in read_messages(path):
        if isinstance(message, pb.Streams):
            yield message


def _by_name(message: pb.Streams) -> dict[str, str]:
    return {stream.name: stream.hash for stream in message.streams}
