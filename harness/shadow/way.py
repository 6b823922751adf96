"""The way of a recorded robot: its poses in the log's frame, its length, and goals along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.input_messages import unit_quaternion
from wayproof.harness.recording_config import RecordingConfig
from wayproof.harness.recordings.track import RecordedTrack

Array = NDArray[np.float64]

LEAST_STEP = 0.05
"""Least distance that counts as way, m: the poses of a robot at rest wander by less."""


SHORTEST_STEP_NS, LONGEST_STEP_NS = 1_000_000, 1_000_000_000


@dataclass(frozen=True)
class RecordedPose:
    """Pose T_world_body at one time, in the log's frame.

    Attributes:
        position: (3,) m.
        quaternion: (4,) w x y z.
    """

    position: Array
    quaternion: Array

    @property
    def row(self) -> Array:
        """x, y, z, m, and heading, rad: (4,)."""
        return np.append(self.position, yaw_of_quaternion(self.quaternion))


class Way:
    """Poses of a track in the log's frame.

    Attributes:
        positions: (n, 3) of the track's own samples, m.
        length_m: Length in steps of at least `LEAST_STEP`, m.
        step_ns: Least time between two poses, from 1 ms to 1 s, ns.
    """

    def __init__(self, track: RecordedTrack, config: RecordingConfig, *, flat: bool) -> None:
        """Shift a track to the log's origin.

        Args:
            track: Track of the recording.
            config: Config with the origin, the body's height and the rule for goals.
            flat: Whether the body's height is that of the config throughout.
        """
        self._track, self._config, self._flat = track, config, flat
        self.positions = self._shifted(track.positions)
        self._knots = knots(self.positions)
        steps = np.diff(self.positions[self._knots], axis=0)
        self._arcs = np.concatenate([[0.0], np.cumsum(np.sqrt(np.square(steps).sum(axis=1)))])
        self.length_m = float(self._arcs[-1])
        apart = np.diff(track.times_ns).min(initial=LONGEST_STEP_NS)
        self.step_ns = max(int(apart), SHORTEST_STEP_NS)

    def covers(self, time_ns: int) -> bool:
        """Return whether there is a pose at a time, ns."""
        return bool(self._track.covers(np.array([time_ns]))[0])

    def at(self, times_ns: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return positions (m, 3), m, and unit quaternions (m, 4) at times (m,), ns."""
        positions, quaternions = self._track.at(times_ns)
        turned = [unit_quaternion(quaternion) for quaternion in quaternions]
        return self._shifted(positions), np.array(turned).reshape(-1, 4)

    def pose(self, time_ns: int) -> RecordedPose:
        """Return the pose at a time, ns."""
        positions, quaternions = self.at(np.array([time_ns]))
        return RecordedPose(positions[0], quaternions[0])

    def has_gap(self, begin_ns: int, end_ns: int) -> bool:
        """Return whether poses are missing somewhere between two times, ns."""
        return self._track.has_gap(begin_ns, end_ns)

    def between(self, begin_ns: int, end_ns: int) -> Array:
        """Return poses (k, 4) in a closed interval of times: x, y, z, m, and heading, rad.

        Where the track has a gap in it, the last one alone: the way before it is not known.
        """
        own = self._track.times_ns
        if self.has_gap(begin_ns, end_ns):
            begin_ns = end_ns
        inside = own[(own > begin_ns) & (own < end_ns)]
        ends = [begin_ns] if begin_ns == end_ns else [begin_ns, end_ns]
        positions, quaternions = self.at(np.array([ends[0], *inside, *ends[1:]]))
        headings = [yaw_of_quaternion(quaternion) for quaternion in quaternions]
        return np.column_stack((positions, headings))

    def goal(self, time_ns: int) -> Array:
        """Return the goal (3,) of a decision at a time, m: see `RecordingConfig.goal`."""
        last: Array = self.positions[-1]
        if self._config.goal == "end":
            return last
        spacing = self._config.goal_distance
        index = int(np.searchsorted(self._track.times_ns, time_ns, side="right")) - 1
        knot = max(int(np.searchsorted(self._knots, index, side="right")) - 1, 0)
        arc = (np.floor(self._arcs[knot] / spacing) + 2.0) * spacing
        if arc >= self._arcs[-1]:
            return last
        goal: Array = self.positions[self._knots[int(np.searchsorted(self._arcs, arc))]]
        return goal

    def _shifted(self, positions: Array) -> Array:
        shifted: Array = positions - np.array(self._config.origin)
        if self._flat:
            shifted[:, 2] = self._config.body_height
        return shifted


def knots(positions: Array) -> NDArray[np.int64]:
    """Select points of a path (n, 3) at least `LEAST_STEP` from the one before: their indices."""
    kept = [0]
    last = positions[0]
    for index, point in enumerate(positions):
        step = point - last
        if float((step * step).sum()) >= LEAST_STEP * LEAST_STEP:
            kept.append(index)
            last = point
    return np.array(kept)
