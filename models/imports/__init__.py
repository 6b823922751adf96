"""Worlds from files of other tools, and the world files that they become."""

from wayproof.models.imports.importer import FORMATS, import_world
from wayproof.models.imports.options import Found, ImportOptions
from wayproof.models.imports.reading import Unreadable
from wayproof.models.imports.world_file import FileWorld, read_world_file, world_of, world_text

__all__ = [
    "FORMATS",
    "FileWorld",
    "Found",
    "ImportOptions",
    "Unreadable",
    "import_world",
    "read_world_file",
    "world_of",
    "world_text",
]
