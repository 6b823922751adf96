"""Errors of the ranges of a sweep, as the sweep itself shows them, those before it or the map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from wayproof.harness.config import Config
from wayproof.harness.inputs import Beams, WorldSweep
from wayproof.maps import range_image
from wayproof.maps.echo_history import MOST_CONTRADICTED, EchoHistory, are_contradicted
from wayproof.maps.representation import Representation
from wayproof.maps.sweep import Ranges
from wayproof.models.sensors.beams import NO_RETURN

SMALLEST = 0.06
"""Width of the smallest things that must not be taken for rain, m: farther away than a range at
which beams are as far apart, one of them may meet a thing alone."""

LEAST_STEP = 1e-4
"""Least distance of neighbouring beams at 1 m that is looked at, m; a table may repeat a column."""

NO_HISTORY: Mapping[str, EchoHistory] = MappingProxyType({})


def echo_histories(
    sensors: Iterable[str], config: Config, before: Mapping[str, EchoHistory] = NO_HISTORY
) -> dict[str, EchoHistory]:
    """Return the echoes of each sensor by name, as before or of none; empty if none are judged."""
    if config.map.no_return != "free":
        return {}
    return {name: before.get(name) or EchoHistory() for name in sensors}


def without_lost_echoes(placed: WorldSweep, beams: Beams) -> WorldSweep:
    """Return a sweep without the beams that lost their echo: no return between returns.

    A sensor that reports no return as free space would clear what those beams met.

    Args:
        placed: The sweep in the world frame.
        beams: Its sensor; only a grid has neighbouring beams.
    """
    if not beams.is_image or not (placed.ranges_mm == NO_RETURN).any():
        return placed
    lost = range_image.lost_echoes(_image(placed.ranges_mm, beams), beams.table.closed)
    return placed.without(lost.ravel())


def without_lost_patches(
    placed: WorldSweep, range_m: float, history: EchoHistory, voxel_map: Representation
) -> WorldSweep:
    """Return a sweep without the beams that fell silent lately, where the map contradicts them.

    Args:
        placed: The sweep in the world frame.
        range_m: Range up to which its beams without return clear, m.
        history: Echoes of its sensor in the sweeps before, which takes in this one.
        voxel_map: Map of the sweeps before.
    """
    beams = len(placed.ranges_mm)
    count = history.take_in(placed.directions, placed.ranges_mm)
    if not history.loses_echoes or 100 * count <= MOST_CONTRADICTED * beams:
        return placed
    recent = history.recently_silent(placed.directions, placed.ranges_mm)
    contradicted = are_contradicted(
        voxel_map,
        placed.origins[placed.moments[recent]],
        placed.directions[recent],
        range_m,
        beams,
    )
    return placed.without(recent) if contradicted else placed


def without_false_returns(placed: WorldSweep, beams: Beams, deviation: float) -> WorldSweep:
    """Return a sweep without the returns of rain, snow or dust: no evidence along those beams.

    Args:
        placed: The sweep in the world frame.
        beams: Its sensor; only a grid has neighbouring beams.
        deviation: Standard deviation of the ranges, m.
    """
    if not beams.is_image:
        return placed
    false = range_image.false_returns(
        _image(placed.ranges_mm, beams),
        beams.table.closed,
        farthest_m=SMALLEST / max(beams.column_step, LEAST_STEP),
        deviation_m=deviation,
    )
    return placed if false is None else placed.without(false.ravel())


def range_deviation(placed: WorldSweep, beams: Beams) -> float:
    """Estimate the standard deviation of the ranges of a sweep, m; 0 where it is no image."""
    if not beams.is_image:
        return 0.0
    return range_image.range_deviation(_image(placed.ranges_mm, beams)) or 0.0


def _image(ranges_mm: Ranges, beams: Beams) -> Ranges:
    image: Ranges = ranges_mm.reshape(len(beams.table.rows), len(beams.table.columns))
    return image
