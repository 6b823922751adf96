"""Delivery of messages to the stack: what comes of each stream, when, and with which stamp.

One mechanism for simulated and recorded robots. All that a stack gets passes here: what does not
come reaches neither the estimator nor the map.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.perturbations.perturbation import MOST_LAG, Arrival, Perturbation
from wayproof.harness.schema import wayproof_pb2 as pb

M = TypeVar("M", pb.Sweep, pb.Pose)


class Delivery:
    """Delivers the messages of each stream by name; keeps those that may still come."""

    def __init__(self, perturbation: Perturbation, seed: int, period_ns: int) -> None:
        """Start before the first message.

        Args:
            perturbation: Says which message comes.
            seed: Seed of the episode.
            period_ns: Time between two messages, about, ns.
        """
        self._perturbation, self._seed, self._period_ns = perturbation, seed, period_ns
        self._now_ns = 0
        self._past: dict[str, deque[bytes]] = {}
        self._last: dict[str, bytes] = {}
        self._taken_ns: dict[str, int] = {}

    def take(self, stream: str, message: M) -> M | None:
        """Return the message that comes in place of one that was sent; None if none does.

        Args:
            stream: Name of its stream.
            message: Sent now.
        """
        past = self._past.setdefault(stream, deque(maxlen=MOST_LAG + 1))
        past.append(message.SerializeToString(deterministic=True))
        time_ns = self._now_ns = message.timestamp.ToNanoseconds()
        lag = self._perturbation.lag_at(
            Arrival(stream, message.sequence, time_ns, self._period_ns, self._seed)
        )
        if lag == 0:
            self._last[stream], self._taken_ns[stream] = past[-1], time_ns
            return message
        if lag == "none":
            return None
        if lag == "last":
            chosen = self._last.setdefault(stream, past[-1])
        elif lag < len(past):
            chosen = self._last[stream] = past[-1 - lag]
        else:
            return None
        late = type(message).FromString(chosen)
        taken_ns = late.timestamp.ToNanoseconds()
        self._taken_ns[stream] = max(taken_ns, self._taken_ns.get(stream, 0))
        late.timestamp.CopyFrom(message.timestamp)
        if isinstance(late, pb.Sweep):
            late.lag = message.sequence - late.sequence
        late.sequence = message.sequence
        late.age_ns = 0 if self._perturbation.restamps else time_ns - taken_ns
        return late

    def take_sweeps(
        self, sent: Sequence[pb.Sweep], affected: Container[str]
    ) -> tuple[list[pb.Sweep], list[str]]:
        """Return the sweeps that come in place of those sent, and the sensors without any.

        Args:
            sent: Sweeps of one instant.
            affected: Names of the sensors that the perturbation changes.
        """
        came, withheld = [], []
        for sweep in sent:
            one = self.take(sweep.sensor, sweep) if sweep.sensor in affected else sweep
            if one is None:
                withheld.append(sweep.sensor)
            else:
                came.append(one)
        return came, withheld

    @property
    def evidence_age_s(self) -> float:
        """Time since the newest content that came of a stream was measured, of the oldest, s."""
        return (self._now_ns - min(self._taken_ns.values(), default=self._now_ns)) * 1e-9

    def state(self) -> dict[str, NDArray[np.uint8]]:
        """Return the messages that may still come, as bytes."""
        kept = {f"last/{stream}": data for stream, data in self._last.items()}
        for stream, past in self._past.items():
            kept |= {f"{k}/{stream}": data for k, data in enumerate(past)}
        for stream, taken_ns in self._taken_ns.items():
            kept[f"taken/{stream}"] = taken_ns.to_bytes(8, "little")
        return {name: np.frombuffer(data, np.uint8) for name, data in kept.items()}

    def restore(self, state: dict[str, NDArray[np.uint8]]) -> None:
        """Continue from what `state` returned."""
        self._past, self._last, self._taken_ns = {}, {}, {}
        for name, data in state.items():
            place, _, stream = name.partition("/")
            if place == "last":
                self._last[stream] = data.tobytes()
            elif place == "taken":
                self._taken_ns[stream] = int.from_bytes(data.tobytes(), "little")
            else:
                past = self._past.setdefault(stream, deque(maxlen=MOST_LAG + 1))
                past.append(data.tobytes())
