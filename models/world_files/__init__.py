"""Worlds from files of other tools, and the world files that they become."""

from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.shape import shape_digest
from wayproof.models.world_files.world_file import (
    FileWorld,
    read_world_file,
    world_in_scene,
    world_of,
    world_text,
)

__all__ = [
    "FileWorld",
    "Found",
    "ImportOptions",
    "WorldFileError",
    "read_world_file",
    "shape_digest",
    "world_in_scene",
    "world_of",
    "world_text",
]
