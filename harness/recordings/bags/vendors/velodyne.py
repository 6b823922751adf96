"""Packets of Velodyne's lidars, `velodyne_msgs/VelodyneScan`: VLP-16 and HDL-32E.

The layout of a packet, the angles of the lasers and the times of their firings are those of the
makers' manuals (VLP-16 User Manual 63-9243 Rev. D, chapters 9 and appendix A; HDL-32E User Manual
63-9113 Rev. M, appendix E). Both have 1,206 bytes: 12 blocks of a flag, an azimuth and 32 returns,
the time of the first firing, and how and by what they were measured.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.parts import Cloud, Vendor, stamp_of
from wayproof.harness.recordings.options import Broken

Floats = NDArray[np.floating[Any]]

TYPE = "velodyne_msgs/msg/VelodyneScan"

BLOCKS, RETURNS, FLAG = 12, 32, 0xEEFF
STEP_M = 0.002
"""Metres in a unit of distance."""

CENTIDEGREES = 36_000
HOUR_US = 3_600_000_000
DUAL = 0x39
"""Return mode in which two blocks hold the last and the strongest return of the same firings."""

PACKET = np.dtype(
    [
        (
            "blocks",
            [
                ("flag", "<u2"),
                ("azimuth", "<u2"),
                ("returns", [("distance", "<u2"), ("reflectivity", "u1")], RETURNS),
            ],
            BLOCKS,
        ),
        ("time_us", "<u4"),
        ("mode", "u1"),
        ("model", "u1"),
    ]
)


class Model(NamedTuple):
    """A lidar's lasers in the order in which they fire.

    Attributes:
        name: Name.
        elevations: (l,) degrees.
        heights: (l,) height of each laser above the origin, m.
        firing_us: Time from one laser to the next, microseconds.
        cycle_us: Time from one firing of all lasers to the next, microseconds.
    """

    name: str
    elevations: Floats
    heights: Floats
    firing_us: float
    cycle_us: float


_VLP16 = np.column_stack([np.arange(-15, 0, 2), np.arange(1, 16, 2)]).ravel().astype(float)
_HDL32 = np.column_stack([np.arange(-23, -7), np.arange(-7, 9)]).ravel() * (4.0 / 3.0)
MODELS = {
    0x22: Model("VLP-16", _VLP16, -_VLP16 * 11.2e-3 / 15.0, 2.304, 55.296),
    0x21: Model("HDL-32E", _HDL32, np.zeros(32), 1.152, 46.08),
}
"""Last byte of a packet -> lidar. The HDL-32E's lasers are a 4/3 degree apart."""


def read(message: Any) -> Cloud:
    """Return the points of a VelodyneScan with their times, ns from its stamp.

    The times are those of the lidar's clock, from hour to hour, moved so that packets were stamped
    when they were complete, as the driver does it.

    Raises:
        Broken: A packet is of another lidar, or none.
    """
    stamp, frame = stamp_of(message.header), message.header.frame_id
    if not message.packets:
        empty = np.empty((0, 3), np.float32)
        return Cloud(empty, np.empty(0, np.int64), "packets", stamp, frame, is_ns=True)
    packets = np.stack([np.asarray(one.data, np.uint8) for one in message.packets])
    rows = packets.view(PACKET).reshape(-1)
    model = _model(rows)
    firings = _firings(rows, model)
    stamps = np.array([stamp_of(one) for one in message.packets]) - stamp
    begun = (rows["time_us"].astype(np.int64) - int(rows["time_us"][0])) % HOUR_US
    begun = np.where(begun > HOUR_US // 2, begun - HOUR_US, begun)
    ended = (begun + firings.times_us.max()) * 1e3
    shift = float(np.median(stamps - ended))
    times = np.rint((begun[:, None, None] + firings.times_us) * 1e3 + shift).astype(np.int64)
    met = firings.distances > 0.0
    points = _points(firings, model)[met].astype(np.float32)
    return Cloud(points, times[met], "packets", stamp, frame, is_ns=True)


class _Firings(NamedTuple):
    """Returns of p packets, f firings in each, l lasers.

    Attributes:
        azimuths: (p, f, l) clockwise from the x axis, rad.
        distances: (p, f, l) m, 0 without a return.
        times_us: (f, l) since the packet's first laser fired, microseconds.
    """

    azimuths: Floats
    distances: Floats
    times_us: Floats


def _model(rows: NDArray[Any]) -> Model:
    numbers = set(rows["model"].tolist())
    if len(numbers) != 1 or not numbers <= MODELS.keys():
        listed = ", ".join(f"0x{number:02x}" for number in sorted(numbers))
        known = ", ".join(f"0x{number:02x} ({one.name})" for number, one in MODELS.items())
        raise Broken(f"packets of the model {listed}, expected {known}")
    if (rows["blocks"]["flag"] != FLAG).any():
        raise Broken("packets without the flags of a Velodyne")
    return MODELS[numbers.pop()]


def _firings(rows: NDArray[Any], model: Model) -> _Firings:
    """Return the firings of packets (p,); of two returns of one firing the nearer."""
    azimuths = rows["blocks"]["azimuth"].astype(np.int64)
    units = rows["blocks"]["returns"]["distance"].astype(np.int64)
    if (dual := rows["mode"] == DUAL).any():
        if not dual.all():
            raise Broken("packets of one and of two returns in one scan")
        azimuths, pairs = azimuths[:, ::2], units.reshape(len(rows), -1, 2, RETURNS)
        either, nearer = pairs.max(axis=2), pairs.min(axis=2)
        units = np.where(nearer > 0, nearer, either)
    lasers = len(model.elevations)
    in_block = RETURNS // lasers
    after = model.cycle_us * np.arange(in_block)[:, None] + model.firing_us * np.arange(lasers)
    steps = np.diff(azimuths, axis=1) % CENTIDEGREES
    speed = np.median(steps, axis=1) / (model.cycle_us * in_block)  # (p,), a degree's 100th by us
    turned = azimuths[:, :, None, None] + speed[:, None, None, None] * after
    begun = model.cycle_us * in_block * np.arange(azimuths.shape[1])
    shape = len(rows), -1, lasers
    return _Firings(
        azimuths=np.radians(turned.reshape(shape) / 100.0),
        distances=units.reshape(shape) * STEP_M,
        times_us=(begun[:, None, None] + after).reshape(-1, lasers),
    )


def _points(firings: _Firings, model: Model) -> Floats:  # (p, f, l, 3)
    """Return the ends of beams: x ahead, y to the left, z up, as of the driver."""
    up = np.radians(model.elevations)
    flat = firings.distances * np.cos(up)
    x, y = flat * np.cos(firings.azimuths), -flat * np.sin(firings.azimuths)
    return np.stack([x, y, firings.distances * np.sin(up) + model.heights], axis=-1)


VENDOR = Vendor(
    definitions={
        "velodyne_msgs/msg/VelodynePacket": "time stamp\nuint8[1206] data\n",
        TYPE: "std_msgs/Header header\nVelodynePacket[] packets\n",
    },
    clouds={TYPE: read},
)
