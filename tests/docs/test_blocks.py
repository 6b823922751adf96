"""The blocks of a page run, and quoted output is the printed one.

Those of the pages in `RUN` run in every test; those of the others are read, and run in `make
test-all`.
"""

import os
import re
import sys
from pathlib import Path

import pytest

from docs.blocks import FENCED, Block, blocks, commands
from tests.docs.programs import ROOT, TARGETS
from tests.docs.typist import (
    UNTYPED,
    Typist,
    check_against_parser,
    commands_of,
    reason_untyped,
)
from wayproof.harness.cli.main import parser_of, split_command

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md"))]
INDEX = ROOT / "docs/README.md"
RUN = {"README.md", "docs/get-started.md"}
INLINE = re.compile(r"`((?:\.venv/bin/)?wayproof|python|pytest|make)\s([^`]+)`")


def name_of(page):
    return str(page.relative_to(ROOT))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
@pytest.mark.usefixtures("folder")
def test_every_block_is_read(common, page):
    text = page.read_text()
    reader = Typist(text, common)
    for block in blocks(text):
        reader.read(block)
    pictured = re.search(r"!\[[^\]]*\]\([^)]+\.(?:png|svg|gif)\)", text)
    if page.parent != ROOT and page != INDEX:
        assert reader.ran or pictured, "no picture, and no block that runs"


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=name_of(page), marks=[pytest.mark.large][: name_of(page) not in RUN])
        for page in PAGES
    ],
)
@pytest.mark.usefixtures("folder")
def test_every_block_runs(monkeypatch, common, page):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    text = page.read_text()
    typist = Typist(text, common)
    for block in blocks(text):
        typist.type(block)
    if typist.undrawn:
        pytest.skip(f"all but {len(typist.undrawn)} pictures: {typist.undrawn[0]}")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_in_the_prose_are_ours(page):
    for program, rest in INLINE.findall(FENCED.sub("", page.read_text())):
        words = re.sub(r"[\[\]]", "", rest).split()
        if program.endswith("wayproof") and not words[0].startswith("--"):
            parser = parser_of(split_command(words)[0])
            known = {option for action in parser._actions for option in action.option_strings}
            assert {re.split("=", word)[0] for word in words if word[:2] == "--"} <= known, rest
        elif program == "make":
            assert words[0] in TARGETS, rest
        elif program == "python" and words[:2] != ["-m", "pytest"]:
            check_against_parser([program, *words])
        for word in words:
            assert (
                not re.fullmatch(r"(?:tests|docs|harness)/\S+\.py", word) or (ROOT / word).is_file()
            ), rest


def test_every_untyped_command_is_on_a_page():
    lines = [
        line for page in PAGES for block in blocks(page.read_text()) for line in commands_of(block)
    ]
    given = {reason_untyped(line) for line in lines}
    assert set(UNTYPED.values()) <= given


def test_a_block_of_an_unknown_kind_is_refused():
    for page in (
        "```\nfree\n```\n",
        "```bash\nls\n```\n",
        "text\n\n    indented\n",
        "- a\n  ```sh\n",
    ):
        with pytest.raises(ValueError, match="expected"):
            blocks(page)


def test_blocks_and_their_commands():
    page = (
        "```sh exit=1\ncat > a.toml <<'END'\nx = 1\nEND\nls a \\\n  b\n```\n```console\n$ ls\n```\n"
    )
    first, second = blocks(page)
    assert first == Block("sh", {"exit": "1"}, "cat > a.toml <<'END'\nx = 1\nEND\nls a \\\n  b\n")
    assert commands(first) == ["cat > a.toml <<'END'\nx = 1\nEND\n", "ls a    b"]
    assert commands(second) == ["ls"]


@pytest.mark.parametrize(
    "words",
    [
        ["wayproof", "bench", "no-such-stage"],
        ["make", "nothing"],
        ["python", "docs/none.py"],
        ["python", "-m", "wayproof.harness.none"],
        ["rm", "-r"],
    ],
    ids=" ".join,
)
def test_an_invalid_command_is_found(words):
    with pytest.raises(AssertionError):
        check_against_parser(words)
