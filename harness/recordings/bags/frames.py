"""Frames of a bag and the transforms between them, interpolated in time as tf2 does.

Where the transforms of several robots mix, those of the sensors' own robot are chosen, by the
namespaces of their topics.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from itertools import takewhile
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.series import Series
from wayproof.harness.recordings.options import Faults
from wayproof.harness.recordings.poses import StampedPoses, sound
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.transform import IDENTITY, Transform, compose, inverse

ANY_GAP = 2**62


class Link(NamedTuple):
    """The transforms of one topic from a parent to a child."""

    topic: str
    parent: str
    child: str

    @property
    def is_fixed(self) -> bool:
        """Whether they are static."""
        return self.topic.rsplit("/", 1)[-1] == "tf_static"


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
            return _repeated(self.fixed, len(stamps_ns)), np.ones(len(stamps_ns), bool)
        return Transform(*self.moving.at(stamps_ns)), self.moving.covers(stamps_ns)


class FrameTree:
    """The tree of frames: each has at most one parent.

    Attributes:
        rivals: Parents of each frame that has several and none preferred.
    """

    def __init__(
        self, links: Mapping[Link, Series], faults: Faults, preferred: str | None = None
    ) -> None:
        """Build the tree.

        A transform that never changes is fixed, as ROS 1 publishes those, unless none would move
        then. Of several parents of a frame the preferred one is kept, or one that is below it;
        without such a parent the one with most samples.
        """
        self.rivals: dict[str, list[str]] = {}
        pairs = {(link.parent, link.child) for link in links}
        above = {name: _ancestors(name, pairs) for name, _ in pairs}
        self._edges: dict[str, Edge] = {}
        held: dict[str, int] = {}
        for link, one in sorted(links.items(), key=lambda item: not item[0].is_fixed):
            poses = sound(one.poses, faults, "transform")
            count, parent, child = len(poses.stamps_ns), link.parent, link.child
            if count == 0 or parent == child:
                continue
            known = self._edges.get(child)
            if known is not None and known.parent != parent:
                faults["transform: frame of several parents"] += 1
                wanted = [name for name in (known.parent, parent) if preferred in above[name]]
                if wanted == [known.parent]:
                    continue
                if wanted == [parent]:
                    self.rivals.pop(child, None)
                else:
                    names = {*self.rivals.get(child, [known.parent]), parent}
                    self.rivals[child] = sorted(names)
                    if held[child] >= count:
                        continue
            held[child] = count
            self._edges[child] = _edge(link, poses, faults)
        still = [edge for edge in self if edge.moving is not None and _never_changes(edge.moving)]
        moving = [edge for edge in self if edge.moving is not None]
        for edge in still if len(still) < len(moving) else ():
            assert edge.moving is not None
            pose = Transform(edge.moving.positions[0], edge.moving.quaternions[0])
            self._edges[edge.child] = edge._replace(fixed=pose, moving=None)

    def __iter__(self) -> Iterator[Edge]:
        return iter(self._edges.values())

    @property
    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({name for edge in self for name in (edge.parent, edge.child)})

    @property
    def listed(self) -> str:
        """Some of the frames, in words."""
        return ", ".join(self.frames[:20]) or "none"

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
        """T_body_frame, or, where something moves, its value at a stamp, ns; None if not known."""
        known = self.at_one(0)
        return known if self.is_fixed and known is not None else self.at_one

    def at_one(self, stamp_ns: int) -> Transform | None:
        """Return T_body_frame at a stamp; None where it is not known."""
        transform, known = self.at(np.array([stamp_ns]))
        return transform.row(0) if known[0] else None

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[Transform, NDArray[np.bool_]]:
        """Return T_body_frame at stamps (m,), and whether it is known at each."""
        known = np.ones(len(stamps_ns), bool)
        parts = []
        for edges in (self.up, self.down):
            if edges:
                whole, covered = along(edges, stamps_ns)
                known &= covered
                parts.append(inverse(whole) if edges is self.up else whole)
        return reduce(compose, parts) if parts else _repeated(IDENTITY, len(stamps_ns)), known


def along(
    edges: Iterable[Edge], stamps_ns: NDArray[np.int64]
) -> tuple[Transform, NDArray[np.bool_]]:
    """Return the transform along edges, one below the other, and whether it is known."""
    placed = [edge.at(stamps_ns) for edge in edges]
    known = np.logical_and.reduce([covered for _, covered in placed])
    return reduce(compose, (transform for transform, _ in placed)), known


def tree_for(
    links: Mapping[Link, Series],
    sensors: Sequence[str],
    faults: Faults,
    preferred: str | None = None,
) -> FrameTree:
    """Build the tree of the robot that bears the sensors.

    Where several namespaces have a transform of the same frames, it is that of the namespace that
    is nearest to the sensors. Of a namespace beside that one nothing is taken, as it is another
    robot's; of one around it, what it alone has.

    Args:
        links: Transforms.
        sensors: Topics of the sensors.
        faults: Counted up.
        preferred: Frame above the body that is taken where a frame has several parents.

    Raises:
        InputError: No single namespace is nearest.
    """
    topics: dict[tuple[str, str], dict[str, set[str]]] = {}  # of each pair of frames by namespace
    for topic, parent, child in links:
        named = topics.setdefault((parent, child), {})
        named.setdefault(namespace_of(topic), set()).add(topic)
    others: set[str] = set()  # of other robots
    around: set[tuple[str, str, str]] = set()
    for pair, rivals in sorted(topics.items()):
        if len(rivals) < 2:
            continue
        nearest = _nearest(list(rivals), sensors)
        if nearest is None:
            named_too = {one.topic for one in links if namespace_of(one.topic) in rivals}
            raise InputError(
                f"several transforms from '{pair[0]}' to '{pair[1]}', expected"
                f" one set in the namespace of {', '.join(sensors)}: {', '.join(sorted(named_too))}"
            )
        for name in rivals.keys() - {nearest}:
            if nearest.startswith(f"{name}/"):
                around.add((name, *pair))
            else:
                others.add(name)
    own = {}
    for link, one in links.items():
        name = namespace_of(link.topic)
        if name not in others and (name, link.parent, link.child) not in around:
            own[link] = one
    return FrameTree(own, faults, preferred)


def namespace_of(topic: str) -> str:
    """Return a topic without its last name."""
    return topic.rpartition("/")[0]


def _nearest(namespaces: Sequence[str], sensors: Iterable[str]) -> str | None:
    """Return the namespace nearest to all sensors, None if there is no single one.

    It shares most names with a sensor's, and has fewest others.
    """
    chosen = set()
    for sensor in sensors:
        ranks = []
        for name in namespaces:
            names, own = _names(name), _names(namespace_of(sensor))
            pairs = zip(names, own, strict=False)
            shared = len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))
            ranks.append((shared, shared - len(names)))
        if ranks.count(max(ranks)) > 1:
            return None
        chosen.add(namespaces[ranks.index(max(ranks))])
    return chosen.pop() if len(chosen) == 1 else None


def _names(namespace: str) -> list[str]:
    return [name for name in namespace.split("/") if name]


def _ancestors(name: str, pairs: Collection[tuple[str, str]]) -> set[str]:
    """Return a frame and all frames above it."""
    found: set[str] = set()
    queue = [name]
    while queue:
        one = queue.pop()
        if one not in found:
            found.add(one)
            queue += [parent for parent, child in pairs if child == one]
    return found


def _edge(link: Link, poses: StampedPoses, faults: Faults) -> Edge:
    _, parent, child = link
    if not link.is_fixed:
        source = f"{parent} -> {child}"
        return Edge(parent, child, None, RecordedTrack(*poses, source=source, max_gap_ns=ANY_GAP))
    last = Transform(poses.positions[-1], poses.quaternions[-1])  # as tf2 does
    if (poses.positions != last.position).any() or (poses.quaternions != last.quaternion).any():
        faults["transform: static one that changes, the last counts"] += 1
    return Edge(parent, child, last, None)


def _never_changes(track: RecordedTrack) -> bool:
    same = (track.positions == track.positions[0]).all()
    return bool(same and (track.quaternions == track.quaternions[0]).all())


def _repeated(one: Transform, count: int) -> Transform:
    return Transform(*(np.tile(part, (count, 1)) for part in one))
