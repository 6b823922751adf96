"""The site that `make docs` builds: Sphinx over plain Markdown.

The source folder is the repository's root, so that links between pages work in both.
"""

project = "Wayproof"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/**.md",
    "examples/recordings/*/README.md",
]
html_theme = "furo"
html_title = project
html_copy_source = False
myst_heading_anchors = 4  # links to headings, as GitHub makes them
suppress_warnings = [
    "misc.highlighting_failure",  # a block that shows output is no code
    "toc.not_included",  # the rest are in the list below
]

CHAPTERS = {
    "Get started": ["get-started", "concepts"],
    "Use your own": [
        *("stack", "ros2", "gym", "recordings"),
        *("robots", "worlds", "sensors", "planning"),
    ],
    "Judge and explain": ["explain", "causes", "log"],
    "Study and gate": ["studies", "ci", "perturbations"],
    "How it works": ["maps", "evidence"],
    "Reference": [
        *("reference/cli", "reference/config", "reference/data", "measured"),
    ],
}
"""Sections of the side bar; other pages come after them."""


def setup(app):
    """Add a side bar to the first page."""
    app.connect("source-read", add_side_bar)


def add_side_bar(app, page, source):
    """Append the list of all pages to the first page."""
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
