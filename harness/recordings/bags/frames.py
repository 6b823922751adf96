"""Frames of a bag and the transforms between them, interpolated in time as tf2 does."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.parts import StampedTransform
from wayproof.harness.recordings.options import Faults
from wayproof.harness.recordings.poses import StampedPoses, sound
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.transform import Transform, compose, inverse

MOST_FRAMES = 1000
ANY_GAP = 2**62


@dataclass
class Samples:
    """Poses of one frame in another, as they are read.

    Attributes:
        stamps: Stamps, ns.
        numbers: Seven for each: position and quaternion.
        places: Places of their messages in the file.
    """

    stamps: array[int] = field(default_factory=lambda: array("q"))
    numbers: array[float] = field(default_factory=lambda: array("d"))
    places: array[int] = field(default_factory=lambda: array("q"))

    def add(self, pose: StampedTransform, place: int) -> None:
        """Take up a pose of a message at a place in the file."""
        self.stamps.append(pose.stamp_ns)
        self.numbers.extend(pose.numbers)
        self.places.append(place)

    def between(self, first: int, last: int) -> Samples:
        """Return those of messages at places in the file from the first up to, not with, a last."""
        part = slice(bisect_left(self.places, first), bisect_left(self.places, last))
        rows = slice(7 * part.start, 7 * part.stop)
        return Samples(self.stamps[part], self.numbers[rows], self.places[part])

    def poses(self) -> StampedPoses:
        """Return all poses."""
        rows = np.array(self.numbers, np.float64).reshape(-1, 7)
        return StampedPoses(np.array(self.stamps, np.int64), rows[:, :3], rows[:, 3:])


class Edge(NamedTuple):
    """The transform of a frame in its parent: one that is fixed, or one that moves.

    Attributes:
        parent: Parent frame.
        child: The frame.
        fixed: T_parent_child, or None.
        moving: T_parent_child over time, by absolute stamps, or None.
    """

    parent: str
    child: str
    fixed: Transform | None
    moving: RecordedTrack | None

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[Transform, NDArray[np.bool_]]:
        """Return T_parent_child at stamps (m,), and whether it is known at each."""
        if self.moving is None:
            assert self.fixed is not None
            shape = len(stamps_ns), 1
            tiled = Transform(*(np.tile(part, shape) for part in self.fixed))
            return tiled, np.ones(len(stamps_ns), bool)
        return Transform(*self.moving.at(stamps_ns)), self.moving.covers(stamps_ns)


class FrameTree:
    """The tree of frames: each has at most one parent."""

    def __init__(
        self,
        fixed: dict[tuple[str, str], Samples],
        moving: dict[tuple[str, str], Samples],
        faults: Faults,
        preferred: str | None = None,
    ) -> None:
        """Build the tree of transforms by (parent, child).

        A transform that never changes is fixed, as ROS 1 publishes those, unless none would move
        then. Of several parents of a frame the preferred one is kept, or one that is below it;
        without such a parent the one with most samples, and `rivals` names all of them.
        """
        self.rivals: dict[str, list[str]] = {}
        links = {*fixed, *moving}
        above = {name: _ancestors(name, links) for name, _ in links}
        self._edges: dict[str, Edge] = {}
        held: dict[str, int] = {}
        still = []
        for samples, is_fixed in ((fixed, True), (moving, False)):
            for (parent, child), one in samples.items():
                poses = sound(one.poses(), faults, "transform")
                if len(poses.stamps_ns) == 0 or parent == child:
                    continue
                if child in self._edges and self._edges[child].parent != parent:
                    faults["transform: frame of several parents"] += 1
                    other = self._edges[child].parent
                    wanted = [name for name in (other, parent) if preferred in above[name]]
                    if wanted == [other]:
                        continue
                    if wanted == [parent]:
                        self.rivals.pop(child, None)
                    else:
                        names = {*self.rivals.get(child, [other]), parent}
                        self.rivals[child] = sorted(names)
                        if held[child] >= len(poses.stamps_ns):
                            continue
                held[child] = len(poses.stamps_ns)
                edge = _edge(parent, child, poses, is_fixed, faults)
                if edge.moving is not None and _never_changes(edge.moving):
                    still.append(child)
                self._edges[child] = edge
        changing = any(edge.moving and not _never_changes(edge.moving) for edge in self)
        for child in still if changing else ():
            self._edges[child] = _made_fixed(self._edges[child])

    def __iter__(self) -> Iterator[Edge]:
        return iter(self._edges.values())

    @property
    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({name for edge in self._edges.values() for name in (edge.parent, edge.child)})

    def chain(self, frame: str) -> list[Edge]:
        """Return the transforms from the root of the tree down to a frame; cycles are cut."""
        edges: list[Edge] = []
        seen = {frame}
        while frame in self._edges:
            edge = self._edges[frame]
            edges.append(edge)
            frame = edge.parent
            if frame in seen:
                break
            seen.add(frame)
        return edges[::-1]

    def between(self, body: str, frame: str) -> FramePath | None:
        """Return how a frame is mounted on a body, or None if no transforms connect them."""
        if body == frame:
            return FramePath((), ())
        up, down = self.chain(body), self.chain(frame)
        while up and down and up[0] is down[0]:
            up, down = up[1:], down[1:]
        top_of_body = up[0].parent if up else body
        top_of_frame = down[0].parent if down else frame
        return FramePath(tuple(up), tuple(down)) if top_of_body == top_of_frame else None


class FramePath(NamedTuple):
    """The transforms from a body up to a common ancestor, and from there down to a frame.

    Attributes:
        up: Transforms from the ancestor to the body, to be inverted.
        down: Transforms from the ancestor to the frame.
    """

    up: tuple[Edge, ...]
    down: tuple[Edge, ...]

    @property
    def is_fixed(self) -> bool:
        """Whether nothing between them moves."""
        return all(edge.moving is None for edge in (*self.up, *self.down))

    @property
    def mount(self) -> Transform | Callable[[int], Transform | None]:
        """T_body_frame, or, where something moves, its value at a stamp, None if not known."""

        def at(stamp_ns: int) -> Transform | None:
            transform, known = self.at(np.array([stamp_ns]))
            return transform.row(0) if known[0] else None

        return self.at(np.zeros(1, np.int64))[0].row(0) if self.is_fixed else at

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[Transform, NDArray[np.bool_]]:
        """Return T_body_frame at stamps (m,), and whether it is known at each."""
        known = np.ones(len(stamps_ns), bool)
        parts = []
        for edges, is_up in ((self.up, True), (self.down, False)):
            if not edges:
                continue
            placed = [edge.at(stamps_ns) for edge in edges]
            for _, covered in placed:
                known &= covered
            whole = reduce(compose, (transform for transform, _ in placed))
            parts.append(inverse(whole) if is_up else whole)
        if not parts:
            shape = len(stamps_ns), 1
            return Transform(np.zeros((len(stamps_ns), 3)), np.tile([1.0, 0, 0, 0], shape)), known
        return reduce(compose, parts), known


def _ancestors(name: str, links: Collection[tuple[str, str]]) -> set[str]:
    """Return a frame and all frames above it."""
    found: set[str] = set()
    queue = [name]
    while queue:
        one = queue.pop()
        if one not in found:
            found.add(one)
            queue += [parent for parent, child in links if child == one]
    return found


def _edge(parent: str, child: str, poses: StampedPoses, is_fixed: bool, faults: Faults) -> Edge:
    if is_fixed:
        last = Transform(poses.positions[-1], poses.quaternions[-1])  # as tf2 does
        same = (poses.positions == last.position).all()
        if not (same and (poses.quaternions == last.quaternion).all()):
            faults["transform: static one that changes, the last counts"] += 1
        return Edge(parent, child, last, None)
    track = RecordedTrack(
        poses.stamps_ns,
        poses.positions,
        poses.quaternions,
        source=f"{parent} -> {child}",
        max_gap_ns=ANY_GAP,
    )
    return Edge(parent, child, None, track)


def _never_changes(track: RecordedTrack) -> bool:
    same = (track.positions == track.positions[0]).all()
    return bool(same and (track.quaternions == track.quaternions[0]).all())


def _made_fixed(edge: Edge) -> Edge:
    assert edge.moving is not None
    pose = Transform(edge.moving.positions[0], edge.moving.quaternions[0])
    return edge._replace(fixed=pose, moving=None)
