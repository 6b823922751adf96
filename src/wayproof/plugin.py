"""Classes of the user's own, by `module:Class` or `path/to/file.py:Class`.

Planners, controllers and stacks are loaded by it: it stands beside the packages, and imports none.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

SEPARATOR = ":"
"""Separator of the module or file and the class."""

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
    """Return the SHA-256 of the file that a class was loaded from, in hex; empty without one."""
    file = source_file(name)
    return "" if file is None else hashlib.sha256(file.read_bytes()).hexdigest()


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
