"""Search of the models and files that a world names, as Gazebo resolves them.

A name is looked up in the folders that a project or the user sets up for it. A file counts only if
it lies, symbolic links resolved, in the project of the world or in one of those folders.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import unquote

from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.xml_tree import read_xml

VARIABLES = (
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "GAZEBO_MODEL_PATH",
    "GAZEBO_RESOURCE_PATH",
)
"""Environment variables with folders of models, as Gazebo reads them."""

FUEL_CACHES = (".gz/fuel", ".ignition/fuel", ".gazebo/models")
"""Folders of models downloaded by Gazebo, in the user's folder."""

PROJECT_MARKS = ("package.xml", ".git")
"""Files that mark the folder of a project: of a ROS package, or of a repository."""

MEDIA = ("Media/models", "media/models")
"""Folders of meshes in a package that exports a `gazebo_media_path`."""

MAX_ANCESTORS = 6
"""Number of folders above a world in which its project is looked for."""

MODEL_FILES = ("model.sdf", "model.urdf")

NEWEST_SDF = (1, 12)
"""Newest version of SDF that is read."""

SCHEMES = ("model://", "package://", "file://", "http://", "https://", "fuel://")


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
        home = world.parent.resolve()
        projects = [folder for folder in _ancestors(home) if _is_project(folder)]
        given = list(model_paths)
        for folder in given:
            if not folder.is_dir():
                raise WorldFileError(folder, "no folder of models (--model-path)")
        named = [
            Path(entry)
            for variable in VARIABLES
            for entry in os.environ.get(variable, "").split(os.pathsep)
            if entry
        ]
        self._caches = [Path.home() / cache for cache in FUEL_CACHES]
        near = [home, home / "models", home.parent / "models"]
        near += [inner for folder in projects for inner in (folder, folder / "models")]
        near += [folder / media for folder in projects for media in MEDIA]
        packages = {_name_in(folder / "package.xml"): folder for folder in projects}
        self._packages = {name: folder for name, folder in packages.items() if name}
        trusted = [folder for folder in (*given, *named, *self._caches) if folder.is_dir()]
        self.folders = list(dict.fromkeys([*given, *near, *named, *self._caches]))
        self._siblings = [folder.parent for folder in self._packages.values()]
        self._roots = {folder.resolve() for folder in (*near, *trusted) if folder.is_dir()}
        self._trusted = set(trusted)

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
                inner = _newest_version(found)
                for file in _model_files(inner):
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
        for found in self._candidates(uri, user):
            if found.is_file():
                return self._checked(found)
        return None

    def name_of(self, uri: str) -> str:
        """Return the name of the model that a URI means, in lower case with underscores."""
        words = [word for word in _bare(uri).split("/") if word]
        if "models" in words[:-1] and uri.strip().startswith(("http", "fuel")):
            words = words[words.index("models") + 1 :][:1]
        return (words[-1] if words else "").lower().replace(" ", "_")

    def _candidates(self, uri: str, user: Path | None) -> Iterator[Path]:
        text = uri.strip()
        name = _bare(text)
        if not name:
            return
        if text.startswith(("http://", "https://", "fuel://")):
            yield from self._in_caches(name)
            words = name.split("/")
            if "models" not in words[:-1]:
                return
            inner = words[words.index("models") + 1 :]
            name = "/".join([inner[0], *_after_files(inner[1:])])
        if user is not None and text.startswith(SCHEMES[:1]):
            model, _, inner_name = name.partition("/")
            for folder in _ancestors(user.parent.resolve()):
                if folder.name == model or _name_in(folder / "model.config") == model:
                    yield folder / inner_name
        if user is not None and not text.startswith(SCHEMES[:2]):
            yield user.parent / name
        head, _, rest = name.partition("/")
        if head in self._packages:
            yield self._packages[head] / rest
        for folder in self.folders:
            yield folder / name
            yield folder / name.replace(" ", "_")
            yield folder / name.replace(" ", "_").lower()
        for folder in self._siblings:
            beside = folder / head
            if head and (_name_in(beside / "package.xml") or (beside / "model.config").is_file()):
                yield folder / name

    def _in_caches(self, name: str) -> Iterator[Path]:
        """Yield a model or its file of a Fuel server, as `fuel_tools` lays out its cache."""
        words = name.split("/")
        if len(words) < 4 or "models" not in words:
            return
        at = words.index("models")
        server, owner = words[0], words[at - 1].lower()
        for cache in self._caches:
            for model in (words[at + 1].lower(), words[at + 1]):
                folder = cache / server / owner / "models" / model
                if folder.is_dir():
                    yield _newest_version(folder).joinpath(*_after_files(words[at + 2 :]))

    def _checked(self, found: Path) -> Path:
        """Refuse a path outside; a model that the user's folders link to is inside."""
        resolved = found.resolve()
        for folder in self._trusted:
            if found.is_relative_to(folder) and found != folder:
                entry = folder / found.relative_to(folder).parts[0]
                if entry.exists():
                    self._roots.add(entry.resolve())
        if not any(resolved.is_relative_to(root) for root in self._roots):
            raise WorldFileError(
                found, "lies outside the world's project; expected --model-path with its folder"
            )
        return resolved


def _bare(uri: str) -> str:
    """Return the path of a URI without its scheme, with %20 and the like decoded."""
    text = uri.strip()
    for scheme in SCHEMES:
        if text.startswith(scheme):
            text = text[len(scheme) :]
            break
    return unquote(text).rstrip("/")


def _ancestors(folder: Path) -> list[Path]:
    return [folder, *folder.parents][:MAX_ANCESTORS]


def _is_project(folder: Path) -> bool:
    return any((folder / mark).exists() for mark in PROJECT_MARKS)


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
    named = []
    try:
        listed = list(read_xml(folder / "model.config").all("sdf"))
        versions = [_version(one.attributes.get("version", "")) for one in listed]
        known = [version if version <= NEWEST_SDF else (0,) for version in versions]
        best = listed[known.index(max(known))].text.strip() if listed else ""
        named = [folder / best] if best and ".." not in best else []
    except WorldFileError:
        pass
    return [*named, *(folder / name for name in MODEL_FILES)]


def _version(text: str) -> tuple[int, ...]:
    words = text.strip().split(".")
    return tuple(map(int, words)) if all(word.isdecimal() for word in words) else (0,)


def _newest_version(folder: Path) -> Path:
    """Return the folder of the newest version in a cache of models, or the folder itself."""
    versions = [inner for inner in folder.iterdir() if inner.name.isdecimal() and inner.is_dir()]
    return max(versions, key=lambda inner: int(inner.name), default=folder)


def _after_files(words: list[str]) -> list[str]:
    """Return the path after `VERSION/files` in a URI of Fuel."""
    return words[words.index("files") + 1 :] if "files" in words else []
