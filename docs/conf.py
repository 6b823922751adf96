"""The site that `make docs` builds: Sphinx over the same plain Markdown that one reads without it.

The source folder is the repository's root, so that links between its pages are what they are.
"""

project = "Wayproof"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/**.md"]
html_theme = "furo"
html_title = project
html_copy_source = False
myst_heading_anchors = 4  # links to headings, as GitHub makes them
suppress_warnings = [
    "misc.highlighting_failure",  # a block that shows output is no code
    "toc.not_included",  # the rest are in the list below
]

CHAPTERS = {
    "Begin": ["get-started", "concepts", "guarantees", "verbs", "seeing", "comparison", "measured"],
    "Tutorials": [
        f"tutorials/{name}"
        for name in (
            "planner",
            "sensor",
            "robot",
            "pose-drift",
            "why-it-failed",
            "lost-echoes",
            "gate",
        )
    ],
    "What there is": [
        *("robots", "sensors", "worlds", "imports", "maps", "representations", "moving"),
        *("unknown", "planning", "perturbations", "benchmarks"),
    ],
    "A log": ["log", "replay", "explain", "causes"],
    "Reference": ["reference/cli", "reference/config", "reference/metrics"],
}
"""What the side bar shows first; pages that are not named here come after."""


def setup(app):
    """Give the first page a side bar, which no Markdown has."""
    app.connect("source-read", add_side_bar)


def add_side_bar(app, page, source):
    """Append the list of all pages to the first."""
    if page != root_doc:
        return
    named = [f"docs/{name}" for names in CHAPTERS.values() for name in names]
    rest = sorted(app.env.found_docs - {root_doc, "docs/README", *named})
    for title, pages in CHAPTERS.items():
        source[0] += toctree(title, [f"docs/{name}" for name in pages])
    source[0] += toctree("More", ["docs/README", *rest])


def toctree(title, pages):
    """A hidden list of pages, in MyST."""
    lines = "\n".join(pages)
    return f"\n\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{lines}\n```\n"
