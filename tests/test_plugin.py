"""What a class of the user's own is made of: all of its code, and no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from wayproof.harness.interface.connect import code_digest
from wayproof.plugin import files_of


@pytest.fixture
def nav(tmp_path: Path) -> Path:
    (tmp_path / ".git").mkdir()
    (tmp_path / "lib").mkdir()
    (tmp_path / "config").mkdir()
    for name, text in {
        "nav.py": "import numpy\nimport lib.more\nfrom params import MARGIN\n"
        "def later():\n    from lib import late\n    return open('config/speeds.yaml')\n",
        "params.py": "MARGIN = 0.15\n",
        "lib/__init__.py": "",
        "lib/more.py": "WEIGHTS = 'weights.npz'\n",
        "lib/late.py": "",
        "lib/weights.npz": "0",
        "lib/unused.py": "",
        "config/speeds.yaml": "slow: 0.5\n",
        "notes.md": "",
    }.items():
        (tmp_path / name).write_text(text)
    return tmp_path / "nav.py"


def test_a_class_is_made_of_what_it_imports_and_names(nav: Path) -> None:
    names = [str(one.relative_to(nav.parent)) for one in files_of(nav)]
    assert names == [
        *("nav.py", "config/speeds.yaml", "lib/__init__.py", "lib/late.py", "lib/more.py"),
        *("lib/weights.npz", "params.py"),
    ]


@pytest.mark.parametrize("name", ["{}:Nav", "exec:python {} --fast", "exec:wayproof serve {}:Nav"])
@pytest.mark.parametrize(
    ("file", "counts"),
    [
        *((name, True) for name in ("params.py", "config/speeds.yaml", "lib/late.py")),
        *((name, False) for name in ("notes.md", "lib/unused.py")),
    ],
)
def test_a_change_of_a_part_is_another_identity(
    nav: Path, name: str, file: str, counts: bool
) -> None:
    named = name.format(nav)
    before = code_digest(named)
    (nav.parent / file).write_text("CHANGED = 1\n")
    assert (code_digest(named) != before) == counts


def test_the_same_code_elsewhere_is_the_same(nav: Path, tmp_path_factory) -> None:
    other = tmp_path_factory.mktemp("other") / "copy"
    nav.parent.rename(other)
    moved = code_digest(f"{other / 'nav.py'}:Nav")
    other.rename(nav.parent)
    assert code_digest(f"{nav}:Nav") == moved


def test_broken_code_has_an_identity(nav: Path) -> None:
    nav.write_text("def (\n")
    assert files_of(nav) == [nav]


def test_what_wayproof_cannot_read_has_none() -> None:
    assert [code_digest(one) for one in ("exec:ls -l", "unix:/run/nav", "exec:'")] == ["", "", ""]
