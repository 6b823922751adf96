"""Plot the share of episodes at the goal against noise, by estimator, as an SVG file.

Usage: python docs/plot_estimators.py FOLDER OUT.svg

FOLDER is that of `wayproof study estimator`. Bars are Clopper-Pearson intervals of 95 %.
"""

import sys
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot as plt
import pyarrow.parquet as pq
from scipy.stats import binomtest

from wayproof.harness.perturbations import perturbation_from

COLORS = {"model": "#4a5568", "lidar": "#c05621"}


def main(folder: Path, out: Path) -> None:
    """Read the study's table and draw one curve for each estimator."""
    reached: dict[tuple[str, float], list[bool]] = defaultdict(list)
    for row in pq.read_table(folder / "table.parquet").to_pylist():
        if row["perturbation"] in ("none", "depth_noise"):
            noise = 0.0
            if row["severity"]:
                noise = perturbation_from(f"depth_noise:{row['severity']:g}").amount
            kind = row["variant"].removeprefix("estimate.kind=")
            reached[kind, 100.0 * noise].append(row["outcome"] == "success")
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "wayproof", "font.size": 8})
    figure, axes = plt.subplots(figsize=(4.0, 2.4), layout="constrained")
    for kind, color in COLORS.items():
        points = sorted((noise, got) for (name, noise), got in reached.items() if name == kind)
        noises = [noise for noise, _ in points]
        shares = [sum(got) / len(got) for _, got in points]
        ends = [binomtest(sum(got), len(got)).proportion_ci() for _, got in points]
        below = [share - end.low for share, end in zip(shares, ends, strict=True)]
        above = [end.high - share for share, end in zip(shares, ends, strict=True)]
        shift = 0.04 if kind == "lidar" else -0.04  # so that bars of both are seen
        axes.errorbar(
            [noise + shift for noise in noises], shares, (below, above),
            color=color, marker="o", markersize=3, linewidth=1.2, elinewidth=0.7, label=kind,
        )  # fmt: skip
    axes.set(xlabel="noise of each range, cm", ylabel="share at the goal", ylim=(-0.05, 1.05))
    axes.legend(frameon=False, loc="center left")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(out, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
