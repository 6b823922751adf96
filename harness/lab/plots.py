"""Plots of the map lab: memory, time and cells over resolution, and ghosts over clamps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from wayproof.harness.lab.trials import Trial
from wayproof.harness.outputs import written_whole


def plot(trials: Sequence[Trial], target: Path) -> None:
    """Write the plots into a PNG file."""
    by_resolution = [one for one in trials if one.group == "resolution"]
    by_clamps = [one for one in trials if one.group == "clamps"]
    with mpl.rc_context({"font.size": 8.0, "text.parse_math": False}):
        figure = Figure(figsize=(9.0, 3.0), layout="constrained", dpi=110)
        memory, spent, ghosts = figure.subplots(1, 3)
        names = [one.setting for one in by_resolution]
        memory.bar(names, [one.memory_mib for one in by_resolution], color="#1f77d0")
        memory.set(title="memory", ylabel="MiB", yscale="log", xlabel="resolution")
        spent.bar(names, [one.ms_p50 for one in by_resolution], color="#2a9d4a")
        spent.set(title="time a sweep, median", ylabel="ms", yscale="log", xlabel="resolution")
        clamps = [one.setting for one in by_clamps]
        ghosts.bar(clamps, [one.misses_to_free or 0 for one in by_clamps], color="#e69f00")
        ghosts.set(title="until a ghost is gone", ylabel="sweeps", xlabel="clamps")
        with written_whole(target, "plot") as partial:
            figure.savefig(partial, format="png", metadata={"Software": None})
