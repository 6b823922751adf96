"""A log's maps made again in a process of their own, while this one draws what they show.

What draws is Python for the most part and would hold up the threads that make the maps. Imports
here are few: the process is started first, and what else the viewer needs is imported meanwhile.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from harness.errors import InputError

if TYPE_CHECKING:
    from harness.viewer.snapshots import Snapshot

COMMAND = "from harness.viewer.process import serve; serve()"


class SnapshotProcess:
    """The process for one log; it ends with the block that it was started for.

    Attributes:
        path: Of the log.
    """

    def __init__(self, path: Path, allow_plugins: bool) -> None:
        """Start it.

        Args:
            path: Of the log.
            allow_plugins: Whether code that its config names may be imported.
        """
        self.path = path
        found = os.pathsep.join(folder or os.getcwd() for folder in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-c", COMMAND, str(path), str(int(allow_plugins))],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": found},
        )

    def __enter__(self) -> Self:
        """Nothing more to do."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it, whether it is done or not."""
        self.end()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def end(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()

    def snapshots(self) -> Iterator[Snapshot]:
        """What `harness.viewer.snapshots.snapshots` tells of the log.

        Raises:
            InputError: The log is damaged, its sweeps were left out, or the process was ended.
        """
        assert self._process.stdout is not None
        while True:
            try:
                item = pickle.load(self._process.stdout)
            except (EOFError, pickle.UnpicklingError):
                code = self._process.wait()
                raise InputError(
                    f"log '{self.path}': the process that makes its maps again ended, code {code}"
                ) from None
            if item is None:
                return
            if isinstance(item, InputError):
                raise item
            yield item


def serve() -> None:
    """Be the process: send the snapshots, then none; or what is wrong with the log."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that draws ends this one
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # what a plugin prints is no snapshot
        from harness.reader import open_log
        from harness.viewer.moments import ahead
        from harness.viewer.snapshots import snapshots

        path, allow_plugins = Path(sys.argv[1]), sys.argv[2] == "1"
        try:
            for snapshot in ahead(snapshots(open_log(path, allow_plugins))):
                pickle.dump(snapshot, out, pickle.HIGHEST_PROTOCOL)
            pickle.dump(None, out)
        except InputError as error:
            pickle.dump(error, out)
