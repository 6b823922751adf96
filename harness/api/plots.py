"""Figures of an episode: quantities over time, and its tracks from above."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from wayproof.harness.study.report.palette import BELIEVED, LIMIT, TRUE, action_colour
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

if TYPE_CHECKING:
    from wayproof.harness.api.episode import MapArrays, RecordedEpisode

CELLS = {UNKNOWN: "#c9ced6", FREE: "#ffffff", OCCUPIED: "#3b4252"}
"""Colours of cells by state."""


def _style() -> AbstractContextManager[None]:
    """Return the style of all figures; no text is read as mathematics."""
    return mpl.rc_context(
        {"font.size": 8.0, "text.parse_math": False, "axes.grid": True, "grid.alpha": 0.3}
    )


def plot_episode(episode: RecordedEpisode) -> Figure:
    """Draw clearance, speed, error of the pose and latency over time, over the actions.

    The position error is beside the localization margin that the stack kept for it.
    """
    decisions, truth, poses = episode.decisions(), episode.truth(), episode.poses()
    times = decisions["time_s"].to_numpy()
    with _style():
        figure = Figure(figsize=(8.0, 7.0), layout="constrained")
        clearance, speed, error, latency = figure.subplots(4, sharex=True)
        clearance.plot(truth["time_s"], truth["clearance_m"], color=TRUE, label="true clearance")
        clearance.set_ylabel("clearance, m")
        speed.plot(truth["time_s"], truth["speed"], color=TRUE, label="true speed")
        speed.set_ylabel("speed, m/s")
        error.plot(poses["time_s"], poses["position_error_m"], color=TRUE, label="pose error")
        margin = decisions["localization_margin_m"].to_numpy()
        error.step(times, margin, where="post", color=LIMIT, ls="--", label="localization margin")
        error.set_ylabel("position error, m")
        latency.plot(times, decisions["latency_ms"], color=BELIEVED, label="latency")
        latency.set_yscale("log")
        latency.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        latency.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        latency.yaxis.set_minor_locator(NullLocator())
        latency.set_ylabel("latency, ms")
        latency.set_xlabel("simulated time, s")
        for axes in (clearance, speed, error, latency):
            _shade(axes, times, decisions["action"].to_pylist())
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
        shown = dict.fromkeys(decisions["action"].to_pylist())
        patches = [Patch(color=action_colour(one), alpha=0.35, label=one) for one in shown]
        figure.legend(handles=patches, loc="outside lower center", ncols=len(patches))
        figure.suptitle(_title(episode))
    return figure


def plot_track(episode: RecordedEpisode) -> Figure:
    """Draw the last map from above, with the estimated and the true track.

    Of the cells at the heights of the body, a column is occupied if one is, free if all are, and
    unknown else; beyond the map all is unknown.
    """
    poses = episode.poses()
    mapped = episode.map_at(poses["sequence"].to_pylist()[-1])
    seen = _from_above(mapped, _heights(episode, poses["z"].to_numpy()))
    nx, ny, _ = mapped.states.shape
    x, y, size = mapped.low[0], mapped.low[1], mapped.resolution
    with _style():
        figure = Figure(figsize=(8.0, 6.5), layout="constrained")
        axes = figure.subplots()
        axes.imshow(
            seen.T,
            origin="lower",
            extent=(x, x + nx * size, y, y + ny * size),
            cmap=ListedColormap(list(CELLS.values())),
            vmin=-0.5,
            vmax=2.5,
            interpolation="nearest",
        )
        axes.set_facecolor(CELLS[UNKNOWN])
        axes.grid(visible=False)
        axes.plot(poses["x"], poses["y"], color=BELIEVED, label="estimated track")
        axes.plot(poses["true_x"], poses["true_y"], color=TRUE, ls="--", label="true track")
        start, goals = episode.log.mission.start, np.array(episode.log.mission.goals)
        axes.plot(start[0], start[1], "o", color=TRUE, label="start")
        axes.plot(goals[:, 0], goals[:, 1], "*", color=LIMIT, ms=10, label="goal")
        names = ("unknown", "free", "occupied")
        cells = [
            Patch(fc=CELLS[state], ec="#888888", label=name) for state, name in enumerate(names)
        ]
        lines = axes.get_legend_handles_labels()[0]
        figure.legend(handles=[*lines, *cells], loc="outside lower center", ncols=4)
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
        axes.set_title(_title(episode))
    return figure


def _heights(episode: RecordedEpisode, z: NDArray[np.float64]) -> tuple[float, float]:
    """Return the heights that the body takes up: where it walks, or at its median altitude, m."""
    mission = episode.log.mission
    if mission.planar:
        return mission.step_height, mission.height
    middle = float(np.median(z))
    return middle - 0.5 * mission.height, middle + 0.5 * mission.height


def _from_above(mapped: MapArrays, heights: tuple[float, float]) -> NDArray[np.uint8]:  # (nx, ny)
    centres = mapped.low[2] + (np.arange(mapped.states.shape[2]) + 0.5) * mapped.resolution
    low, high = heights
    within = np.abs(centres - 0.5 * (low + high)) <= 0.5 * (high - low + mapped.resolution)
    layer = mapped.states[:, :, within]
    seen = np.full(layer.shape[:2], UNKNOWN, np.uint8)
    seen[(layer == FREE).all(axis=2)] = FREE
    seen[(layer == OCCUPIED).any(axis=2)] = OCCUPIED
    return seen


def _shade(axes: Axes, times: NDArray[np.float64], actions: list[str]) -> None:
    """Colour the background by action, one rectangle for each run of one action."""
    starts = [0, *(n for n in range(1, len(actions)) if actions[n] != actions[n - 1])]
    for begin, end in zip(starts, [*starts[1:], len(actions) - 1], strict=True):
        colour = action_colour(actions[begin])
        axes.axvspan(times[begin], times[end], color=colour, alpha=0.35, lw=0, zorder=0)


def _title(episode: RecordedEpisode) -> str:
    config = episode.config
    off = config.perturbation
    broken = "" if off is None else f", {off.kind} {off.amount:g} {off.unit}"
    return f"{config.world}, {config.robot}, seed {config.seed}{broken}: {episode.outcome}"
