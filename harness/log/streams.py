"""Running hashes of the inputs of decisions, stream by stream, to compare two runs.

After each decision the log holds a running hash of each stream since the start: every sensor, the
pose, the delays, the geometry of the world, and `control`, the setpoints of the body so far. Two
runs that differ in one perturbation are the same until it acts. Up to the first decision before
which their setpoints differ, only the streams that the perturbation declares may differ; from then
on the robots are in different places, and all streams may.
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
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.schema import wayproof_pb2 as pb

GOAL = "goal"
"""The stream of the goals of decisions: of a recording, or of a mission with several."""

COMMAND = "command"
"""The stream of the answers of a stack on trial: inputs that follow from the other streams."""

PREDICTION = "prediction"
"""Stream of the predictions of a predictor from outside, which follow from the other streams."""

PRIOR = "prior"
"""The stream of the prior map, which is one from the start on."""

CONTROL = "control"
"""Stream of the setpoints of the body: no input, but the effect of the decisions."""


DIGEST_SIZE = 8
"""Size of the hash of a stream, bytes: enough to distinguish runs, not to resist forgery."""


def own_streams(config: Config) -> list[str]:
    """Return input streams besides those of the sensors."""
    on_trial = [COMMAND] if config.stack.name != BUILTIN else []
    several = [GOAL] if config.recording is not None or config.waypoints else []
    prior = [PRIOR] if config.prior_map else []
    predicted = [PREDICTION] if is_outside(config.prediction.source) else []
    return ["pose", *several, *predicted, "latency", *on_trial, *prior]


class StreamHashes:
    """Chained hashes by stream; each exists from the start, so that a silent stream shows."""

    def __init__(self, names: list[str]) -> None:
        """Create the hashes of empty streams."""
        self._hashes = dict.fromkeys(names, bytes(DIGEST_SIZE))

    def update(self, name: str, data: bytes) -> None:
        """Append to a stream: blake2b over the hash so far and the data."""
        chained = hashlib.blake2b(self._hashes[name], digest_size=DIGEST_SIZE)
        chained.update(data)
        self._hashes[name] = chained.digest()

    def message(self, sequence: int, time_ns: int) -> pb.Streams:
        """Return all hashes so far as a message."""
        hashes = [pb.StreamHash(name=name, hash=one.hex()) for name, one in self._hashes.items()]
        message = pb.Streams(sequence=sequence, streams=hashes)
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the hashes by stream, (8,) uint8 each."""
        return {name: np.frombuffer(one, np.uint8) for name, one in self._hashes.items()}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from the hashes of `state`."""
        self._hashes = {name: state[name].tobytes() for name in self._hashes}


@dataclass(frozen=True)
class Pairing:
    """Differences between the streams of two runs up to their first different setpoint.

    Attributes:
        changed: Streams that differ before it.
        first_change: Number of the first decision with a stream that differs, or None.
        first_action: Number of the first decision before which the setpoints differ, or None.
        compared: Number of decisions before it.
    """

    changed: frozenset[str]
    first_change: int | None
    first_action: int | None
    compared: int


def compare(first: Path, second: Path) -> Pairing:
    """Compare two logs stream by stream up to the first different setpoint.

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
        differing -= {COMMAND, PREDICTION}
        if CONTROL in one:  # of an episode, whose goals follow from its decisions
            differing.discard(GOAL)
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
