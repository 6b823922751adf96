"""Many runs in two processes: each row is told as it comes, and kept in a file if one is given."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up
from wayproof.models.worlds import World

PROCESSES = 2

Progress = Callable[[str], None]

Job = TypeVar("Job", bound=tuple[Any, ...])
Value = TypeVar("Value")


class RowOfJob(Protocol):
    """A dataclass whose fields tell of which job it is."""

    @property
    def job(self) -> tuple[Any, ...]:
        """What it is the row of."""
        ...


Row = TypeVar("Row", bound=RowOfJob)


class KeptRows(Generic[Row]):
    """Rows in a file, one JSON object a line, each written as soon as it is there.

    A bench that was ended goes on from its file. The file does not tell the code that its rows come
    from: who changes the code starts another.

    Attributes:
        rows: By job.
    """

    def __init__(self, path: Path | None, kind: type[Row]) -> None:
        """Read what is there; a last line that was cut off is left out.

        Args:
            path: None keeps nothing.
            kind: Of the rows.

        Raises:
            InputError: The file cannot be written to, or a line is no such row.
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
        """Take in one more."""
        self.rows[row.job] = row
        if self._path is not None:
            with self._path.open("ab") as file:
                file.write(msgspec.json.encode(row) + b"\n")


def unlogged(config: Config, world: World | None = None) -> Result:
    """Run one episode, and throw its log away.

    Args:
        config: Of the episode.
        world: In place of the one that it names.
    """
    warm_up(config)
    with tempfile.TemporaryDirectory() as folder:
        return run_episode(build(config, world), Path(folder) / "episode.mcap")


def rows_of(
    jobs: Sequence[Job], run: Callable[..., Row], kept: KeptRows[Row], progress: Progress
) -> list[Row]:
    """The row of every job, in their order; those that are kept already are not run again.

    Args:
        jobs: Arguments of `run`.
        run: A function of a module.
        kept: What there is; each new row is added.
        progress: Told of each new row.
    """
    left = [job for job in jobs if job not in kept.rows]
    for done, (_, row) in enumerate(run_jobs(left, run), len(jobs) - len(left) + 1):
        kept.add(row)
        progress(f"{done} of {len(jobs)}: {row}")
    return [kept.rows[job] for job in jobs]


def run_jobs(jobs: Iterable[Job], run: Callable[..., Value]) -> Iterator[tuple[Job, Value]]:
    """Call `run` with the arguments of each job in one of two processes; told in order of ends."""
    context = multiprocessing.get_context("spawn")
    with _one_thread_each(), ProcessPoolExecutor(PROCESSES, mp_context=context) as pool:
        running = {pool.submit(run, *job): job for job in jobs}
        try:
            for done in as_completed(running):
                yield running.pop(done), done.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Spawned processes inherit the environment."""
    name = "OPENBLAS_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before
