"""The way of a recorded robot in Rerun, in the colour of its verdict when it was entered."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from wayproof.harness.shadow.legs import Leg
from wayproof.harness.shadow.picture import COLOURS_OF_WAY

LANE = "way"

WAYS = tuple(f"way/{verdict}" for verdict in COLOURS_OF_WAY)
"""Entities of the way in a world, by verdict."""

LINE = rr.Radius.ui_points(2.0)
"""Radius of a line, in points of the screen: a way is long, and seen as a whole."""

ABOVE = 0.05
"""Height of the line above the body's origin, m: the layer of the map lies on the floor."""


def show_way(stream: rr.RecordingStream, legs: Sequence[Leg], root: str) -> None:
    """Send each leg at the time of its end, and its verdict to a lane from its begin on."""
    colours = {name: _packed(colour) for name, colour in COLOURS_OF_WAY.items()}
    lane = rr.StateConfiguration(
        values=list(colours), colors=np.array(list(colours.values()), np.uint32)
    )
    stream.log(f"{root}/{LANE}", lane, static=True)
    for verdict, colour in colours.items():
        style = rr.LineStrips3D.from_fields(radii=LINE, colors=colour)
        stream.log(f"{root}/world/way/{verdict}", style, static=True)
    before = ""
    for leg in legs:
        verdict = "admitted" if leg.admitted else leg.why
        stream.set_time("decision", sequence=leg.sequence)
        if verdict != before:
            stream.set_time("time", duration=np.timedelta64(leg.begin_ns, "ns"))
            stream.log(f"{root}/{LANE}", rr.StateChange(state=verdict))
            before = verdict
        stream.set_time("time", duration=np.timedelta64(leg.end_ns, "ns"))
        line = leg.poses[:, :3] + np.array([0.0, 0.0, ABOVE])
        strip = rr.LineStrips3D.from_fields(strips=[line])
        stream.log(f"{root}/world/way/{verdict}", strip)


def _packed(colour: str) -> int:
    """Return `#rrggbb` as Rerun's 0xRRGGBBAA, opaque."""
    return int(colour[1:], 16) << 8 | 0xFF
