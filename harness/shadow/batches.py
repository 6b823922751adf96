"""Sweeps of a recording in batches, one for each decision."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from wayproof.harness.recordings.types import RecordedSweep

MOST_SWEEPS = 128
"""Number of sweeps from which on a decision is made before its period has passed."""


@dataclass(frozen=True)
class Batch:
    """The sweeps that one decision is made on.

    Attributes:
        time_ns: Time of the decision: of the last beam.
        sweeps: Sweeps in order of time; one at least.
    """

    time_ns: int
    sweeps: tuple[RecordedSweep, ...]


def batches(
    sweeps: Iterable[RecordedSweep],
    period_ns: int,
    has_gap: Callable[[int, int], bool] = lambda begin_ns, end_ns: False,
) -> Iterator[Batch]:
    """Collect sweeps until a period has passed since the last decision.

    Args:
        sweeps: Sweeps in order of time.
        period_ns: Least time between two decisions, ns; with 0 each time of a sweep has one.
        has_gap: Whether poses are missing between two times, ns: a batch ends there, as its
            sweeps are placed by the poses up to its own time.
    """
    pending: list[RecordedSweep] = []
    last_ns, end_ns = -1, -1
    for sweep in sweeps:
        if pending and end_ns > last_ns and sweep.time_ns > end_ns:
            full = len(pending) >= MOST_SWEEPS
            late = end_ns - last_ns >= period_ns or has_gap(end_ns, sweep.time_ns)
            if last_ns < 0 or full or late:
                yield Batch(end_ns, tuple(pending))
                pending, last_ns = [], end_ns
        pending.append(sweep)
        end_ns = max(end_ns, end_of(sweep))
    if pending and end_ns > last_ns:
        yield Batch(end_ns, tuple(pending))


def end_of(sweep: RecordedSweep) -> int:
    """Time of the last beam of a sweep, ns."""
    if sweep.beam_times_ns is None or len(sweep.beam_times_ns) == 0:
        return sweep.time_ns
    return sweep.time_ns + max(int(sweep.beam_times_ns.max()), 0)
