"""Jobs of a benchmark in two processes, and their rows kept in a file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.worlds import World

PROCESSES = 2

Job = TypeVar("Job", bound=tuple[Any, ...])
Value = TypeVar("Value")


class RowOfJob(Protocol):
    """A dataclass that identifies its job."""

    @property
    def job(self) -> tuple[Any, ...]:
        """Arguments of the job that the row is the result of."""
        ...


Row = TypeVar("Row", bound=RowOfJob)


class KeptRows(Generic[Row]):
    """Rows in a file, one JSON object a line, each written as soon as it is measured.

    An interrupted benchmark continues from its file. The file does not record the version of the
    code that measured its rows: after a change of the code, start a new file.

    Attributes:
        rows: Job -> row.
    """

    def __init__(self, path: Path | None, kind: type[Row]) -> None:
        """Read the rows of the file; drop a last line that was cut off.

        Args:
            path: The file; None keeps rows in memory only.
            kind: Class of the rows.

        Raises:
            InputError: The file cannot be written to, or a line is not such a row.
        """
        self._path = path
        self.rows: dict[tuple[Any, ...], Row] = {}
        if path is None:
            return
        try:
            path.touch()
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"--rows {path}: {error}") from None
        whole = text[: text.rfind("\n") + 1]
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                row = msgspec.json.decode(line, type=kind)
            except msgspec.DecodeError as error:
                raise InputError(f"--rows {path}: line {number}: {error}") from None
            self.rows[row.job] = row
        if whole != text:
            path.write_text(whole, encoding="utf-8")

    def add(self, row: Row) -> None:
        """Add a row and append it to the file."""
        self.rows[row.job] = row
        if self._path is not None:
            with self._path.open("ab") as file:
                file.write(msgspec.json.encode(row) + b"\n")


def unlogged(config: Config, world: World | None = None) -> Result:
    """Run one episode without keeping its log.

    Args:
        config: Settings of the episode.
        world: World to use instead of the one that the config names.
    """
    warm_up(config)
    with tempfile.TemporaryDirectory() as folder:
        return run_episode(build(config, world), Path(folder) / "episode.mcap")


def rows_of(
    jobs: Sequence[Job], run: Callable[..., Row], kept: KeptRows[Row], progress: Progress
) -> list[Row]:
    """Return the row of every job, in the order of the jobs; jobs with a kept row are not run.

    Args:
        jobs: Arguments of each call of `run`.
        run: Function of a module.
        kept: Rows measured before; new rows are added to it.
        progress: Called with a line after each new row.
    """
    left = [job for job in jobs if job not in kept.rows]
    for done, (_, row) in enumerate(run_jobs(left, run), len(jobs) - len(left) + 1):
        kept.add(row)
        progress(f"{done} of {len(jobs)}: {row}")
    return [kept.rows[job] for job in jobs]


def run_jobs(jobs: Iterable[Job], run: Callable[..., Value]) -> Iterator[tuple[Job, Value]]:
    """Call `run` with the arguments of each job in two processes; yield each job as it ends."""
    listed = list(jobs)
    with WorkerPool(PROCESSES) as pool:
        for ended in pool.run(run, listed):
            yield listed[ended.number], ended.result()
