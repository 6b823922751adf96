"""Pages: a verdict and sections of tables, figures and text, drawn by one template."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import jinja2

Legend = Sequence[tuple[str, str]]
"""Colour and name of what a picture shows."""


class Cell(NamedTuple):
    """Cell of a table.

    Attributes:
        text: Its text.
        side: `good`, `bad`, or a verdict, which colours it; empty for none.
        link: Address that it leads to; empty for none.
        colour: Colour behind the text; empty for none.
    """

    text: str
    side: str = ""
    link: str = ""
    colour: str = ""


Row = Sequence[Cell | str]


@dataclass(frozen=True)
class Figure:
    """A box with pictures.

    Attributes:
        title: Title; empty for none.
        link: Address that the title leads to.
        lines: Lines of text.
        legend: Legend of the pictures.
        pictures: SVG texts.
        note: Text below.
        commands: Commands.
        kind: Class of the box: `map` bounds its height, `strip` its width.
    """

    title: str = ""
    link: str = ""
    lines: Sequence[str] = ()
    legend: Legend = ()
    pictures: Sequence[str] = ()
    note: str = ""
    commands: Sequence[str] = ()
    kind: Literal["", "map", "strip"] = ""


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes:
        title: Heading; empty for none.
        note: Text below it.
        legend: Legend of all figures.
        heads: Headings of the table's columns.
        rows: Its rows; the first cell names the row.
        figures: Figures.
        layout: `grid` of small figures, or `pair` of large ones.
        code: Lines of commands.
        terms: Names and texts.
    """

    title: str = ""
    note: str = ""
    legend: Legend = ()
    heads: Sequence[str] = ()
    rows: Sequence[Row] = ()
    figures: Sequence[Figure] = ()
    layout: Literal["grid", "pair"] = "grid"
    code: Sequence[str] = ()
    terms: Sequence[tuple[str, str]] = ()

    @property
    def cells(self) -> list[list[Cell]]:
        """The rows, each text as a cell."""
        return [[Cell(one) if isinstance(one, str) else one for one in row] for row in self.rows]

    @property
    def words(self) -> list[bool]:
        """Whether each column holds words, which stand at the left, and not numbers."""
        cells = self.cells
        return [any(row[k].text[:1].isalpha() for row in cells) for k in range(len(self.heads))]


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes:
        title: Title.
        verdict: Verdict, which colours the first lines; empty for none.
        outcome: First word of these.
        lines: The first lines.
        sections: The rest.
        links: Text and address of the links above; no address for this page.
        outcomes: Outcomes to filter the first table by, which can then be sorted; none for neither.
    """

    title: str
    verdict: str = ""
    outcome: str = ""
    lines: Sequence[str] = ()
    sections: Sequence[Section] = ()
    links: Sequence[tuple[str, str]] = ()
    outcomes: Sequence[str] = field(default_factory=list)

    def html(self, root: str | None = None) -> str:
        """Return the page; nothing on it is loaded from elsewhere.

        Args:
            root: Path to the folder of `style.css`; None for a page with a style of its own.
        """
        return _templates().get_template("page.html.j2").render(page=self, root=root)


@functools.cache
def _templates() -> jinja2.Environment:
    """Return the environment of the templates, in which all that is inserted is text."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )


def style() -> str:
    """Return the style of all pages."""
    return _templates().get_template("style.css.j2").render()
