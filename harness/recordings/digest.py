"""Hash of the files of a recording."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

PIECE = 2**20


def digest_of(files: Sequence[Path]) -> str:
    """Return the SHA-256 of a file, or of the names and contents of several, hexadecimal.

    The hash of one file is the one that `sha256sum` prints. Of several, each is hashed, and then
    the lines of `sha256sum`: hash, two spaces, name.
    """
    digests = [_of_file(path) for path in files]
    if len(files) == 1:
        return digests[0]
    lines = [f"{digest}  {path.name}\n" for digest, path in zip(digests, files, strict=True)]
    return hashlib.sha256("".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def _of_file(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
    return digest.hexdigest()
