"""A team of threads that run loops of compiled kernels side by side."""

from __future__ import annotations

import itertools
import threading
import weakref
from collections.abc import Callable

PARTS_PER_THREAD = 6
"""Parts of a loop per thread; more than one, because some parts take longer than others."""

WORTH_SHARING_US = 250
"""Shortest run time of work that is shared, us.

Shorter work is done before a second thread has woken up and started: some 100 us, as measured with
the sweeps of an episode on two cores.
"""

LoopBody = Callable[[int, tuple[int, int]], None]
"""`body(worker, (first, end))`: the items first <= i < end, run by thread number `worker`."""


class ThreadTeam:
    """A fixed number of threads: the caller's own, as worker 0, and `size - 1` more.

    Which thread runs which part is left to chance, so results must not depend on it.
    """

    def __init__(self, threads: int) -> None:
        """Make a team. Its threads start with the first work worth sharing, and end with the team.

        Args:
            threads: Number of threads, with the caller's own.

        Raises:
            ValueError: Not 1 to 64 threads.
        """
        if not 1 <= threads <= 64:
            raise ValueError(f"threads: got {threads}, expected 1 to 64")
        self.size = threads
        self._workers: list[_WorkerThread] = []

    def worth_sharing(self, count: int, item_us: float) -> bool:
        """Return whether `count` items of `item_us` microseconds each are worth sharing."""
        return self.size > 1 and count * item_us >= WORTH_SHARING_US

    def parallel_for(
        self,
        body: LoopBody,
        count: int,
        parts_per_thread: int = PARTS_PER_THREAD,
        item_us: float = WORTH_SHARING_US,
    ) -> None:
        """Run a loop in parts: call `body(worker, (first, end))` until all items are done.

        Args:
            body: Loop body over the items from `first` up to `end`.
            count: Number of items.
            parts_per_thread: 1 where all items take equally long.
            item_us: Rough time of one item in one thread, us. The caller runs the loop alone if
                the whole is not worth sharing.

        Raises:
            ValueError: The system starts no more threads.
            Exception: The first one raised by any part, once no thread works any more.
        """
        if not self.worth_sharing(count, item_us):
            body(0, (0, count))
            return
        parts = parts_per_thread * self.size
        edges = [count * part // parts for part in range(parts + 1)]
        queue = itertools.count()

        def run_parts(worker: int) -> None:
            while (part := next(queue)) < parts:
                body(worker, (edges[part], edges[part + 1]))

        self.run_all(run_parts)

    def run_all(self, work: Callable[[int], None], us: float = WORTH_SHARING_US) -> None:
        """Call `work(worker)` in all threads at once, and wait for them.

        Args:
            work: Takes items from a common queue, say, until none is left.
            us: Rough time of the whole in one thread, us. The caller works alone if that is not
                worth sharing.

        Raises:
            ValueError: The system starts no more threads.
            Exception: The first one raised by any thread, once none works any more.
        """
        if not self.worth_sharing(1, us):
            work(0)
            return
        while len(self._workers) < self.size - 1:
            self._workers.append(self._start_worker())
        for worker in self._workers:
            worker.begin(work)
        try:
            work(0)
        finally:
            errors = [worker.wait() for worker in self._workers]
        for error in errors:
            if error is not None:
                raise error

    def _start_worker(self) -> _WorkerThread:
        number = len(self._workers) + 1
        try:
            worker = _WorkerThread(number)
        except RuntimeError:
            expected = f"expected at most {number}, more are refused here"
            raise ValueError(f"threads: got {self.size}, {expected}") from None
        weakref.finalize(self, worker.dismiss)
        return worker


class _WorkerThread:
    """A thread that waits for work. Bare locks hand work over in half the time of an executor."""

    def __init__(self, number: int) -> None:
        """Start worker `number` of a team."""
        self._number = number
        self._begun, self._done = threading.Lock(), threading.Lock()
        self._begun.acquire()
        self._done.acquire()
        self._work: Callable[[int], None] | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name=f"maps-{number}", daemon=True)
        self._thread.start()

    def begin(self, work: Callable[[int], None]) -> None:
        """Start `work` in the thread."""
        self._work = work
        self._begun.release()

    def wait(self) -> BaseException | None:
        """Wait until the work is done; return the exception that it raised, if any."""
        self._done.acquire()
        error, self._error, self._work = self._error, None, None
        return error

    def dismiss(self) -> None:
        """End the thread."""
        self._work = None
        self._begun.release()

    def _serve(self) -> None:
        while True:
            self._begun.acquire()
            if self._work is None:
                return
            try:
                self._work(self._number)
            except BaseException as error:  # raised again by `run_all`
                self._error = error
            self._done.release()
