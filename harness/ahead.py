"""Recomputing a log with the map one set of inputs ahead, on a second thread.

While a decision is made, the inputs of the next one are decoded and taken into the map: its kernels
let go of the interpreter. Once the costmap stands, a decision reads one thing more of the map, the
age of the evidence along the path that it commits to. That is looked up before the map goes on,
along the path that the log says. Where the recomputed path is another one, or anything else of the
map is asked for, `Outrun` is raised, and the log is to be recomputed step by step.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from harness.audit import points_of
from harness.inputs import Inputs
from harness.navigator import Navigator
from harness.reader import Log, Record
from harness.schema import wayproof_pb2 as pb
from harness.twin import guarded, recompute
from harness.view import View
from maps import Representation

SWITCH_S = 5e-4
"""How long one thread waits for the other to let go of the interpreter, s; by default ten times as
long, which is as long as a whole decision takes."""


class Outrun(Exception):
    """A decision needs the map as it was, and the map has gone on."""


def recompute_ahead(log: Log) -> Iterator[tuple[Record, pb.Decision]]:
    """Each record of a log that was never forked, with what is decided on it now.

    Raises:
        InputError: The log is damaged, or cannot be recomputed.
        Outrun: A decision differs in a way that only a step by step replay can tell.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        with ThreadPoolExecutor(1, "ahead") as pool:
            navigator = guarded("the log's stack", partial(_Ahead, log, pool))
            while (record := navigator.record()) is not None:
                yield record, recompute(navigator, record)
    finally:
        sys.setswitchinterval(before)


class _Ahead(Navigator):
    """A navigator whose map takes the next inputs while it decides on these."""

    def __init__(self, log: Log, pool: ThreadPoolExecutor) -> None:
        super().__init__(log.config, log.mission, log.beams)
        self._records = log.records()
        self._pool = pool
        self._map = self.map
        self._mapper = copy.copy(self)  # the same map, which stays with it
        self._next: Future[Record | None] | None = None
        self._record_at_hand: Record | None = None

    def record(self) -> Record | None:
        """The next record, its inputs in the map; none after the last."""
        if self._next is None:
            self._go_ahead()
        assert self._next is not None
        self._record_at_hand = self._next.result()
        self._next = None
        self.map = self._map
        return self._record_at_hand

    def integrate(self, inputs: Inputs) -> None:
        """Nothing is left to do."""

    def _go_ahead(self) -> None:
        self._next = self._pool.submit(self._take_next)

    def _take_next(self) -> Record | None:
        record = next(self._records, None)
        if record is not None:
            what = f"decision {record.decision.sequence}"
            guarded(what, partial(Navigator.integrate, self._mapper, record.inputs))
        return record

    def _view(self, inputs: Inputs) -> View:
        record = self._record_at_hand
        assert record is not None
        # What was discarded for its delay is not in the log: there is no path to look along.
        if not record.decision.deadline_missed:
            self._path = points_of(record.decision.trajectory)
            self._age = super()._evidence_age(self._path, inputs.time_ns)
            self.map = cast(Representation, _Gone(self._map.resolution))
            self._go_ahead()
        return super()._view(inputs)

    def _evidence_age(self, path: NDArray[np.float64], time_ns: int) -> float:
        if self._next is None:
            return super()._evidence_age(path, time_ns)
        if not np.array_equal(path, self._path):
            raise Outrun
        return self._age


class _Gone:
    """In the place of a map that has gone on."""

    def __init__(self, resolution: float) -> None:
        self.resolution = resolution

    def __getattr__(self, name: str) -> Any:
        raise Outrun
