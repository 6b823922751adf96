"""Threads that share a piece of work."""

from __future__ import annotations

import itertools
import threading
import weakref
from collections.abc import Callable

PARTS = 6
"""Parts of a piece of work to each thread: the beams of one part may take longer than others."""

WORTH_SHARING_US = 250
"""A piece of work that takes less is done before a second thread has woken up and taken its part:
some 100 us, as measured with the sweeps of an episode on two cores."""

Work = Callable[[int, tuple[int, int]], None]


class Team:
    """A fixed number of threads; with one there is none but the caller's.

    Which thread does which part is left to chance: what they do must not depend on it.
    """

    def __init__(self, threads: int) -> None:
        """Know how many; they start with the first work that is worth it, and end with the team.

        Raises:
            ValueError: Not 1 to 64 threads.
        """
        if not 1 <= threads <= 64:
            raise ValueError(f"threads: got {threads}, expected 1 to 64")
        self.size = threads
        self._helpers: list[_Helper] = []

    def helps(self, count: int, item_us: float) -> bool:
        """Whether so many items, microseconds each, are worth sharing."""
        return self.size > 1 and count * item_us >= WORTH_SHARING_US

    def share(
        self, work: Work, count: int, parts_each: int = PARTS, item_us: float = WORTH_SHARING_US
    ) -> None:
        """Call `work(member, (first, end))` for all parts of `count` items, and wait.

        Args:
            work: What to do for the items from one index up to another, as one of the members.
            count: Number of items.
            parts_each: Parts to each thread; 1 where all items take equally long.
            item_us: About what an item takes one thread, microseconds: where all of them are not
                worth sharing, the caller does them alone.

        Raises:
            ValueError: The system starts no more threads.
            Exception: The first one that any part raised, once no thread works any more.
        """
        if not self.helps(count, item_us):
            work(0, (0, count))
            return
        parts = parts_each * self.size
        edges = [count * part // parts for part in range(parts + 1)]
        queue = itertools.count()

        def help_out(member: int) -> None:
            while (part := next(queue)) < parts:
                work(member, (edges[part], edges[part + 1]))

        self.together(help_out)

    def together(self, work: Callable[[int], None], us: float = WORTH_SHARING_US) -> None:
        """Call `work(member)` in all members at once, and wait.

        Args:
            work: What to do as one of the members, until nothing is left to do.
            us: About what it takes one thread, microseconds: where that is not worth sharing, only
                the caller works.

        Raises:
            ValueError: The system starts no more threads.
            Exception: The first one that any member raised, once none works any more.
        """
        if not self.helps(1, us):
            work(0)
            return
        while len(self._helpers) < self.size - 1:
            self._helpers.append(self._start_helper())
        for helper in self._helpers:
            helper.begin(work)
        try:
            work(0)
        finally:
            errors = [helper.wait() for helper in self._helpers]
        for error in errors:
            if error is not None:
                raise error

    def _start_helper(self) -> _Helper:
        member = len(self._helpers) + 1
        try:
            helper = _Helper(member)
        except RuntimeError:
            here = f"expected at most {member}, more are refused here"
            raise ValueError(f"threads: got {self.size}, {here}") from None
        weakref.finalize(self, helper.dismiss)
        return helper


class _Helper:
    """One more thread. Handing over by bare locks takes half as long as by an executor."""

    def __init__(self, member: int) -> None:
        self._member = member
        self._begun, self._done = threading.Lock(), threading.Lock()
        self._begun.acquire()
        self._done.acquire()
        self._help_out: Callable[[int], None] | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name=f"maps-{member}", daemon=True)
        self._thread.start()

    def begin(self, help_out: Callable[[int], None]) -> None:
        """Have it called in the thread."""
        self._help_out = help_out
        self._begun.release()

    def wait(self) -> BaseException | None:
        """Until the thread is done; what it raised, if anything."""
        self._done.acquire()
        error, self._error, self._help_out = self._error, None, None
        return error

    def dismiss(self) -> None:
        """End the thread."""
        self._help_out = None
        self._begun.release()

    def _serve(self) -> None:
        while True:
            self._begun.acquire()
            if self._help_out is None:
                return
            try:
                self._help_out(self._member)
            except BaseException as error:  # raised again where the work was shared
                self._error = error
            self._done.release()
