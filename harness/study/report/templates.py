"""Templates of the pages."""

from __future__ import annotations

from pathlib import Path

import jinja2

from wayproof.harness.study.report.words import number, signed


def templates() -> jinja2.Environment:
    """Return the environment of the templates, in which all that is inserted is text."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["number"] = number
    environment.filters["signed"] = signed
    return environment
