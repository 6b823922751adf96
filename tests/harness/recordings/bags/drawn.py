"""Bags drawn at random: a robot that turns in a room, recorded as drivers record, or wrongly."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.harness.recordings.bags.making import Bag, at
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions

CORNERS = [(-2.0, -3.0), (6.0, -3.0), (6.0, 4.0), (-2.0, 4.0)]
PILLAR = [(3.0, 1.5), (3.4, 1.5), (3.4, 1.9), (3.0, 1.9)]
WALLS = np.array([(a, b) for c in (CORNERS, PILLAR) for a, b in zip(c, c[1:] + c[:1], strict=True)])
START, PERIOD, SWEEPS, BEAMS = 1000.0, 0.1, 12, 90
SET_BACK_AT = SWEEPS * PERIOD - 1e-6
NEAR = 0.15
"""Distance from a wall within which a return is on it, m: that of the wall's own cells."""


@dataclass
class Plan:
    """What is recorded, and how. The defaults are those of a driver that does all right."""

    sensor: str = "scan"
    kind: str = "mcap"
    turn: float = 1.2
    mount: tuple[float, float, float] = (0.2, 0.0, 0.4)
    time_field: str = "time"
    time_type: str = "f4"
    time_scale: float = 1.0
    time_origin: str = "first"
    time_offset: float = 0.0
    increment_scale: float = 1.0
    is_reversed: bool = False
    codes: tuple[float, ...] = ()
    encoding: str = "16UC1"
    info: str = "K"
    set_back: float = 0.0
    changes: tuple[str, ...] = field(default=())


def poses(times, turn):
    """Return positions (n, 2) and headings (n,) of the body at times after the start, s."""
    return np.column_stack([0.3 + 0.6 * times, 0.2 * np.sin(times)]), 0.3 + turn * times


def cast(origins, angles):
    """Return the distances (n,) of the walls from origins (n, 2) along angles (n,), m."""
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    first, along = WALLS[:, 0], WALLS[:, 1] - WALLS[:, 0]
    cross = directions[:, None, 0] * along[:, 1] - directions[:, None, 1] * along[:, 0]
    away = first - origins[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (away[..., 0] * along[:, 1] - away[..., 1] * along[:, 0]) / cross
        place = (
            away[..., 0] * directions[:, None, 1] - away[..., 1] * directions[:, None, 0]
        ) / cross
    hit = (distance > 0.0) & (place >= 0.0) & (place <= 1.0)
    return np.where(hit, distance, np.inf).min(axis=1)


def from_walls(points):
    """Return the distances (n,) of points (n, 2) from the nearest wall, m."""
    first, along = WALLS[:, 0], WALLS[:, 1] - WALLS[:, 0]
    share = ((points[:, None] - first) * along).sum(-1) / (along * along).sum(-1)
    nearest = first + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def yaw(angle):
    return (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))


class Recorder:
    """Writes the bag of a plan."""

    def __init__(self, plan: Plan, seed: int):
        self.plan, self.bag, self.random = plan, Bag(plan.kind), np.random.default_rng(seed)
        self.moments = []

    def stamp(self, moment):
        """Return the stamp of a moment of the drive, s: the clock is set back in its middle."""
        return START + moment - (self.plan.set_back if moment >= SET_BACK_AT else 0.0)

    def sent_at(self, moment):
        """Say when the messages were sent that were added since."""
        self.moments += [moment] * (len(self.bag.messages) - len(self.moments))

    def seen(self, moment, offsets, angles, mount=None):
        """Return the ranges (n,) at offsets (n,) after a moment along angles of the sensor."""
        x, y, heading = mount or self.plan.mount
        position, yaws = poses(moment + offsets, self.plan.turn)
        turned = np.column_stack(
            [np.cos(yaws) * x - np.sin(yaws) * y, np.sin(yaws) * x + np.cos(yaws) * y]
        )
        return cast(position + turned, yaws + heading + angles)

    def coded(self, ranges):
        """Return ranges; each tenth is a code for nothing measured."""
        ranges = ranges.copy()
        for k, code in enumerate(self.plan.codes):
            ranges[5 + 3 * k :: 10 * len(self.plan.codes)] = code
        return ranges

    def transforms(self):
        plan, (x, y, heading) = self.plan, self.plan.mount
        frame = {"scan": "laser", "cloud": "lidar", "depth": "camera"}[plan.sensor]
        static = at(x, y, 0.0, yaw(heading))
        if plan.sensor == "depth":  # z ahead, x to the right
            c, s = np.cos(heading / 2), np.sin(heading / 2)
            half = 0.5 * np.array([c + s, -c - s, c - s, -c + s])
            static = at(x, y, 0.0, tuple(half))
        if {"static_corrected", "static_missing"}.intersection(plan.changes) == {
            "static_corrected"
        }:
            self.bag.tf("base_link", frame, 0.0, at(x + 1.0, y, 0.0), "/tf_static")
        if "static_missing" not in plan.changes:
            self.bag.tf("base_link", frame, 0.0, static, "/tf_static")
        self.sent_at(-np.inf)
        times = np.arange(-0.5, self.sweeps * PERIOD + 0.5, 0.02)
        if "gap" in plan.changes:
            times = times[(times < 0.3) | (times > 0.9)]
        if "late_start" in plan.changes:
            times = times[times > 0.35]
        order = np.arange(len(times))
        if "shuffled" in plan.changes:
            order = np.argsort(order + self.random.uniform(0, 5, len(order)))
        if "broken_poses" in plan.changes:
            self.bag.tf("odom", "base_link", START + 0.311, at(np.nan, 0.0))
            self.bag.tf("odom", "base_link", START + 0.313, at(0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0)))
            self.sent_at(0.313)
        for place, k in enumerate(order):
            position, heading = poses(times[[k]], plan.turn)
            one, stamp = at(*position[0], 0.0, yaw(heading[0])), self.stamp(times[k])
            if "odometry" in plan.changes:
                self.bag.odometry(stamp, one)
            else:
                self.bag.tf("odom", "base_link", stamp, one)
            if "two_parents" in plan.changes:
                wheels = at(*(1.1 * position[0]), 0.0, yaw(heading[0]))
                self.bag.tf("wheels", "base_link", stamp, wheels)
            self.sent_at(times[place])

    @property
    def sweeps(self):
        return 2 * SWEEPS if self.plan.set_back else SWEEPS

    def scan(self, moment, number):
        plan, step, stamp = self.plan, 2 * np.pi / BEAMS, self.stamp(moment)
        angles = -np.pi + step * np.arange(BEAMS)
        each = PERIOD / BEAMS * (-1 if plan.is_reversed else 1)
        frame, mount = "laser", plan.mount
        if "two_frames" in plan.changes and number % 2:
            frame, mount = "rear", (-0.2, 0.0, 3.0)
            if number == 1:
                self.bag.tf("base_link", "rear", 0.0, at(-0.2, 0.0, 0.0, yaw(3.0)), "/tf_static")
        if "slash" in plan.changes:
            frame = "/" + frame
        ranges = self.seen(moment, each * np.arange(BEAMS), angles, mount)
        most = float(ranges.max()) if "maximum_varies" in plan.changes else 30.0
        if "maximum_is_code" in plan.changes:
            ranges[::7] = most
        self.bag.scan(
            stamp,
            self.coded(ranges),
            frame=frame,
            angle_min=-np.pi,
            angle_max=np.pi - step,
            angle_increment=step / 2 if "increment_halved" in plan.changes else step,
            time_increment=each * plan.increment_scale,
            scan_time=PERIOD,
            range_max=most,
        )

    def cloud(self, moment, number):
        plan, shares, stamp = self.plan, np.arange(BEAMS) / BEAMS, self.stamp(moment)
        offsets = PERIOD * shares
        origin = {"first": 0.0, "middle": PERIOD / 2, "last": offsets[-1]}.get(
            plan.time_origin, 0.0
        )
        angles = -np.pi + 2 * np.pi * shares
        ranges = self.coded(self.seen(moment, offsets - origin, angles))
        with np.errstate(invalid="ignore"):  # codes
            x, y = ranges * np.cos(angles), ranges * np.sin(angles)
        columns = {
            "x": x.astype(np.float32),
            "y": y.astype(np.float32),
            "z": np.zeros(BEAMS, np.float32),
        }
        if plan.time_field:
            times = offsets - origin
            if plan.time_scale == 0.0:  # a share of the period
                times, scale = times / PERIOD, 1.0
            else:
                scale = plan.time_scale
            times = times + plan.time_offset
            if plan.time_origin == "epoch":
                times = times + stamp
            times = times * scale
            if "few_wrong" in plan.changes:
                times[[3, 50]] = times[[3, 50]] + 30 * PERIOD * scale
            if plan.time_type[0] in "iu":
                times = np.rint(times)
            columns[plan.time_field] = times.astype(plan.time_type)
        self.bag.cloud(stamp, columns)

    def depth(self, moment, number):
        plan, rows, columns, focal = self.plan, 12, 48, 30.0
        stamp = self.stamp(moment)
        binning = 2 if plan.info == "binned" else 1
        cut = 8 if plan.info == "roi" else 0
        if "intrinsics_change" in plan.changes and number >= SWEEPS // 2:
            focal = 45.0
        centre = (columns - 1) / 2
        across = (np.arange(columns) - centre) / focal
        # Along the optical axis, each pixel looks to the right of it: a negative angle.
        ranges = self.seen(moment, np.zeros(columns), -np.arctan(across))
        depths = ranges / np.sqrt(1.0 + across**2)
        image = np.tile(depths, (rows, 1))
        image = self.coded(image.reshape(-1)).reshape(rows, columns)
        kind = {"16UC1": "<u2", "32FC1": "<f4", "mono16": "<u2"}[plan.encoding]
        if "big_endian" in plan.changes:
            kind = ">" + kind[1:]
        if "millimetres" in plan.changes:
            image = image * 1000.0
        elif kind[1] == "u":
            filled = np.where(np.isfinite(image) & (image >= 0), image * 1000, 65535)
            image = np.clip(np.rint(filled), 0, 65535)
        pixels, big = image.astype(kind), int(kind[0] == ">")
        if "padded" in plan.changes:
            wide = np.zeros((rows, columns + 3), kind)
            wide[:, :columns] = pixels
            changed = {"width": columns, "step": wide.strides[0]}
            self.bag.image(stamp, wide, plan.encoding, is_bigendian=big, **changed)
        else:
            self.bag.image(stamp, pixels, plan.encoding, is_bigendian=big)
        self.info(stamp, (rows, columns), focal, centre, binning, cut)

    def info(self, stamp, shape, focal, centre, binning, cut):
        """Write a CameraInfo of the whole sensor; the image may be a part of it, binned."""
        rows, columns = shape
        fx, cx = focal * binning, (centre + 0.5) * binning - 0.5 + cut
        cy = ((rows - 1) / 2 + 0.5) * binning - 0.5 + cut
        matrix = np.array([fx, 0, cx, 0, fx, cy, 0, 0, 1.0])
        projection = np.array([fx, 0, cx, 0, 0, fx, cy, 0, 0, 0, 1.0, 0])
        full = rows * binning + 2 * cut, columns * binning + 2 * cut
        roi = {"x_offset": cut, "y_offset": cut}
        if cut:
            roi |= {"height": rows * binning, "width": columns * binning}
        lens = {
            "K": np.zeros(9) if self.plan.info == "P" else matrix,
            "P": np.zeros(12) if self.plan.info == "K" else projection,
        }
        if self.plan.info == "distorted":
            lens["D"] = np.array([-0.3, 0.1, 0.0, 0.0, 0.0])
        self.bag.camera(stamp, full, fx, roi, binning if binning > 1 else 0, **lens)

    def record(self, path: Path) -> Path:
        self.transforms()
        moments = PERIOD * np.arange(self.sweeps)
        order = np.arange(self.sweeps)
        if "sweeps_shuffled" in self.plan.changes:
            order = np.argsort(order + self.random.uniform(0, 3, self.sweeps))
        for number, k in enumerate(order):
            write = {"scan": self.scan, "cloud": self.cloud, "depth": self.depth}[self.plan.sensor]
            write(float(moments[k]), number)
            self.sent_at(moments[number])
        if "by_topic" not in self.plan.changes:
            sent = np.argsort(self.moments, kind="stable")
            self.bag.messages = [self.bag.messages[k] for k in sent]
        return self.bag.write(path)


@dataclass(frozen=True)
class Read:
    """What a recording was read as.

    Attributes:
        refused: The line of the refusal, empty if it was read.
        returns: Number of returns.
        wrong: Share of them that lie on no wall.
        faults: Faults by kind.
    """

    refused: str
    returns: int = 0
    wrong: float = 0.0
    faults: dict[str, int] = field(default_factory=dict)

    @property
    def is_silent_and_wrong(self) -> bool:
        is_told = self.refused or any(
            kind.startswith(("sweep:", "message:")) for kind in self.faults
        )
        return not is_told and (self.wrong > 0.02 or self.returns == 0)


def read(path: Path) -> Read:
    """Place the returns of a bag in the world, and lay them beside the walls."""
    try:
        recording = open_recording(path, options=RecordingOptions(pixel_stride=1))
        places = []
        for sweep in recording.sweeps():
            met = np.isfinite(sweep.ranges)
            offsets = sweep.beam_times_ns
            times = sweep.time_ns + (0 if offsets is None else offsets[met])
            times = np.broadcast_to(np.asarray(times, np.int64), met.sum())
            covered = recording.track.covers(times)
            position, quaternion = recording.track.at(times)
            points = sweep.directions[met] * sweep.ranges[met, None].astype(float)
            mount = sweep.T_body_sensor
            points = rotated(mount.quaternion[None], points) + mount.position
            places.append((rotated(quaternion, points) + position)[covered, :2])
    except InputError as error:
        return Read(str(error))
    points = np.concatenate(places) if places else np.empty((0, 2))
    wrong = float((from_walls(points) > NEAR).mean()) if len(points) else 0.0
    return Read("", len(points), wrong, recording.faults)


def rotated(quaternions, vectors):
    w, xyz = quaternions[:, :1], quaternions[:, 1:]
    cross = np.cross(xyz, vectors)
    return vectors + 2 * (w * cross + np.cross(xyz, cross))
