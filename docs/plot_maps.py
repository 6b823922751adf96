"""Fill the tables of docs/maps.md and draw its pictures from one run of `bench map`.

Usage: wayproof bench map --json > rows.json && python docs/plot_maps.py rows.json
"""

import json
import re
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("svg")
import matplotlib.pyplot as plt

DOCS = Path(__file__).parent
OURS, PEER = "tab:blue", "tab:orange"

TABLES = {
    "workload": {
        "resolution_m": "cell, m",
        "mean_ray_m": "mean ray, m",
        "ray_voxel_steps": "cells crossed, by ray",
        "cells_updated": "cells updated",
        "end_cells": "cells with ends",
    },
    "speed": {
        "resolution_m": "cell, m",
        "range_m": "range, m",
        "library": "library",
        "mode": "mode",
        "threads": "threads",
        "ms_per_sweep": "ms, median",
        "ms_p99": "ms, p99",
        "ratio_vs_pyoctomap": "times as fast",
        "map_mib": "MiB",
    },
    "extent": {
        "trajectory_m": "path, m",
        "resolution_m": "cell, m",
        "ms_per_sweep": "ms, median",
        "ms_p99": "ms, p99",
        "map_mib": "MiB",
    },
    "fields": {
        "library": "library",
        "mode": "what",
        "threads": "threads",
        "ms": "ms, median",
        "ms_worst": "ms, worst",
        "ratio_vs_edt": "times as fast as edt",
    },
    "ghosts": {
        "library": "library",
        "clamp_high": "clamp_high",
        "half_life_s": "half_life, s",
        "unseen_s": "unseen, s",
        "sweeps_to_free": "sweeps, measured",
        "sweeps_by_formula": "by formula",
    },
    "accuracy": {
        "resolution_m": "cell, m",
        "library": "library",
        "mode": "mode",
        "floor_columns_lost": "floor columns lost",
        "false_free": "false free",
    },
    "agreement": {
        "resolution_m": "cell, m",
        "mode": "mode",
        "agreement": "same state",
        "agreement_above_floor": "above the floor's layer",
    },
}
"""Fields of each part, with their column headings."""

SHARES = ("floor_columns_lost", "false_free", "agreement", "agreement_above_floor")


def main(rows_path: Path) -> None:
    """Rewrite what stands between the marks of each part, and all pictures."""
    rows = json.loads(rows_path.read_text())["rows"]
    page = DOCS / "maps.md"
    text = page.read_text()
    for part in TABLES:
        marks = rf"(<!-- {part} -->\n).*?(<!-- end -->)"
        filled = table(part, [row for row in rows if row["part"] == part])
        text = re.sub(marks, lambda found, t=filled: found[1] + t + found[2], text, flags=re.S)
    page.write_text(text)
    matplotlib.rcParams.update({"svg.hashsalt": "maps", "svg.fonttype": "path", "font.size": 9})
    draw_speed([row for row in rows if row["part"] == "speed"])
    draw_ghosts([row for row in rows if row["part"] == "ghosts"])
    draw_accuracy([row for row in rows if row["part"] == "accuracy"])


def table(part, rows):
    """Rows as Markdown."""
    fields = TABLES[part]
    lines = [f"| {' | '.join(fields.values())} |", f"|{'---|' * len(fields)}"]
    lines += [f"| {' | '.join(cell(field, row[field]) for field in fields)} |" for row in rows]
    return "\n".join(lines) + "\n"


def cell(field, value):
    """One value; shares in per cent, others in three digits."""
    if value is None:
        return ""
    if field in SHARES:
        return f"{100 * value:.3g} %" if value < 0.99 else f"{100 * value:.3f} %"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 999.5 else f"{value:,.0f}"
    return str(value)


def draw_speed(rows):
    """Milliseconds a sweep by cell size."""
    figure, axes = plt.subplots(figsize=(5, 3))
    rows = [row for row in rows if row["ratio_vs_pyoctomap"] is not None]
    peer = {row["resolution_m"]: row for row in rows if row["ratio_vs_pyoctomap"] == 1.0}
    lines = [("OctoMap, fastest mode", PEER, "o-", list(peer.values()))]
    for threads, style in ((1, "o-"), (2, "s--")):
        ours = [
            row
            for row in rows
            if (row["library"], row["mode"], row["threads"]) == ("wayproof", "clamped", threads)
        ]
        if ours:
            lines.append((f"ours, {threads} thread{'s' * (threads > 1)}", OURS, style, ours))
    for label, colour, style, points in lines:
        x = [100 * row["resolution_m"] for row in points]
        axes.plot(x, [row["ms_per_sweep"] for row in points], style, color=colour, label=label)
    axes.set(xscale="log", yscale="log", xlabel="cell, cm", ylabel="ms a sweep of 100,000 rays")
    axes.set_xticks([5, 10, 20], ["5", "10", "20"])
    axes.minorticks_off()
    finish(figure, axes, "map-speed.svg")


def draw_ghosts(rows):
    """Sweeps until what left is free, by clamp."""
    figure, axes = plt.subplots(figsize=(5, 3))
    p = np.linspace(0.7, 0.9995, 400)
    misses = np.log(p / (1 - p)) / 0.4
    axes.plot(misses, np.floor(misses) + 1, color="0.7", label="floor(L / miss) + 1")
    for library, colour, marker in (("wayproof", OURS, "o"), ("pyoctomap", PEER, "x")):
        still = [r for r in rows if r["library"] == library and r["half_life_s"] == 0.0]
        if still:
            clamps = np.array([row["clamp_high"] for row in still])
            x = np.log(clamps / (1 - clamps)) / 0.4
            y = [row["sweeps_to_free"] for row in still]
            axes.plot(x, y, marker, color=colour, label=f"{library}, measured")
            axes.set_xticks(x, [f"{clamp:g}" for clamp in clamps])
    axes.set(xlabel="clamp_high", ylabel="sweeps until free")
    finish(figure, axes, "map-ghosts.svg")


def draw_accuracy(rows):
    """Shares of what is lost and of what is free in error."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), sharey=True)
    for side, (field, title) in zip(
        axes,
        (("floor_columns_lost", "floor columns lost"), ("false_free", "surface cells mapped free")),
        strict=True,
    ):
        labels = [
            f"{row['library']}, {row['mode']}, {100 * row['resolution_m']:g} cm" for row in rows
        ]
        colours = [OURS if row["library"] == "wayproof" else PEER for row in rows]
        side.barh(labels, [100 * row[field] for row in rows], color=colours)
        side.set(xlabel="%", title=title)
    axes[0].invert_yaxis()
    figure.tight_layout()
    figure.savefig(DOCS / "map-accuracy.svg", metadata={"Date": None})


def finish(figure, axes, name):
    """Grid, legend and file of a picture."""
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(DOCS / name, metadata={"Date": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
