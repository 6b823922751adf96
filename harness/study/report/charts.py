"""Small charts as SVG text, a few kB each, legible at the width of a phone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import escape
from numpy.typing import NDArray

from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.report.palette import LABEL, action_colour

Array = NDArray[np.float64]

WIDTH, HEIGHT = 420, 150
"""Size of a chart in units of the SVG, which are pixels on a phone."""

LEFT, RIGHT, TOP, BOTTOM = 42, 8, 8, 20
"""Margins of the plotted area."""

STRIP_HEIGHT = 46

HALF_LABEL = 16
"""Half the width of the label of a time."""


COLOURS = ("#2b6cb0", "#d55e00", "#009e73", "#cc79a7", "#806000", "#444444")
"""Colours of curves, in turn, which differ for the colour-blind as well."""

REACH = 1.5
"""Reach of the axis beyond the means, in their spread or their size: an interval may be a hundred
times as wide, and would press the means together."""

ASIDE = 5
"""Distance between the points of two curves, so that no interval hides another."""


class Curve(NamedTuple):
    """Means over the amount of a perturbation.

    Attributes:
        name: Name in the legend; empty of a single curve.
        doses: Severity and amount of each mean; the first is that of the unperturbed twin.
        means: Means with their intervals; None where no episode has the figure.
    """

    name: str
    doses: Sequence[tuple[float, float]]
    means: Sequence[Interval | None]


class Line(NamedTuple):
    """A line of a chart.

    Attributes:
        name: Name in the legend.
        colour: Colour of the line.
        values: (n,) values; one that is not finite is left out.
        dashed: Whether the line is dashed.
    """

    name: str
    colour: str
    values: Array
    dashed: bool = False


class Mark(NamedTuple):
    """A vertical line at a time, s."""

    name: str
    colour: str
    time: float


def line_chart(
    times: Array,
    lines: Sequence[Line],
    marks: Sequence[Mark] = (),
    top: float | None = None,
    stacked: bool = False,
) -> str:
    """Draw lines over time, clipped to `top`.

    Args:
        times: (n,) s.
        lines: Lines of n values.
        marks: Vertical lines.
        top: Upper end of the axis; the greatest value if None.
        stacked: Whether each is an area on top of those before it, all of finite values.
    """
    if stacked:
        heights = np.cumsum([one.values for one in lines], axis=0)
        lines = [one._replace(values=height) for one, height in zip(lines, heights, strict=True)]
    finite = np.concatenate([one.values[np.isfinite(one.values)] for one in lines])
    high = top if top is not None else float(finite.max(initial=0.0))
    low = min(0.0, float(finite.min(initial=0.0)))
    ticks = nice_ticks(low, high if high > low else low + 1.0)
    low, high = min(low, ticks[0]), max(high, ticks[-1])
    across = _scale(float(times[0]), float(times[-1]), LEFT, WIDTH - RIGHT)
    down = _scale(low, high, HEIGHT - BOTTOM, TOP)
    parts = [_y_tick(tick, down(tick)) for tick in ticks]
    parts += [_x_tick(tick, across(tick)) for tick in nice_ticks(float(times[0]), float(times[-1]))]
    parts += [_mark(one, across(one.time)) for one in marks]
    for line in reversed(lines) if stacked else ():
        shown = np.minimum(line.values, high)
        corners = [(times[0], 0.0), *zip(times, shown, strict=True), (times[-1], 0.0)]
        points = " ".join(f"{across(t):.1f},{down(v):.1f}" for t, v in corners)
        parts.append(f'<polygon points="{points}" fill="{line.colour}"/>')
    for line in () if stacked else lines:
        dash = ' stroke-dasharray="5 3"' if line.dashed else ""
        shown = np.minimum(line.values, high)
        for run in _runs(np.isfinite(line.values)):
            points = " ".join(
                f"{across(t):.1f},{down(v):.1f}"
                for t, v in zip(times[run], shown[run], strict=True)
            )
            parts.append(
                f'<polyline points="{points}" fill="none" stroke="{line.colour}" '
                f'stroke-width="1.6"{dash}/>'
            )
    return _svg(HEIGHT, parts)


def strip(times: Array, actions: Sequence[str], labels: Sequence[str], late: Sequence[bool]) -> str:
    """Draw the actions over time as a strip, with failure labels below; each names itself."""
    ends = [*times[1:], times[-1] + (times[-1] - times[0]) / max(len(times) - 1, 1)]
    across = _scale(float(times[0]), float(ends[-1]), LEFT, WIDTH - RIGHT)
    parts = []
    for first, last in _blocks(actions):
        parts.append(
            _block(
                across(times[first]),
                x2=across(ends[last]),
                y=4,
                height=16,
                colour=action_colour(actions[first]),
            )
            + f"<title>{escape(actions[first])}, decisions {first} to {last}</title></rect>"
        )
    for first, last in _blocks(labels):
        if labels[first] not in ("", "none"):
            parts.append(
                _block(across(times[first]), x2=across(ends[last]), y=22, height=5, colour=LABEL)
                + f"<title>{escape(labels[first])}, decisions {first} to {last}</title></rect>"
            )
    for time, was_late in zip(times, late, strict=True):
        if was_late:
            x = across(time)
            parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="2" y2="22" stroke="#000"/>')
    parts += [
        _x_tick(tick, across(tick), STRIP_HEIGHT)
        for tick in nice_ticks(float(times[0]), float(ends[-1]))
    ]
    return _svg(STRIP_HEIGHT, parts)


def bars_chart(curves: Sequence[Curve], label: str, ylabel: str, top: float | None = None) -> str:
    """Draw means with their intervals over the amount of a perturbation, curves side by side.

    Args:
        curves: One, or one for each stack. The severities are spaced evenly, with their amounts.
        label: Label of the amounts.
        ylabel: Label of the mean.
        top: Upper end of the axis; none if None. An interval that continues beyond the axis, or has
            no end, ends in an arrow.
    """
    doses = sorted({dose for curve in curves for dose in curve.doses})
    low, high = limits_of(curves, top)
    across = _scale(doses[0][0], doses[-1][0], LEFT + 20, WIDTH - RIGHT - 20)
    down = _scale(low, high, HEIGHT - BOTTOM, TOP + 14)
    parts = [_y_tick(tick, down(tick)) for tick in nice_ticks(low, high)]
    parts.append(f'<text x="{LEFT}" y="{TOP + 4}">{escape(ylabel)}</text>')
    for severity, amount in doses:
        middle = f'<text x="{across(severity):.1f}" text-anchor="middle"'
        parts.append(f'{middle} y="{HEIGHT - 6}">{amount:g}</text>')
        parts.append(f'{middle} y="{HEIGHT + 8}">{severity:g}</text>')
    parts.append(f'<text x="{WIDTH}" y="{HEIGHT + 22}" text-anchor="end">{escape(label)}</text>')
    for place, curve in enumerate(curves):
        colour = COLOURS[place % len(COLOURS)]
        aside = ASIDE * (place - 0.5 * (len(curves) - 1))
        known = [
            (across(severity) + aside, one)
            for (severity, _), one in zip(curve.doses, curve.means, strict=True)
            if one
        ]
        points = " ".join(f"{x:.1f},{down(one.estimate):.1f}" for x, one in known)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}"/>')
        for x, one in known:
            parts.append(
                f'<circle cx="{x:.1f}" cy="{down(one.estimate):.1f}" r="3" fill="{colour}"/>'
            )
            parts += [
                _bar(x, one.estimate, end, (low, high), down, colour) for end in (one.low, one.high)
            ]
        if curve.name:
            y = HEIGHT + 36 + 14 * place
            parts.append(f'<text x="{LEFT}" y="{y}" fill="{colour}">{escape(curve.name)}</text>')
    names = sum(bool(curve.name) for curve in curves)
    return _svg(HEIGHT + 28 + 14 * names, parts)


def limits_of(curves: Sequence[Curve], top: float | None) -> tuple[float, float]:
    """Return the ends of the axis: all means lie on it, and the parts of intervals near them."""
    if top is not None:
        return 0.0, top
    known = [one for curve in curves for one in curve.means if one]
    if not known:
        return 0.0, 1.0
    least, most = (end(one.estimate for one in known) for end in (min, max))
    near = REACH * max(most - least, abs(most), 1e-9)
    low = max(least - near, min(one.low for one in known))
    return min(0.0, low), max(min(most + near, max(one.high for one in known)), 1e-9)


def _bar(
    x: float, middle: float, end: float, limits: tuple[float, float], down: _scale, colour: str
) -> str:
    """Return half an interval, which ends in an arrow where it continues beyond the limits."""
    y = down(min(max(end, limits[0]), limits[1]))
    sign = 5 if end < middle else -5
    tip = f"M{x - 4:.1f} {y:.1f}h8"
    if not limits[0] <= end <= limits[1]:
        tip = f"M{x - 4:.1f} {y:.1f}l4 {sign}l4 {-sign}"
    way = f"M{x:.1f} {down(middle):.1f}V{y:.1f}{tip}"
    return f'<path d="{way}" fill="none" stroke="{colour}" stroke-width="1.3"/>'


def stairs(thresholds: Sequence[float], greatest: float, label: str) -> str:
    """Draw the share of seeds that still reach the goal over severity."""
    across = _scale(0.0, greatest, LEFT, WIDTH - RIGHT)
    down = _scale(0.0, 1.0, HEIGHT - BOTTOM, TOP)
    steps = sorted(value for value in thresholds if value <= greatest)
    way = f"M{LEFT} {down(1.0):.1f}"
    for number, step in enumerate(steps, 1):
        way += f"H{across(step):.1f}V{down(1.0 - number / len(thresholds)):.1f}"
    parts = [_y_tick(tick, down(tick)) for tick in nice_ticks(0.0, 1.0)]
    for tick in nice_ticks(0.0, greatest):
        parts.append(
            f'<text x="{across(tick):.1f}" y="{HEIGHT - 4}" text-anchor="middle">{tick:g}</text>'
        )
    parts.append(f'<path d="{way}H{WIDTH - RIGHT}" fill="none" stroke="{COLOURS[0]}"/>')
    caption = f"share that bears it, over {escape(label)}"
    parts.append(f'<text x="{WIDTH}" y="{HEIGHT + 10}" text-anchor="end">{caption}</text>')
    return _svg(HEIGHT + 14, parts)


def nice_ticks(low: float, high: float, most: int = 5) -> list[float]:
    """Return round numbers from low to high, at most `most` + 1 of them."""
    if not high > low:
        return [low]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


class _scale(NamedTuple):
    """Linear map from values to units of the SVG."""

    low: float
    high: float
    begin: float
    end: float

    def __call__(self, value: float) -> float:
        share = (value - self.low) / ((self.high - self.low) or 1.0)
        return self.begin + share * (self.end - self.begin)


def _runs(kept: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of entries that are kept."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], kept.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _blocks(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return the first and last index of each run of one name."""
    starts = [k for k in range(len(names)) if k == 0 or names[k] != names[k - 1]]
    return list(zip(starts, [*(k - 1 for k in starts[1:]), len(names) - 1], strict=True))


def _block(x1: float, x2: float, y: float, height: float, colour: str) -> str:
    width = max(x2 - x1, 0.6)
    return f'<rect x="{x1:.1f}" y="{y}" width="{width:.1f}" height="{height}" fill="{colour}">'


def _mark(mark: Mark, x: float) -> str:
    return (
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" '
        f'stroke="{mark.colour}" stroke-dasharray="2 2"><title>{escape(mark.name)}</title></line>'
    )


def _y_tick(value: float, y: float) -> str:
    return (
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e2e8f0"/>'
        f'<text x="{LEFT - 4}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
    )


def _x_tick(value: float, x: float, height: int = HEIGHT) -> str:
    """Return the label of a time; one at the right edge ends there."""
    if x > WIDTH - HALF_LABEL:
        return f'<text x="{WIDTH}" y="{height - 4}" text-anchor="end">{value:g} s</text>'
    return f'<text x="{x:.1f}" y="{height - 4}" text-anchor="middle">{value:g} s</text>'


def _svg(height: int, parts: Sequence[str]) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" font-size="11" fill="#4a5568" role="img">'
        f"{''.join(parts)}</svg>"
    )
