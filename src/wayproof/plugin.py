"""Classes of the user's own, by `module:Class` or `path/to/file.py:Class`.

Planners, controllers and stacks are loaded by it: it stands beside the packages, and imports none.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import modulefinder
import os
import re
import sys
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

SEPARATOR = ":"
"""Separator of the module or file and the class."""

FILE_NAME = re.compile(r"[\w.-]+(/[\w.-]+){0,9}\.\w{1,9}", re.ASCII)
"""A constant that may be the name of a file."""

SUFFIX = ".py"
"""A name whose first part ends so is a file; any other is a module on Python's path."""


class UserCodeError(Exception):
    """Failure of a user's class: an exception, or a breach of its interface.

    Attributes:
        who: The class, with what it is: `planner 'dogleg.py:Dogleg'`.
    """

    def __init__(self, who: str, what: str) -> None:
        """Name the class and say what it did, in one line."""
        super().__init__(f"{who} {what}")
        self.who = who


@contextlib.contextmanager
def user_code(who: str) -> Iterator[None]:
    """Run a user's code; any exception becomes a `UserCodeError`.

    `SystemExit` is no exception: a planner ends its episode, not the process. Ctrl-C is.

    Raises:
        UserCodeError: With the exception as its cause.
    """
    try:
        yield
    except (KeyboardInterrupt, UserCodeError):
        raise
    except BaseException as error:
        raise UserCodeError(who, f"raised {one_line(error)}") from error


def one_line(error: BaseException) -> str:
    """Return the type, the message and the place of an exception."""
    text = " ".join(str(error).split())[:300]
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    if isinstance(error, SyntaxError) and error.filename:
        text, place = error.msg, f" ({Path(error.filename).name}:{error.lineno})"
    return f"{type(error).__name__}{f': {text}' if text else ''}{place}"


def load_class(name: str) -> type[Any]:
    """Return the class of `module:Class` or `path/to/file.py:Class`.

    A relative path starts at the current folder. The file's folder is searched for what the file
    imports, after everything else.

    Raises:
        ValueError: One line: no such file or module, the class is not in it, or it raised.
    """
    place, separator, attribute = name.rpartition(SEPARATOR)
    if not separator or not place or not attribute:
        raise ValueError("expected module:Class or path/to/file.py:Class")
    try:
        module = _from_file(Path(place)) if place.endswith(SUFFIX) else _by_name(place)
    except ValueError:
        raise
    except (Exception, SystemExit) as error:
        raise ValueError(f"'{place}' raised {one_line(error)}") from None
    found = getattr(module, attribute, None)
    if not isinstance(found, type):
        own = [one for one in _classes(module) if one.__module__ == module.__name__]
        names = ", ".join(one.__name__ for one in own) or "none"
        raise ValueError(f"'{place}' has no class '{attribute}' (classes in it: {names})")
    return found


def source_digest(name: str) -> str:
    """Return the SHA-256 of all that a class is made of, in hex; empty without a file.

    See `files_of` for what counts.
    """
    file = source_file(name)
    if file is None:
        return ""
    place = name.rpartition(SEPARATOR)[0]
    return digest_of(files_of(file, "" if place.endswith(SUFFIX) else place))


def digest_of(files: Sequence[Path]) -> str:
    """Return the SHA-256 of files, in hex, whatever the first one's folder and name; else empty.

    That of one file is that of its content, as `sha256sum` prints it.
    """
    if not files:
        return ""
    first, *others = files
    digest = hashlib.sha256(first.read_bytes())
    for file in others:
        name = os.path.relpath(file, first.parent)
        digest.update(f"\0{name}\0{file.stat().st_size}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def files_of(file: Path, module: str = "") -> list[Path]:
    """Return a Python file and, sorted, the files that it rests on within its repository.

    These are the modules that it imports, also inside of functions, those that they import in turn,
    and the files beside a module that its code names in full, such as parameters or weights. What
    is installed does not count, nor what is found at run time alone. Nothing is run.

    Args:
        file: The file.
        module: Its dotted name, if it was imported by it.
    """
    file = file.resolve()
    finder = _OwnModules(file, levels=module.count(".") + (file.name == "__init__.py"))
    try:
        if module:
            finder.import_hook(module)
        else:
            finder.run_script(str(file))
    except (SyntaxError, ImportError, ValueError, OSError):  # the run says what is wrong with it
        pass
    found = {file}
    modules: dict[str, Any] = finder.modules
    for one in modules.values():
        if one.__file__:
            path = Path(one.__file__).resolve()
            found |= {path, *_named_files(one.__code__, path.parent, finder.root)}
    return [file, *sorted(found - {file})]


PACKAGE = modulefinder._PKG_DIRECTORY  # type: ignore[attr-defined]
"""Kind of a module that is a folder."""


class _OwnModules(modulefinder.ModuleFinder):
    """Finds the modules of one repository that a file imports.

    Attributes:
        root: Folder of the repository; of none that of the file.
    """

    def __init__(self, file: Path, levels: int) -> None:
        """Search the file's folder, and what of Python's path lies in its repository.

        Args:
            file: File that imports.
            levels: Number of packages that it lies in.
        """
        folder = file.parents[levels]
        above = (folder, *folder.parents)
        self.root = root = next((one for one in above if (one / ".git").exists()), folder)
        path = [Path(one).resolve() for one in sys.path]
        own = [one for one in path if one.is_relative_to(root) and not _is_installed(one)]
        self._only = file.relative_to(folder).parts[0] if _is_installed(folder) else ""
        super().__init__([str(folder), *map(str, own)])

    def find_module(self, name: str, path: Any, parent: Any = None) -> Any:
        """Find a module as usual, but none of Wayproof's, whose digest is the program's.

        For a module that is installed none but those of its own package.
        """
        if parent is None and (name == "wayproof" or self._only not in ("", name, f"{name}.py")):
            raise ImportError(name)
        try:
            return super().find_module(name, path, parent)
        except AttributeError:  # it expects a loader, which a folder without __init__.py has not
            folders = [Path(one) / name for one in path or self.path]
            folder = next((one for one in folders if one.is_dir()), None)
            if folder is None:
                raise ImportError(name) from None
            return None, str(folder), ("", "", PACKAGE)

    def load_package(self, fqname: str, pathname: str) -> Any:
        """Load a package, or a folder without `__init__.py` as one."""
        if (Path(pathname) / "__init__.py").exists():
            return super().load_package(fqname, pathname)
        package: Any = self.add_module(fqname)
        package.__path__ = [pathname]
        return package


def _is_installed(folder: Path) -> bool:
    return "site-packages" in folder.parts or "dist-packages" in folder.parts


def _named_files(code: CodeType | None, folder: Path, root: Path) -> set[Path]:
    """Return the files that constants of code name, in or above a folder or one level below these.

    Args:
        code: Code of a module, with that of its functions.
        folder: The module's.
        root: Highest folder.
    """
    found: set[Path] = set()
    above = [one for one in (folder, *folder.parents) if one.is_relative_to(root)]
    for constant in () if code is None else code.co_consts:
        if isinstance(constant, CodeType):
            found |= _named_files(constant, folder, root)
        elif isinstance(constant, str) and FILE_NAME.fullmatch(constant):
            paths = [path for one in above for path in (one / constant, *one.glob(f"*/{constant}"))]
            files = {path.resolve() for path in paths if path.is_file()}
            found |= {path for path in files if path.is_relative_to(root)}
    return found


def source_file(name: str) -> Path | None:
    """Return the file of a class, if there is one now."""
    place = name.rpartition(SEPARATOR)[0]
    if place.endswith(SUFFIX):
        file = Path(place)
    else:
        try:
            spec = importlib.util.find_spec(place)
        except (ImportError, ValueError):  # no such package, or a module of no file
            return None
        file = Path((None if spec is None else spec.origin) or "")
    return file if file.is_file() else None


def _classes(module: ModuleType) -> list[type[Any]]:
    return [value for value in vars(module).values() if isinstance(value, type)]


def _by_name(name: str) -> ModuleType:
    if name not in sys.modules and importlib.util.find_spec(name) is None:
        raise ValueError(f"no module '{name}' on Python's path, expected one, or a file's path")
    return importlib.import_module(name)


def _from_file(path: Path) -> ModuleType:
    """Return the module of a file, loaded once for each content that the file has."""
    if not path.is_file():
        raise ValueError(f"no file '{path}' (looked for in '{Path.cwd()}')")
    path = path.resolve()
    digest = hashlib.sha256(bytes(path) + b"\0" + path.read_bytes()).hexdigest()
    name = f"{path.stem}_{digest[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
