"""Page of a recording: the verdict, the way over the map, and the places; one HTML file."""

from __future__ import annotations

import base64
from pathlib import Path

import jinja2

from wayproof.harness.outputs import written_whole
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.picture import draw_way
from wayproof.harness.shadow.summary import Summary, lines_of, summarize

TEMPLATE = "page.html.j2"


def write_page(log: Path, out: Path, allow_plugins: bool = False) -> Summary:
    """Judge the way of a recording's log again, and write its page.

    Raises:
        InputError: It is no log of a recording, or the page cannot be written.
    """
    assessed = assess(log, allow_plugins)
    summary = summarize(assessed)
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined
    )
    text = environment.get_template(TEMPLATE).render(
        summary=summary,
        lines=lines_of(summary),
        picture=base64.b64encode(draw_way(assessed, summary)).decode(),
    )
    with written_whole(out, "page") as partial:
        partial.write_text(text, encoding="utf-8")
    return summary
