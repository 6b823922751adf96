"""Threads that share a piece of work."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


class Team:
    """A fixed number of threads; with one there is none but the caller's."""

    def __init__(self, threads: int) -> None:
        """Start them.

        Raises:
            ValueError: Not 1 to 64 threads.
        """
        if not 1 <= threads <= 64:
            raise ValueError(f"threads: got {threads}, expected 1 to 64")
        self.size = threads
        self._pool = ThreadPoolExecutor(threads - 1, "maps") if threads > 1 else None

    def share(self, work: Callable[[int, tuple[int, int]], None], count: int) -> None:
        """Call `work(member, (first, end))` for equal parts of `count` items, and wait."""
        if self._pool is None:
            work(0, (0, count))
            return
        edges = [count * member // self.size for member in range(self.size + 1)]
        others = [
            self._pool.submit(work, member, (edges[member], edges[member + 1]))
            for member in range(1, self.size)
        ]
        work(0, (0, edges[1]))
        for other in others:
            other.result()
