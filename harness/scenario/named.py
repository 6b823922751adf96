"""What a config names, a world or a robot: one of a registry, or one that is read from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from wayproof.harness.errors import InputError, unknown_name
from wayproof.models.robots.custom import RobotSpecError
from wayproof.models.world_files import WorldFileError

HASHED = "@"
"""In a log's config, of what was read from a file: between its name and its hash."""

Registered = TypeVar("Registered")
Read = TypeVar("Read")


def find_named(
    kind: str,
    name: str,
    registry: Mapping[str, Registered],
    ending: str,
    read: Callable[[Path], Read],
) -> Registered | Read:
    """Look a name up, or read the file that stands in its place.

    Args:
        kind: Of what is looked for, in words.
        name: In the registry, or the path of a file.
        registry: What there is by name.
        ending: Of such a file.
        read: Reads one.

    Raises:
        InputError: No such name or file; or the name of what only its log still has.
    """
    if name.endswith(ending):
        try:
            return read(Path(name))
        except (WorldFileError, RobotSpecError) as error:
            raise InputError(f"{kind} '{name}': {error}") from None
    if HASHED in name:
        raise InputError(
            f"{kind} '{name}' was read from a file: expected the file, or a log with it"
        )
    if name not in registry:
        raise unknown_name(kind, name, registry)
    return registry[name]
