"""Threads that share the work of kernels, each piece with a part of the output of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray


class Workers:
    """A fixed number of threads; one means the caller's own, and none is started.

    Kernels release the interpreter's lock, and each writes only what its pieces own: the result is
    the same, bit by bit, with any number of threads.

    Attributes:
        threads: How many share the work.
    """

    def __init__(self, threads: int = 1) -> None:
        """Start the threads.

        Raises:
            ValueError: There is not at least one.
        """
        if threads < 1:
            raise ValueError(f"threads: got {threads}, expected 1 or more")
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def share(
        self, work: Callable[[NDArray[np.int64]], None], pieces: NDArray[np.int64], shares: int = 1
    ) -> None:
        """Do all pieces, and return when they are done.

        Args:
            work: Does some of them.
            pieces: (n, ...) what to do, split along the first axis.
            shares: Parts per thread; more than one evens out pieces of different cost.
        """
        if len(pieces) == 0:
            return
        if self._pool is None:
            work(pieces)
            return
        parts = np.array_split(pieces, min(len(pieces), shares * self.threads))
        for _ in self._pool.map(work, parts):
            pass  # also raises what a part raised
