"""Threads that share a piece of work."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

PARTS = 6
"""Parts of a piece of work to each thread: the beams of one part may take longer than others."""

Work = Callable[[int, tuple[int, int]], None]


class Team:
    """A fixed number of threads; with one there is none but the caller's.

    Which thread does which part is left to chance: what they do must not depend on it.
    """

    def __init__(self, threads: int) -> None:
        """Start them.

        Raises:
            ValueError: Not 1 to 64 threads.
        """
        if not 1 <= threads <= 64:
            raise ValueError(f"threads: got {threads}, expected 1 to 64")
        self.size = threads
        self._pool = ThreadPoolExecutor(threads - 1, "maps") if threads > 1 else None

    def share(self, work: Work, count: int, parts_each: int = PARTS) -> None:
        """Call `work(member, (first, end))` for all parts of `count` items, and wait.

        Args:
            work: What to do for the items from one index up to another, as one of the members.
            count: Number of items.
            parts_each: Parts to each thread; 1 where all items take equally long.
        """
        if self._pool is None:
            work(0, (0, count))
            return
        parts = parts_each * self.size
        edges = [count * part // parts for part in range(parts + 1)]
        queue = itertools.count()

        def help_out(member: int) -> None:
            while (part := next(queue)) < parts:
                work(member, (edges[part], edges[part + 1]))

        others = [self._pool.submit(help_out, member) for member in range(1, self.size)]
        help_out(0)
        for other in others:
            other.result()
