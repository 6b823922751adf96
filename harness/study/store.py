"""Folder of a study: logs by key, from which everything else is derived."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
from collections.abc import Container, Iterator, Mapping, Sequence
from pathlib import Path

import msgspec

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import finish_partial
from wayproof.harness.outputs import ENDING, remove_abandoned
from wayproof.harness.study.contents import Contents
from wayproof.harness.study.file import MOST_BYTES, StudyFile, check_study, refuse_code
from wayproof.harness.study.job import LACKS
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import Planned

WORKER_ENDS_S = 5.0
"""Time within which a worker ends whose parent was killed, s."""


class Store:
    """Folder of one study.

    `logs/KEY.mcap` is a finished episode, `errors/KEY.json` one that ended in error, with what it
    had logged as `errors/KEY.mcap`. After an error of the machine it has not ended.
    """

    def __init__(self, folder: Path) -> None:
        """Set the folder; it is made by `open`."""
        self.folder = folder
        self.logs = folder / "logs"
        self.errors = folder / "errors"
        self.study = folder / "study.json"

    @contextlib.contextmanager
    def open(self) -> Iterator[None]:
        """Make and lock the folder: two runs of one study would write the same logs.

        Raises:
            InputError: The folder cannot be made, another run holds it, or the disk is full.
        """
        try:
            self.logs.mkdir(parents=True, exist_ok=True)
            self.errors.mkdir(exist_ok=True)
            file = (self.folder / ".lock").open("w")
        except OSError as error:
            raise InputError(f"study folder '{self.folder}': {error.strerror}") from None
        with file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(
                    f"study folder '{self.folder}': another run is writing to it"
                ) from None
            try:
                yield
            except OSError as error:
                if error.errno not in LACKS:
                    raise
                raise InputError(
                    f"study folder '{self.folder}': {error.strerror}; what has ended is kept, and "
                    "the same command continues"
                ) from error

    @property
    def is_judged(self) -> bool:
        """Whether a run of the study has ended, and so its gates may have been looked at."""
        return self.study.is_file() and (self.folder / "table.parquet").is_file()

    def log(self, key: str) -> Path:
        """Return the path of the log of an episode."""
        return self.logs / f"{key}.mcap"

    def unplanned(self, keys: Container[str]) -> int:
        """Return the number of logs of episodes that have none of these keys."""
        return sum(path.stem not in keys for path in self.logs.glob("*.mcap"))

    def error(self, key: str) -> str | None:
        """Return the error of an episode; None without one."""
        found = self._error(key)
        return None if found is None else found[0]

    def _error(self, key: str) -> tuple[str, bool] | None:
        """Return the error of an episode, and whether it is the machine's."""
        path = self.errors / f"{key}.json"
        try:
            document = json.loads(_bounded(path))
            return str(document["error"]), bool(document.get("of_machine"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"'{path}': {error}; delete it to run the episode again") from None

    def is_done(self, key: str) -> bool:
        """Return whether an episode has ended."""
        error = self._error(key)
        return self.log(key).is_file() if error is None else not error[1]

    def record_error(self, key: str, text: str, of_machine: bool = False) -> None:
        """Record that an episode ended in an error, or was ended by one of the machine."""
        document = {"key": key, "error": text, "of_machine": of_machine}
        self.keep(f"errors/{key}.json", document)

    def forget_error(self, key: str) -> None:
        """Delete the error of an episode that is run again, and what it had logged."""
        for path in (self.errors / f"{key}.json", self.errors / f"{key}.mcap"):
            path.unlink(missing_ok=True)

    def keep_evidence(self, key: str, text: str) -> None:
        """Keep the partial log of an episode in error as `errors/KEY.mcap`.

        Args:
            key: Key of the episode.
            text: Error of the episode.
        """
        log, kept = self.log(key), self.errors / f"{key}.mcap"
        partial = log.with_name(log.name + ENDING)
        if log.is_file():
            log.replace(kept)
        elif partial.is_file():
            with contextlib.suppress(InputError):  # it ended before the head was whole
                finish_partial(partial, kept, f"was ended ({text})", "")

    def forget_errors(self) -> None:
        """Delete errors, and logs of episodes with the outcome `error`, so that they run again.

        Raises:
            InputError: A log is damaged.
        """
        for path in (*self.errors.glob("*.json"), *self.errors.glob("*.mcap")):
            path.unlink()
        for path in self.logs.glob("*.mcap"):
            if open_log(path, allow_plugins=True).result["outcome"] == "error":
                path.unlink()

    def clear_partial(self) -> None:
        """Remove unfinished files of killed runs.

        Raises:
            InputError: A worker of a killed run is still writing.
        """
        left = (*self.logs.glob("*.thin"), *self.logs.glob("*.partial.*"))
        for path in (*left, *self.errors.glob("*.partial")):
            path.unlink()
        for path in self.logs.glob("*.partial"):
            remove_abandoned(path, WORKER_ENDS_S)

    def keep_study(self, study: StudyFile, contents: Contents) -> None:
        """Write the study into the folder, so that it can be reported without its files."""
        self.keep("study.json", study)
        self.keep("contents.json", contents)

    def keep(self, name: str, document: object) -> None:
        """Write a JSON document into the folder, atomically."""
        path = self.folder / name
        draft = path.with_suffix(".partial")
        draft.write_bytes(msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")
        draft.replace(path)

    def read_contents(self) -> Contents:
        """Return the identities of Wayproof and of the files that the study names.

        Raises:
            InputError: The list of them is damaged.
        """
        path = self.folder / "contents.json"
        try:
            return msgspec.json.decode(_bounded(path), type=Contents)
        except FileNotFoundError:
            return {}
        except (OSError, msgspec.DecodeError) as error:
            raise InputError(f"'{path}': {error}") from None

    def read_study(self, allow_plugins: bool = False) -> StudyFile:
        """Return the study of the folder.

        Raises:
            InputError: It is no folder of a study, or it names code that is not allowed.
        """
        try:
            study = msgspec.json.decode(_bounded(self.study), type=StudyFile)
        except (OSError, msgspec.DecodeError, RecursionError):
            raise InputError(f"'{self.folder}': no folder of a study (no study.json)") from None
        check_study(study)
        if not allow_plugins:
            refuse_code(study)
        return study


def _bounded(path: Path) -> bytes:
    """Return the content of a document of the folder, of bounded size.

    Raises:
        InputError: It is larger.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise InputError(f"'{path}': {size} bytes, expected at most {MOST_BYTES}")
    return path.read_bytes()


def merge(
    target: Store, sources: Sequence[Path], planned: Sequence[Planned], allow_plugins: bool = False
) -> int:
    """Copy the episodes of other folders of the same study into one.

    Args:
        target: The folder.
        sources: The others.
        planned: The study's episodes.
        allow_plugins: Whether code that a log's config names may be imported.

    Returns:
        How many were new.

    Raises:
        InputError: A folder is none of a study; a log is damaged, names code that is not allowed or
            is not of the episode that its name says; or two hold different results for one key.
            Then nothing has been copied.
    """
    episodes = {one.key: one for one in planned}
    found: dict[str, Path] = {path.stem: path for path in target.logs.glob("*.mcap")}
    new: dict[str, Path] = {}
    for folder in sources:
        if not (folder / "logs").is_dir():
            raise InputError(f"'{folder}': no folder of a study (it has no logs/)")
        for path in sorted((folder / "logs").glob("*.mcap")):
            known = found.setdefault(path.stem, path)
            if known is path:
                _chain(path, episodes, allow_plugins)  # whole, and what its name says
                new[path.stem] = path
            elif _chain(known, episodes, True) != _chain(path, episodes, allow_plugins):
                raise InputError(
                    f"episode {path.stem} has two different results: '{known}' and '{path}'"
                )
    for key, path in new.items():
        draft = target.log(key).with_suffix(".partial")
        shutil.copyfile(path, draft)
        os.replace(draft, target.log(key))
    return len(new)


def _chain(path: Path, episodes: Mapping[str, Planned], allow_plugins: bool) -> str:
    """Return the chain of the log of an episode.

    Raises:
        InputError: The log is not of the episode in its name.
    """
    if path.stem not in episodes:
        raise InputError(f"log '{path}': named by no episode of this study")
    return open_planned(path, episodes[path.stem], allow_plugins).result["chain"]
