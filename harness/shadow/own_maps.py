"""The robot's own maps, recorded with it, laid beside the map of a decision cell by cell."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.types import OWN_CLOSED, OWN_FREE, OWN_UNKNOWN, OwnMap
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.types import PlannerInput
from wayproof.maps.elementary import sines_cosines

MOST_CELLS = 2**24
"""Greatest number of cells of a map."""

OURS = ("admitted", "unknown", "blocked")
"""What we call a place of the robot's centre: admitted by the unknown policy; not admitted for
what is unknown alone; too near to what is occupied."""

THEIRS = {OWN_FREE: "free", OWN_UNKNOWN: "unknown", OWN_CLOSED: "lethal"}
"""What the robot's own costmap calls it: lethal includes inscribed costs."""


@dataclass
class OwnMaps:
    """Maps of one topic beside ours.

    Attributes:
        maps: Number of maps.
        cells: Number of their cells in our operating area by what we and the robot call them.
    """

    maps: int = 0
    cells: dict[str, dict[str, int]] = field(
        default_factory=lambda: {ours: dict.fromkeys(THEIRS.values(), 0) for ours in OURS}
    )

    @property
    def text(self) -> str:
        """Return where the two disagree, in words."""
        ours, admitted = self.cells, self.cells["admitted"]
        count = sum(sum(row.values()) for row in ours.values())
        return (
            f"{self.maps} map{'s'[: self.maps != 1]}, {count} cells in our area: of "
            f"{sum(admitted.values())} that we admit it has {admitted['lethal']} lethal and "
            f"{admitted['unknown']} unknown; of {sum(row['free'] for row in ours.values())} that "
            f"it has free we block {ours['blocked']['free']} and do not know "
            f"{ours['unknown']['free']}"
        )


def written(maps: Iterable[OwnMap], after_ns: int, until_ns: int) -> list[pb.OwnMap]:
    """Return the last map of each topic in an interval of times, as messages."""
    last = {one.topic: one for one in maps if after_ns < one.time_ns <= until_ns}
    messages = []
    for _, one in sorted(last.items()):
        message = pb.OwnMap(
            topic=one.topic,
            resolution=one.resolution,
            corner=one.corner,
            rows=one.shape[0],
            columns=one.shape[1],
            packed=one.packed,
        )
        message.timestamp.FromNanoseconds(one.time_ns)
        messages.append(message)
    return messages


def lay_beside(
    motion: pb.RecordedMotion,
    navigator: Navigator,
    planned: PlannerInput,
    found: dict[str, OwnMaps],
) -> None:
    """Count the cells of the maps of a decision, by topic.

    Args:
        motion: Recorded motion up to the decision, with the maps.
        navigator: Its costmap is that of the decision.
        planned: What a body needs that fits at some heading.
        found: Counted up.

    Raises:
        InputError: A map cannot be unpacked.
    """
    if not motion.own_maps:
        return
    costmap, threshold = navigator.costmap, planned.traversable.collision_distance_sq
    layer = int((planned.position[2] - costmap.origin[2]) / costmap.resolution)
    layer = min(max(layer, 0), costmap.shape[2] - 1)
    admitted = costmap.field()[:, :, layer] > threshold
    blocked = costmap.obstacle_clearance[:, :, layer] <= threshold
    ours = np.where(admitted, 0, np.where(blocked, 2, 1))
    for one in motion.own_maps:
        states = _unpacked(one)
        cells = np.floor((_centres(one) - costmap.origin[:2]) / costmap.resolution).astype(np.int64)
        inside = ((cells >= 0) & (cells < costmap.shape[:2])).all(axis=1)
        mine = ours[tuple(cells[inside].T)]
        beside = found.setdefault(one.topic, OwnMaps())
        beside.maps += 1
        for number, name in enumerate(OURS):
            for state, theirs in THEIRS.items():
                count = ((mine == number) & (states[inside] == state)).sum()
                beside.cells[name][theirs] += int(count)


def _unpacked(message: pb.OwnMap) -> NDArray[np.uint8]:  # (rows * columns,)
    count = message.rows * message.columns
    try:
        if count > MOST_CELLS or len(message.corner) != 3 or not message.resolution > 0.0:
            raise ValueError
        data = zlib.decompressobj().decompress(message.packed, count + 1)
        if len(data) != count:
            raise ValueError
    except (ValueError, zlib.error):
        raise InputError(f"map '{message.topic}' of the robot: damaged") from None
    return np.frombuffer(data, np.uint8)


def _centres(message: pb.OwnMap) -> NDArray[np.float64]:  # (rows * columns, 2)
    """Return the centres of the cells, row by row, m."""
    x, y, heading = message.corner
    (sine,), (cosine,) = sines_cosines(np.array([heading]))
    along = (np.arange(message.columns) + 0.5) * message.resolution
    across = (np.arange(message.rows) + 0.5)[:, None] * message.resolution
    places = x + along * cosine - across * sine, y + along * sine + across * cosine
    return np.stack(places, axis=-1).reshape(-1, 2)
