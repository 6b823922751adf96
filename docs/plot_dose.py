"""Draw a study's dose-response plots as SVG files of their own.

Usage: python docs/plot_dose.py FOLDER OUT.svg

FOLDER is a study's; its report must have been written. With several plots, the first is taken.
"""

import re
import sys
from pathlib import Path


def main(folder: Path, out: Path) -> None:
    """Take the plot out of the report, which draws it from the logs."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    plots = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    if not plots:
        sys.exit(f"{folder}: no plot in its report")
    out.write_text(f"{plots[0]}\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
