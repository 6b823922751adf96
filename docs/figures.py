"""Write the tables of figures again, each with its command and date: `make figures`.

Usage: python -m docs.figures [NAME ...]

A table stands between `<!-- figures: NAME -->` and `<!-- end -->`. Together take about an hour
on two cores, which should have nothing else to do.
"""

from __future__ import annotations

import argparse
import datetime
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

PAGES = sorted(Path(__file__).parent.glob("*.md"))
END = "<!-- end -->"


class Figures(NamedTuple):
    """A command of `wayproof`, and the headings of a table by the field of its rows."""

    command: str
    headings: dict[str, str]


ARMS = {
    **{"world": "world", "robot": "robot", "stack": "stack", "episodes": "episodes"},
    **{"reached": "reached", "collisions": "collisions, mean", "time": "time, s, mean"},
}
FIGURES: dict[str, Figures] = {
    "rays": Figures(
        "bench rays",
        {"scene": "scene", "mray_per_s": "million rays a second", "x_multiray": "x `mj_multiRay`"},
    ),
    "map": Figures(
        "bench map",
        {
            "cell_m": "cell, m",
            "ms": "ms a sweep",
            "x_octomap": "x OctoMap",
            "mib": "MiB",
            "octomap_mib": "OctoMap, MiB",
        },
    ),
    "loop": Figures(
        "bench loop",
        {
            **{"robot": "robot", "rays": "beams a decision", "physics": "share of bare physics"},
            **{"real": "x real time", "ms": "decision, ms", "ms_p99": "p99"},
        },
    ),
    "baseline": Figures("study baseline", ARMS),
    "stacks": Figures("study stacks", ARMS),
}


def main() -> None:
    """Run each command, and put its rows into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FIGURES))
    for name in parser.parse_args().names or FIGURES:
        made = table(FIGURES[name], rows_of(FIGURES[name].command))
        mark = f"<!-- figures: {name} -->\n"
        [page] = [page for page in PAGES if mark in page.read_text(encoding="utf-8")]
        before, _, rest = page.read_text(encoding="utf-8").partition(mark)
        after = rest[rest.index(END) :]
        page.write_text(f"{before}{mark}{made}\n{after}", encoding="utf-8")


def rows_of(command: str) -> list[dict[str, Any]]:
    """Run a command; return the rows of a benchmark, or one for each arm of a study."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "wayproof", *command.split(), "--json"]
        printed = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, check=False).stdout
    document = json.loads(printed)
    return document["rows"] if "rows" in document else [_arm(one) for one in document["arms"]]


def _arm(one: dict[str, Any]) -> dict[str, Any]:
    metrics, episodes = one["metrics"], one["episodes"]
    return {
        **one["arm"],
        "episodes": episodes,
        "reached": round(one["success"]["estimate"] * episodes),
        "collisions": metrics["collisions"],
        "time": one["mean_time"],
    }


def table(figures: Figures, rows: list[dict[str, Any]]) -> str:
    """The command, the date and the rows, in Markdown."""
    today = datetime.date.today()
    lines = [f"`wayproof {figures.command}`, {today.day} {today:%B %Y}:", ""]
    lines += [f"| {' | '.join(figures.headings.values())} |", "|---" * len(figures.headings) + "|"]
    for row in rows:
        cells = [_cell(row.get(field)) for field in figures.headings]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(["", *lines, ""])


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return "" if value is None else str(value)


if __name__ == "__main__":
    main()
