"""Output files: each whole or not at all, and none in place of a device or folder.

A file grows under `NAME.partial`, whose lock one writer at a time holds, and takes its name
by an atomic rename. So two writers never mix, a device or a folder is never replaced, and what a
killed writer left is not overwritten.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import itertools
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from wayproof.harness.errors import InputError

ENDING = ".partial"
"""Suffix of a file that is being written."""

POLL_S = 0.05

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFLNK: "a link",
}
"""Names of the kinds of path that are no regular file."""


class Draft:
    """A file's name, held against every other writer until it is published or released.

    Attributes:
        path: The file's own name.
        partial: Its name until then.
        file: The partial file, empty, open for writing in binary.
        kept: New place of the partial file of an earlier, killed writer; None if there was
            none.
    """

    def __init__(self, path: Path, what: str = "log", keep: bool = True) -> None:
        """Take the name.

        Args:
            path: The file's own name; the folder is made if need be.
            what: Kind of file, for messages.
            keep: Whether the partial file of a killed writer is moved aside and not overwritten.

        Raises:
            InputError: The name is that of a folder, a device, a pipe, a socket or a dangling link;
                the folder cannot be written to; or another writer holds the name.
        """
        self.path = path
        self.partial = path.with_name(path.name + ENDING) if path.name else path
        self.kept: Path | None = None
        self._what, self._keep = what, keep
        check_target(path, what)
        try:
            self._made = _missing_folders(path.parent)
            self.file = os.fdopen(self._take(), "wb")
        except OSError as error:
            raise InputError(f"{what} '{path}': {error.strerror}") from None

    def publish(self, source: Path | None = None) -> None:
        """Give the file its name.

        Args:
            source: Another file that takes the name in place of the partial one, which is removed.

        Raises:
            InputError: Something else has taken the partial file away meanwhile.
            OSError: It cannot be written or renamed.
        """
        self.file.flush()
        os.fsync(self.file.fileno())
        if not self._is_ours():
            raise InputError(f"{self._what} '{self.path}': '{self.partial}' was taken away")
        check_target(self.path, self._what)
        (source or self.partial).replace(self.path)
        if source is not None:
            self.partial.unlink()
        self.file.close()

    def discard(self) -> None:
        """Remove the partial file and the folders made for it, and release the name."""
        if self.file.closed:
            return
        if self._is_ours():
            self.partial.unlink()
        self._close()
        with contextlib.suppress(OSError):  # another one writes there by now
            for folder in self._made:
                folder.rmdir()

    def release(self) -> None:
        """Release the name; the partial file stays unless it is empty."""
        if self.file.closed:
            return
        with contextlib.suppress(OSError):  # the disk may be full
            self.file.flush()
        if os.fstat(self.file.fileno()).st_size == 0:
            self.discard()
        else:
            self._close()

    def __enter__(self) -> Draft:
        """Return the draft itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Release the name, also after an exception."""
        self.release()

    def _close(self) -> None:
        with contextlib.suppress(OSError):
            self.file.close()

    def _take(self) -> int:
        """Return the descriptor of a new partial file, locked.

        A lock belongs to what was opened, not to its name: whoever gets one makes sure that the
        name still leads there, for the holder before may have renamed or removed it meanwhile.
        """
        check_target(self.partial, self._what)
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        while True:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                descriptor = os.open(self.partial, flags, 0o666)
            except FileNotFoundError:
                if self.path.parent.is_dir():
                    raise
                continue  # the folder was another one's, and is gone with it
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(descriptor)
                if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                    raise
                raise InputError(
                    f"{self._what} '{self.path}': another run is writing it, "
                    "expected a name of its own for each"
                ) from None
            held = os.fstat(descriptor)
            if not _leads_to(self.partial, held):
                os.close(descriptor)
            elif held.st_size and self._keep:
                self.kept = self._move_aside()
                os.close(descriptor)
            else:
                os.ftruncate(descriptor, 0)
                return descriptor

    def _move_aside(self) -> Path:
        """Keep the partial file of a killed writer, perhaps the only trace; its lock is held."""
        number = 1
        while (aside := self.partial.with_name(f"{self.partial.name}.{number}")).exists():
            number += 1
        self.partial.rename(aside)
        return aside

    def _is_ours(self) -> bool:
        return _leads_to(self.partial, os.fstat(self.file.fileno()))


def remove_abandoned(partial: Path, longest_s: float) -> None:
    """Remove the partial file of a writer that was killed.

    Args:
        partial: The file.
        longest_s: Time to wait for a writer that is about to end, s.

    Raises:
        InputError: It is still being written.
    """
    deadline = time.monotonic() + longest_s
    with partial.open("rb") as file:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= deadline:
                    raise InputError(f"'{partial}': another process is writing it") from None
                time.sleep(POLL_S)
        if _leads_to(partial, os.fstat(file.fileno())):
            partial.unlink()


def _missing_folders(folder: Path) -> list[Path]:
    """Return the folder and those above it that are not there, the deepest first."""
    return list(itertools.takewhile(lambda one: not one.exists(), (folder, *folder.parents)))


def _leads_to(path: Path, held: os.stat_result) -> bool:
    try:
        return os.path.samestat(path.lstat(), held)
    except FileNotFoundError:
        return False


def check_target(path: Path, what: str) -> None:
    """Refuse a name that no file can be written under, before any work is done for it.

    Args:
        path: The file's name; there may be a file already, which is replaced.
        what: Kind of file, for messages.

    Raises:
        InputError: There is a folder, a device, a pipe, a socket or a dangling link.
    """
    if path.name.endswith(ENDING * 2):
        name = path.name.removesuffix(ENDING)
        raise InputError(f"{what} '{name}': ends in {ENDING}, as the name of an unfinished file")
    try:
        found = path.stat().st_mode if path.exists() else path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise InputError(f"{what} '{path}': {error.strerror}") from None
    if not stat.S_ISREG(found):
        kind = KINDS.get(stat.S_IFMT(found), "no regular file")
        raise InputError(f"{what} '{path}': {kind}, expected the name of a file")


@contextlib.contextmanager
def written_whole(path: Path, what: str) -> Iterator[Path]:
    """Yield a temporary name to write a file under; it takes its own name on success.

    Args:
        path: The file's own name.
        what: Kind of file, for messages.

    Raises:
        InputError: As `Draft`, or the disk is full.
    """
    with Draft(path, what, keep=False) as draft:
        try:
            yield draft.partial
            draft.publish()
        except OSError as error:
            raise InputError(f"{what} '{path}': {error.strerror or error}") from None
        finally:
            draft.discard()
