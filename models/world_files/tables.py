"""Tables of spherical obstacles (`.csv`), as the flight fields of the DodgeDrone challenge are.

A line holds name, x, y, z, qw, qx, qy, qz, sx, sy, sz: a sphere about (x, y, z) whose diameter is
sx = sy = sz, m.
"""

from __future__ import annotations

import csv
from pathlib import Path

from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.reading import MAX_SOLIDS, WorldFileError, read_text

COLUMNS = 11

MAX_OFFSET = 500.0
"""Distance beyond which the published fields have put spheres away, m."""


def read_table(path: Path, options: ImportOptions) -> Found:
    """Read spheres from a table.

    Raises:
        WorldFileError: Naming the malformed line.
    """
    found = Found(plane=True)
    for number, row in enumerate(csv.reader(read_text(path).splitlines()), start=1):
        if row:
            found.parts.append(_sphere(path, number, row))
        if len(found.parts) > MAX_SOLIDS:
            raise WorldFileError(path, f"more than {MAX_SOLIDS} obstacles", number)
    away = [part for part in found.parts if max(map(abs, part.position)) > MAX_OFFSET]
    if away:
        found.parts = [part for part in found.parts if part not in away]
        found.notes.append(f"{len(away)} spheres more than {MAX_OFFSET:g} m away: left out")
    return found


def _sphere(path: Path, line: int, row: list[str]) -> Part:
    expected = "name, x, y, z, qw, qx, qy, qz, sx, sy, sz"
    if len(row) != COLUMNS:
        raise WorldFileError(path, f"{len(row)} columns, expected {expected}", line)
    try:
        x, y, z, *_, length, width, height = (float(word) for word in row[1:])
        if not length == width == height:
            sizes = f"{length:g} x {width:g} x {height:g} m"
            raise ValueError(f"a sphere of {sizes}, expected one diameter")
        return Part("sphere", (length / 2.0,), (x, y, z))
    except ValueError as error:
        raise WorldFileError(path, str(error), line) from None
