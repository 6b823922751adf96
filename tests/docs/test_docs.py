"""Links resolve, the reference matches the code, the site builds."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs import figures, generate
from docs.blocks import FENCED
from docs.catalogue import catalogue
from wayproof.harness.cli.catalogue import read_catalogue

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
REGISTRY = re.compile(r"pypi\.org|pythonhosted|npmjs|crates\.io|anaconda\.org")


def anchors(page):
    """Anchors of a page's headings, in GitHub's form."""
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
def test_links_resolve(page):
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
def test_the_reference_matches_the_code(name):
    written = (generate.FOLDER / name).read_text()
    assert written == generate.pages()[name], "run: python -m docs.generate"


def test_the_tables_of_figures_have_their_places_and_headings():
    texts = [page.read_text() for page in figures.PAGES]
    places = [name for text in texts for name in re.findall(r"<!-- figures: (\w+) -->\n", text)]
    assert sorted(places) == sorted(figures.FIGURES)
    assert all(text.count("<!-- figures: ") == text.count(figures.END) for text in texts)
    written = figures.table(figures.FIGURES["rays"], [{"scene": "a", "mray_per_s": 61.23}])
    assert written.splitlines()[-1] == "| a | 61.2 |  |"
    assert "`wayproof bench rays`, " in written


def test_the_catalogue_matches_the_code():
    assert read_catalogue() == catalogue(), "run: python -m docs.generate"


def test_attributes_are_read_over_several_lines():
    class Section:
        """A section.

        Attributes:
            one: The first,
                in two lines.
            two: The ``second``.

        Raises:
            ValueError: Never.
        """

    found = generate.attributes(Section)
    assert found == {"one": "The first, in two lines.", "two": "The `second`."}


def built(source, out):
    """Build the site of a folder, warnings as errors; return the finished process."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going"]
    command += ["-c", str(source / "docs"), str(source), str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.large
def test_the_site_has_every_page(tmp_path):
    pytest.importorskip("myst_parser")
    ended = built(ROOT, tmp_path)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    for page in PAGES:
        assert (tmp_path / page.relative_to(ROOT).with_suffix(".html")).is_file()


@pytest.mark.large
def test_the_site_rejects_a_broken_link(tmp_path):
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
