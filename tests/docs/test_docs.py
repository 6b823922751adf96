"""The pages say what holds: links lead somewhere, commands run, the reference is the code's."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from docs import generate
from harness.cli import main

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```sh(?: exit=(\d))?\n(.*?)^```", re.MULTILINE | re.DOTALL)
REGISTRY = re.compile(r"pypi\.org|pythonhosted|npmjs|crates\.io|anaconda\.org")
TUTORIALS = sorted(ROOT.glob("docs/tutorials/*.md"))
FOUND = {**os.environ, "PYTHONPATH": str(ROOT)}
HERE = re.compile(r"cat > (\S+) <<'END'\n(.*?)^END\n", re.MULTILINE | re.DOTALL)


def anchors(page):
    """What a heading is called in a link, as GitHub makes it."""
    headings = re.findall(r"^#+ (.+)$", FENCED.sub("", page.read_text()), re.MULTILINE)
    plain = [re.sub(r"[`*]|\[|\]\([^)]*\)", "", heading).lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in plain}


def broken_links(page):
    text = FENCED.sub("", page.read_text())
    for link in LINK.findall(text):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            yield f"{link}: no such file"
        elif anchor and anchor not in anchors(target):
            yield f"{link}: no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert list(broken_links(page)) == []


def test_broken_links_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One two\n[a](none.md) [b](#one-two) [c](#three)\n")
    assert list(broken_links(page)) == ["none.md: no such file", "#three: no such heading"]


def test_every_page_is_reached_from_the_index():
    index = ROOT / "docs/README.md"
    reached = {(index.parent / link).resolve() for link in LINK.findall(index.read_text())}
    pages = set((ROOT / "docs").rglob("*.md")) - {index}
    assert pages - reached == set()


@pytest.mark.parametrize("name", sorted(generate.pages()))
def test_the_reference_is_that_of_the_code(name):
    written = (generate.FOLDER / name).read_text()
    assert written == generate.pages()[name], "run: python -m docs.generate"


def test_attributes_are_read_over_several_lines():
    class Section:
        """What it is.

        Attributes:
            one: The first,
                in two lines.
            two: The ``second``.

        Raises:
            ValueError: Never.
        """

    told = generate.attributes(Section)
    assert told == {"one": "The first, in two lines.", "two": "The `second`."}


def run_block(block):
    """Run a block's lines one by one, our command in this process; returns the last exit code."""
    for name, text in HERE.findall(block):
        Path(name).write_text(text)
    code = 0
    for line in HERE.sub("", block).splitlines():
        program, *words = shlex.split(line)
        if line == "export PYTHONPATH=.":
            sys.path.insert(0, str(Path.cwd()))
        elif program == "python":
            code = subprocess.run([sys.executable, *words], env=FOUND, check=False).returncode
        else:
            assert program == "wayproof", f"cannot run: {line}"
            code = main(words)
        assert code in (0, 1), line
    return code


def run_page(page, capsys):
    """Run every block of a page in this folder."""
    blocks = BLOCK.findall(page.read_text())
    assert blocks
    for expected, block in blocks:
        if "wayproof picture" in block:  # needs a driver chosen before the simulator is loaded
            block = block.replace("wayproof picture", "# ").partition("# ")[0]
        code = run_block(block)
        told = capsys.readouterr()
        assert code == int(expected or 0), f"{block}{told.out}{told.err}"


def test_getting_started_works_as_it_stands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run_page(ROOT / "docs/get-started.md", capsys)
    assert (tmp_path / "corridor.rrd").is_file()
    assert (tmp_path / "logs/tiny").is_dir()


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_tutorials_work_as_they_stand(tmp_path, monkeypatch, capsys, page):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    run_page(page, capsys)


def built(source, out):
    """Build the site of a folder; returns what Sphinx said of it, and refuses any warning."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going"]
    command += ["-c", str(source / "docs"), str(source), str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_site_has_every_page(tmp_path):
    pytest.importorskip("myst_parser")
    ended = built(ROOT, tmp_path)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    for page in PAGES:
        assert (tmp_path / page.relative_to(ROOT).with_suffix(".html")).is_file()


def test_the_site_refuses_a_link_that_leads_nowhere(tmp_path):
    pytest.importorskip("myst_parser")
    (tmp_path / "docs").mkdir()
    conf = (ROOT / "docs/conf.py").read_text()
    conf = re.sub(r"^CHAPTERS = .*?^}", "CHAPTERS = {}", conf, flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "docs/conf.py").write_text(conf)
    (tmp_path / "docs/README.md").write_text("# Pages\n")
    (tmp_path / "README.md").write_text("# One\n\n[two](docs/none.md) [three](#four)\n")
    ended = built(tmp_path, tmp_path / "site")
    assert ended.returncode != 0
    assert "docs/none.md" in ended.stderr
    assert "four" in ended.stderr


def test_no_page_names_a_registry():
    for page in PAGES:
        assert not REGISTRY.search(page.read_text()), page
