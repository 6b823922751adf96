"""Search of the models and files that a world names, as Gazebo resolves them.

A name is looked up in the folders that a project or the user sets up for it. A file counts only if
it lies, symbolic links resolved, in the project of the world or in one of those folders.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import unquote

from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.xml_tree import read_xml

VARIABLES = (
    "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH",
)  # fmt: skip
"""Environment variables with folders of models, as Gazebo reads them."""

CACHES = (".gz/fuel/*/*/models", ".ignition/fuel/*/*/models", ".gazebo/models")
"""Folders of models downloaded by Gazebo, in the user's folder."""

PROJECT_MARKS = ("package.xml", ".git")
"""Files that mark the folder of a project: of a ROS package, or of a repository."""

INNER = ("", "models", "Media/models", "media/models")
"""Folders of models and meshes in a project; the last two by its `gazebo_media_path`."""

MAX_ANCESTORS = 6
"""Number of folders above a world in which its project is looked for."""

NEWEST_SDF = (1, 12)
"""Newest version of SDF that is read."""

SCHEME = re.compile(r"(model|package|file|https?|fuel)://")

FUEL = re.compile(r".*?([^/]+)/models/([^/]+)(?:/\d+|/tip)?(?:/files)?(/.*)?$")
"""Path of a model on a Fuel server: owner, name, and a file in it behind `VERSION/files`."""


class Locator:
    """The folders in which one world's models and meshes are looked up."""

    def __init__(self, world: Path, model_paths: Iterable[Path] = ()) -> None:
        """Collect the folders that exist.

        Args:
            world: The file that is imported.
            model_paths: Folders of the user with models in them, searched first.

        Raises:
            WorldFileError: One of the user's is no folder.
        """
        home, given = world.parent.resolve(), list(model_paths)
        for folder in given:
            if not folder.is_dir():
                raise WorldFileError(folder, "no folder of models (--model-path)")
        projects = [folder for folder in _ancestors(home)
                    if any((folder / mark).exists() for mark in PROJECT_MARKS)]  # fmt: skip
        near = [home, home / "models", home.parent / "models"]
        near += [folder / inner for folder in projects for inner in INNER]
        named = [
            Path(entry)
            for variable in VARIABLES
            for entry in os.environ.get(variable, "").split(os.pathsep)
            if entry
        ]
        caches = [folder for cache in CACHES for folder in sorted(Path.home().glob(cache))]
        packages = {_name_in(folder / "package.xml"): folder for folder in projects}
        self._packages = {name: folder for name, folder in packages.items() if name}
        self._folders = list(dict.fromkeys([*given, *near, *named, *caches]))
        self._trusted = {folder for folder in (*given, *named, *caches) if folder.is_dir()}
        self._roots = {folder.resolve() for folder in (*near, *self._trusted) if folder.is_dir()}

    def model(self, uri: str) -> Path | None:
        """Return the SDF or URDF of an included model; None if it is not there.

        Raises:
            WorldFileError: It lies outside of every folder of the search.
        """
        for found in self._candidates(uri, None):
            if found.is_file():
                return self._checked(found)
            if found.is_dir():
                self._checked(found)
                for file in _model_files(_newest_version(found)):
                    if file.is_file():
                        return self._checked(file)
        return None

    def file(self, uri: str, user: Path) -> Path | None:
        """Return a file, such as a mesh, that a model names; None if it is not there.

        Args:
            uri: As the model writes it.
            user: File of the model that names it; its folder is the model's own.

        Raises:
            WorldFileError: It lies outside of every folder of the search.
        """
        candidates = self._candidates(uri, user)
        return next((self._checked(found) for found in candidates if found.is_file()), None)

    def name_of(self, uri: str) -> str:
        """Return the name of the model that a URI means, in lower case with underscores."""
        _, name, owner = _path_of(uri)
        name = name.partition("/")[0] if owner else name.rpartition("/")[2]
        return name.lower().replace(" ", "_")

    def _candidates(self, uri: str, user: Path | None) -> Iterator[Path]:
        scheme, name, owner = _path_of(uri)
        if not name:
            return
        head, _, rest = name.partition("/")
        if user is not None and scheme == "model":
            for folder in _ancestors(user.parent.resolve()):
                if folder.name == head or _name_in(folder / "model.config") == head:
                    yield folder / rest
        if user is not None and scheme not in ("model", "package"):
            yield user.parent / name
        if head in self._packages:
            yield self._packages[head] / rest
        for folder in self._folders:
            if owner and "fuel" in folder.parts and folder.parent.name.lower() != owner:
                continue
            for own in dict.fromkeys((head, head.replace(" ", "_"),
                                      head.replace(" ", "_").lower(), head.lower())):  # fmt: skip
                model = folder / own
                yield model / rest
                if owner and rest and model.is_dir():
                    yield _newest_version(model) / rest
        for package in self._packages.values():
            beside = package.parent / head
            if _name_in(beside / "package.xml") or (beside / "model.config").is_file():
                yield beside / rest

    def _checked(self, found: Path) -> Path:
        """Refuse a path outside; a model that the user's folders link to is inside."""
        resolved = found.resolve()
        for folder in self._trusted:
            if found.is_relative_to(folder) and found != folder:
                self._roots.add((folder / found.relative_to(folder).parts[0]).resolve())
        if not any(resolved.is_relative_to(root) for root in self._roots):
            raise WorldFileError(
                found, "lies outside the world's project; expected --model-path with its folder"
            )
        return resolved


def _path_of(uri: str) -> tuple[str, str, str]:
    """Return scheme and path of a URI, with %20 and the like decoded, and its owner on Fuel.

    The path of a model on Fuel begins with the model's name.
    """
    text = uri.strip()
    scheme = match[1] if (match := SCHEME.match(text)) else ""
    path = unquote(SCHEME.sub("", text, count=1)).rstrip("/")
    if scheme in ("http", "https", "fuel"):
        fuel = FUEL.match(path)
        return (scheme, fuel[2] + (fuel[3] or ""), fuel[1].lower()) if fuel else (scheme, "", "")
    return scheme, path, ""


def _ancestors(folder: Path) -> list[Path]:
    return [folder, *folder.parents][:MAX_ANCESTORS]


def _name_in(file: Path) -> str:
    """Return the name in a `package.xml` or `model.config`; empty without one."""
    try:
        name = read_xml(file).first("name")
    except WorldFileError:
        return ""
    return "" if name is None else name.text.strip()


def _model_files(folder: Path) -> list[Path]:
    """Return the candidate files of a folder's model: by its `model.config`, or by its name.

    Of the files that a `model.config` lists, it is that of the highest version which sdformat can
    read, and the first of those without a version, as in sdformat's `parser.cc`.
    """
    best = ""
    try:
        listed = list(read_xml(folder / "model.config").all("sdf"))
        versions = [_version(one.attributes.get("version", "")) for one in listed]
        known = [version if version <= NEWEST_SDF else (0,) for version in versions]
        best = listed[known.index(max(known))].text.strip() if listed else ""
    except WorldFileError:
        pass
    names = [best] if best and ".." not in best else []
    return [folder / name for name in (*names, "model.sdf", "model.urdf")]


def _version(text: str) -> tuple[int, ...]:
    words = text.strip().split(".")
    return tuple(map(int, words)) if all(word.isdecimal() for word in words) else (0,)


def _newest_version(folder: Path) -> Path:
    """Return the folder of the newest version in a cache of models, or the folder itself."""
    versions = [inner for inner in folder.iterdir() if inner.name.isdecimal() and inner.is_dir()]
    return max(versions, key=lambda inner: int(inner.name), default=folder)
