"""The size of the project, to be looked at: `make size`. It enforces nothing."""

from __future__ import annotations

import ast
import json
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ("harness", "models", "maps", "planners", "src/wayproof")
GENERATED = ("_pb2.py", "_pb2.pyi")

COUNTED = {
    "verbs": ("harness/cli/__init__.py", "VERBS"),
    "kinds of reason": ("harness/stack/reasons.py", "Kind"),
    "causes": ("harness/attribution/finding.py", "CAUSES"),
}
"""What a reader must know -> the file and the name of the list that holds it."""


class Size(NamedTuple):
    """Sum over Python files."""

    lines: int
    files: int
    classes: int


def tracked(*folders: str) -> list[Path]:
    """Return the Python files of the project below folders, without generated ones."""
    command = ["git", "ls-files", *(f"{folder}/*.py" for folder in folders)]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    paths = [ROOT / name for name in names.split("\n") if name and not name.endswith(GENERATED)]
    return [path for path in paths if path.exists()]


def size_of(paths: Iterable[Path]) -> Size:
    """Return the size of files."""
    texts = [path.read_text() for path in paths]
    nodes = (node for text in texts for node in ast.walk(ast.parse(text)))
    classes = sum(isinstance(node, ast.ClassDef) for node in nodes)
    return Size(sum(text.count("\n") for text in texts), len(texts), classes)


def parts() -> Iterator[tuple[str, Size]]:
    """Return the size of each package, of the parts of the harness, and of all source."""
    for package in SOURCE:
        yield package, size_of(tracked(package))
        if package == "harness":
            yield (
                "  (root)",
                size_of(path for path in tracked(package) if path.parent.name == package),
            )
            for folder in sorted(path for path in (ROOT / package).iterdir() if path.is_dir()):
                if found := tracked(f"{package}/{folder.name}"):
                    yield f"  {folder.name}", size_of(found)
    yield "source", size_of(tracked(*SOURCE))
    tools = [path for path in tracked("tests") if "tools" in path.parts]
    yield "tests", size_of(path for path in tracked("tests") if path not in tools)
    yield "tests/tools", size_of(tools)


def members(file: str, name: str) -> int:
    """Return the number of members of a tuple, dict or Literal that a module assigns to a name."""
    for node in ast.parse((ROOT / file).read_text()).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            value = node.value  # type: ignore[attr-defined]
            held = value.slice if isinstance(value, ast.Subscript) else value
            return len(held.keys if isinstance(held, ast.Dict) else held.elts)
    raise LookupError(f"{file} assigns nothing to {name}")


def words(paths: Iterable[Path]) -> int:
    """Return the number of words of text files."""
    return sum(len(path.read_text().split()) for path in paths)


def main() -> None:
    """Print the sizes."""
    print(f"{'':16}{'lines':>8}{'files':>7}{'classes':>9}")
    for name, size in parts():
        print(f"{name:16}{size.lines:8}{size.files:7}{size.classes:9}")
    catalogue = json.loads((ROOT / "harness/cli/catalogue.json").read_text())
    print(f"settings: {len(catalogue['settings'])}")
    for name, place in COUNTED.items():
        print(f"{name}: {members(*place)}")
    pages = [*(ROOT / "docs").rglob("*.md")]
    print(
        f"pages: {len(pages)}, words: {words(pages)}; changelog: {words([ROOT / 'CHANGELOG.md'])}"
    )


if __name__ == "__main__":
    main()
