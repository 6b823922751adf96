"""Write a study's dose-response plot as an SVG file.

Usage: python docs/plot_dose.py FOLDER OUT.svg

FOLDER is a study with a written report. Of several plots, the first is taken.
"""

import re
import sys
from pathlib import Path


def main(folder: Path, out: Path) -> None:
    """Extract the plot from the report."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    plots = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    if not plots:
        sys.exit(f"{folder}: no plot in its report")
    out.write_text(f"{plots[0]}\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
