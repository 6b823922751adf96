"""What MkDocs must know beyond its settings: a page and links that lie outside of `docs/`."""

import re
from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[1]
OUTSIDE = "CONTRIBUTING.md"


def on_files(files, config):
    """Take the page from beside `docs/` in."""
    files.append(File.generated(config, OUTSIDE, abs_src_path=str(ROOT / OUTSIDE)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links to that page lead to it; other links out of `docs/` become the file's name."""
    depth = page.file.src_uri.count("/")
    up = "../" * (depth + 1)
    if page.file.src_uri == OUTSIDE:
        return markdown.replace("](docs/", "](")
    markdown = markdown.replace(f"]({up}{OUTSIDE}", f"]({'../' * depth}{OUTSIDE}")
    return re.sub(rf"\[([^\]]+)\]\({re.escape(up)}([^)]+)\)", r"\1 (`\2`)", markdown)
