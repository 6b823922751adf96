"""Transforms of a bag by namespace: where those of several robots mix, the sensor's are chosen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.frames import FrameTree, Samples
from wayproof.harness.recordings.options import Faults

Link = tuple[str, str]
"""Parent and child of a transform."""


@dataclass
class Transforms:
    """Transforms of the topics of one namespace, by parent and child.

    Attributes:
        topics: Names of the topics.
        fixed: Those on `tf_static`.
        moving: All others.
    """

    topics: set[str] = field(default_factory=set)
    fixed: dict[Link, Samples] = field(default_factory=dict)
    moving: dict[Link, Samples] = field(default_factory=dict)

    @property
    def links(self) -> set[Link]:
        """Parents and children of all of them."""
        return {*self.fixed, *self.moving}


def namespace_of(topic: str) -> str:
    """Return a topic without its last name."""
    return topic.rpartition("/")[0]


def tree_for(
    path: Path,
    found: Mapping[str, Transforms],
    sensors: Sequence[str],
    faults: Faults,
    preferred: str | None = None,
) -> FrameTree:
    """Build the tree of the robot that bears the sensors.

    Where several namespaces have a transform of the same frames, it is that of the namespace that
    is nearest to the sensors. Of a namespace beside that one nothing is taken, as it is another
    robot's; of one around it, what it alone has.

    Args:
        path: Path of the bag.
        found: Transforms by namespace.
        sensors: Topics of the sensors.
        faults: Counted up.
        preferred: Frame above the body that is taken where a frame has several parents.

    Raises:
        InputError: No single namespace is nearest.
    """
    left_out: dict[str, set[Link]] = {name: set() for name in found}
    for link in sorted(set().union(*(one.links for one in found.values()))):
        rivals = [name for name, one in found.items() if link in one.links]
        if len(rivals) < 2:
            continue
        nearest = _nearest(rivals, sensors)
        if nearest is None:
            topics = ", ".join(sorted(set().union(*(found[name].topics for name in rivals))))
            raise InputError(
                f"recording '{path}': several transforms from '{link[0]}' to '{link[1]}', expected"
                f" one set in the namespace of {', '.join(sensors)}: {topics}"
            )
        for name in rivals:
            if name != nearest:
                is_around = nearest.startswith(f"{name}/")
                left_out[name] |= {link} if is_around else found[name].links
    fixed: dict[Link, Samples] = {}
    moving: dict[Link, Samples] = {}
    for name, one in found.items():
        fixed |= _without(one.fixed, left_out[name])
        moving |= _without(one.moving, left_out[name])
    return FrameTree(fixed, moving, faults, preferred)


def _nearest(namespaces: Sequence[str], sensors: Iterable[str]) -> str | None:
    """Return the namespace nearest to all sensors, None if there is no single one."""
    chosen = set()
    for sensor in sensors:
        ranks = [_nearness(name, sensor) for name in namespaces]
        if ranks.count(max(ranks)) > 1:
            return None
        chosen.add(namespaces[ranks.index(max(ranks))])
    return chosen.pop() if len(chosen) == 1 else None


def _nearness(namespace: str, sensor: str) -> tuple[int, int]:
    """Rank a namespace: by the names that it shares with a sensor's, then by those it does not."""
    names, others = _names(namespace), _names(namespace_of(sensor))
    pairs = takewhile(lambda pair: pair[0] == pair[1], zip(names, others, strict=False))
    shared = len(list(pairs))
    return shared, shared - len(names)


def _names(namespace: str) -> list[str]:
    return [name for name in namespace.split("/") if name]


def _without(samples: Mapping[Link, Samples], left_out: set[Link]) -> dict[Link, Samples]:
    return {link: one for link, one in samples.items() if link not in left_out}
