"""Catalogue of worlds, robots, settings and all else that has a name, as a file of the package.

It is generated from the registries, so that listing and completing names loads no simulator.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

FILE = Path(__file__).parent / "catalogue.json"
"""The file; `python -m docs.generate` writes it, and a test compares it with the code."""


class Entry(msgspec.Struct, frozen=True, omit_defaults=True):
    """Description of one name.

    Attributes:
        meaning: One or two sentences.
        source: Paper or data sheet; else the file of the clone that declares it.
        type: Type of a setting: `float`, `int`, `bool`, `str`, or as Python writes it.
        default: Default of a setting as `--set` takes it; empty where it has none.
        unit: Unit of a number, a metric or the amounts of a perturbation.
        bounds: Least and greatest value of a setting.
        choices: Values of a setting, modes of a perturbation.
        amounts: Amounts of a perturbation at severities 1 to 5, in `unit`.
    """

    meaning: str
    source: str = ""
    type: str = ""
    default: str = ""
    unit: str = ""
    bounds: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    amounts: tuple[float, ...] = ()


Catalogue = dict[str, dict[str, Entry]]
"""Kind -> name -> entry."""


def read_catalogue() -> Catalogue:
    """Read the catalogue of this version."""
    return msgspec.json.decode(FILE.read_bytes(), type=Catalogue)


def encode(catalogue: Catalogue) -> bytes:
    """Encode a catalogue as the file holds it, a value a line."""
    return msgspec.json.format(msgspec.json.encode(catalogue), indent=1) + b"\n"


def matching(catalogue: Catalogue, name: str) -> Catalogue:
    """Return entries of a name: a kind, a name, or a section of the settings such as `map`."""
    if name in catalogue:
        return {name: catalogue[name]}
    section = f"{name.rstrip('.')}."
    found = {
        kind: {
            key: entry for key, entry in entries.items() if key == name or key.startswith(section)
        }
        for kind, entries in catalogue.items()
    }
    return {kind: entries for kind, entries in found.items() if entries}


def document_of(catalogue: Catalogue) -> dict[str, Any]:
    """Return a catalogue as plain JSON values."""
    document: dict[str, Any] = msgspec.to_builtins(catalogue)
    return document
