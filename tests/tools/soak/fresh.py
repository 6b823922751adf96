"""Replays in fresh processes, forked from a server that has loaded the program.

The server is forked before any episode runs. It imports the program, loads the compiled kernels and
forks a child for each log, so that a child knows of an episode only what is in its log.
`replay_by_command` starts a new interpreter instead.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from tests.tools.soak.child import in_child
from wayproof import maps, planners
from wayproof.harness.config import Config

SILENCE_S = 120.0
"""Wall time limit of one replay on a loaded machine, s."""


class FreshReplays:
    """Server of replays in processes forked before the logs were made."""

    def __init__(self, configs: Sequence[Config]) -> None:
        """Fork the server, with the kernels that these configs need."""
        self._pipe, other = Pipe()
        self._child = os.fork()
        if self._child == 0:
            self._pipe.close()
            _serve(other, configs)
            os._exit(0)
        other.close()

    def replay(self, log: Path, threads: int) -> str:
        """Replay a log; return the differences, empty without any."""
        self._pipe.send((str(log), threads))
        verdict: str = self._pipe.recv()
        return verdict

    def close(self) -> None:
        """End the server."""
        self._pipe.close()
        os.waitpid(self._child, 0)


def _serve(pipe: Connection, configs: Sequence[Config]) -> None:
    for config in configs:
        maps.warm_up(config.map.kind, config.costmap.max_slope, config.sensors.semantics)
        planners.warm_up(config.planner, oriented=True)
    while True:
        try:
            log, threads = pipe.recv()
        except EOFError:
            return
        ended = in_child(lambda report: _replay(Path(log), threads, report), SILENCE_S)  # noqa: B023
        if ended.code != 0 or len(ended.lines) != 1:
            pipe.send(f"exit code {ended.code}: {' '.join(ended.lines)[-500:]}")
        else:
            pipe.send(ended.lines[0].removeprefix("verdict "))


def _replay(log: Path, threads: int, report: Callable[[str], None]) -> None:
    from wayproof.harness.replay.replay import replay

    replayed = replay(log, threads=threads)
    differs = f"decision {replayed.first_difference}: {replayed.differences[:3]}"
    report("verdict " + ("" if replayed.identical else differs.replace("\n", " ")))


def replay_by_command(log: Path, threads: int) -> str:
    """Replay a log by the command line; return the differences, empty without any."""
    command = [sys.executable, "-m", "wayproof", "replay", "--json", "--threads", str(threads)]
    done = subprocess.run([*command, str(log)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or done.stderr:
        return f"exit code {done.returncode}: {done.stderr[-500:]}"
    document = json.loads(done.stdout)
    return "" if document["identical"] else str(document["differences"][:3])
