"""Worlds and robots by name: from a registry, or read from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from wayproof.harness.config import HASH_SEPARATOR
from wayproof.harness.errors import InputError, unknown_name
from wayproof.models.robots.custom import RobotSpecError
from wayproof.models.world_files import WorldFileError

Registered = TypeVar("Registered")
Read = TypeVar("Read")


def find_named(
    kind: str,
    name: str,
    registry: Mapping[str, Registered],
    ending: str,
    read: Callable[[Path], Read],
) -> Registered | Read:
    """Look up a name in a registry, or read the file of that path.

    Args:
        kind: Kind of the thing, for messages.
        name: Name in the registry, or path of a file.
        registry: Available things by name.
        ending: Suffix of such a file.
        read: Reader of such a file.

    Raises:
        InputError: No such name or file; or an identity whose content is only in its log.
    """
    if name.endswith(ending):
        try:
            return read(Path(name))
        except (WorldFileError, RobotSpecError) as error:
            raise InputError(f"{kind} '{name}': {error}") from None
    if HASH_SEPARATOR in name:
        raise InputError(
            f"{kind} '{name}' was read from a file: expected the file, or a log with it"
        )
    if name not in registry:
        raise unknown_name(kind, name, registry)
    return registry[name]
