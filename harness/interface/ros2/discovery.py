"""Mismatches of ROS 2 nodes with an episode: another type or quality of service, a second clock."""

from __future__ import annotations

from collections.abc import Iterable

from wayproof.harness.interface.ros2.messages import Clock, Message
from wayproof.harness.interface.ros2.node import Endpoint, Publisher, Subscription


def mismatch(
    publications: Iterable[Endpoint],
    subscriptions: Iterable[Endpoint],
    publishers: Iterable[Publisher],
    ours: Iterable[Subscription[Message]],
) -> str:
    """Return the first pair that cannot match, or a second clock, in words; empty if all is well.

    Args:
        publications: Publications of the others.
        subscriptions: Subscriptions of the others.
        publishers: Ours.
        ours: Our subscriptions.
    """
    listening, types = list(ours), {one.topic: one for one in publishers}
    for one in publications:
        if one.type == Clock.__msgtype__ and one.topic in types:
            return f"{one.topic} is published by another simulator or episode in this domain, too"
        expected = [sub.kind.__msgtype__ for sub in listening if sub.topic == one.topic]
        latched = any(sub.latched for sub in listening if sub.topic == one.topic)
        if expected and one.type not in expected:
            return f"{one.topic} is published as {one.type}, expected {' or '.join(expected)}"
        if expected and not one.reliable:
            return f"{one.topic} is published with best effort reliability, expected reliable"
        if expected and latched and not one.latched:
            return f"{one.topic} is published with volatile durability, expected transient local"
    for one in subscriptions:
        ours_here = types.get(one.topic)
        if ours_here is not None and one.type != ours_here.kind.__msgtype__:
            return f"{one.topic} is subscribed as {one.type}, expected {ours_here.kind.__msgtype__}"
        if ours_here is not None and one.latched and not ours_here.latched:
            return f"{one.topic} is subscribed with transient local durability, expected volatile"
    return ""
