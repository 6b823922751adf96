"""A DDS participant that ROS 2 nodes take for one of theirs."""

from __future__ import annotations

import contextlib
import os
from typing import Any, Generic, NamedTuple

from wayproof.harness.errors import InputError
from wayproof.harness.interface.ros2.messages import M, Message, decode, encode

try:
    from cyclonedds.builtin import (
        BuiltinDataReader,
        BuiltinTopicDcpsPublication,
        BuiltinTopicDcpsSubscription,
    )
    from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState
    from cyclonedds.core import WaitSet as DdsWaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    from wayproof.harness.interface.ros2.wire import wire_type
except ImportError:
    raise InputError(
        "--stack ros2 needs Cyclone DDS: pip install cyclonedds (the extra 'ros2'), with Python "
        "3.11 to 3.13"
    ) from None

CONFIG = (
    "<General><MaxMessageSize>65000B</MaxMessageSize><FragmentSize>63000B</FragmentSize></General>"
    '<Internal><HeartbeatInterval min="1ms" max="100ms">1ms</HeartbeatInterval>'
    '<SocketReceiveBufferSize min="default" max="4194304B"/>'
    '<SocketSendBufferSize min="65536B" max="4194304B"/></Internal>'
)
"""Cyclone DDS's settings where `CYCLONEDDS_URI` gives none. Fragments are as large as UDP takes, as
a cloud of many small ones overruns the receiver's buffer; readers have to state at once what
they have received."""

BLOCKING_NS = 5_000_000_000
"""Longest that a write waits for a slow reader, ns."""

UNSIGNED = 2**64 - 1
"""Mask of a handle, which Cyclone DDS gives with a sign here and without one there."""

DEPTH = 10
"""Messages that a publisher keeps for each reader, as in ROS 2's default profile."""


class Sample(NamedTuple, Generic[M]):
    """A message received.

    Attributes:
        message: The message.
        sent_ns: Wall time of its writing, by its sender's clock, ns.
        publisher: Handle of its publisher.
    """

    message: M
    sent_ns: int
    publisher: int


class Endpoint(NamedTuple):
    """A publisher or subscription of another participant.

    Attributes:
        topic: ROS name.
        type: As ROS prints it, such as `geometry_msgs/msg/Twist`.
        reliable: Whether it offers, or requests, reliability.
        latched: Whether it offers, or requests, what was sent before (transient local).
    """

    topic: str
    type: str
    reliable: bool
    latched: bool


class Node:
    """One participant in one domain."""

    def __init__(self, domain: int) -> None:
        """Join the domain.

        Raises:
            InputError: No network interface can be used.
        """
        try:
            configured = bool(os.environ.get("CYCLONEDDS_URI"))
            self._domain = None if configured else Domain(domain, CONFIG)
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise InputError(f"--stack ros2: domain {domain}: {error.msg}") from None
        self._own = self._participant.guid
        self._waitset = DdsWaitSet(self._participant)
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._subscriptions = BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription)

    def publisher(self, topic: str, kind: type[Message], latched: bool = False) -> Publisher:
        """Make a reliable publisher; a latched one keeps its last message for who joins later."""
        return Publisher(self._participant, topic, kind, latched)

    def subscription(self, topic: str, kind: type[M], latched: bool = False) -> Subscription[M]:
        """Make a reliable subscription; a latched one gets messages sent before it joined."""
        made = Subscription(self._participant, topic, kind, latched)
        self._waitset.attach(made.condition)
        return made

    def wait(self, wall_s: float) -> None:
        """Wait for a message, at most a wall time."""
        self._waitset.wait(max(round(wall_s * 1e9), 1))

    def publications(self) -> list[Endpoint]:
        """Return the publishers of other participants."""
        return self._endpoints(self._publications)

    def subscriptions(self) -> list[Endpoint]:
        """Return subscriptions of other participants."""
        return self._endpoints(self._subscriptions)

    def _endpoints(self, reader: BuiltinDataReader) -> list[Endpoint]:
        return [
            _endpoint(one)
            for one in reader.read(1000)
            if one.sample_info.instance_state == InstanceState.Alive
            and one.participant_key != self._own
            and one.topic_name.startswith("rt/")
        ]


class Publisher:
    """Writes messages of one topic."""

    def __init__(
        self, participant: DomainParticipant, topic: str, kind: type[Message], latched: bool
    ) -> None:
        """Announce it."""
        self.topic, self.kind, self.latched = topic, kind, latched
        self._type = wire_type(kind)
        qos = _qos(latched)
        announced = Topic(participant, f"rt{topic}", self._type, qos)
        self._writer = DataWriter(participant, announced, qos)

    def publish(self, message: Message) -> None:
        """Write a message."""
        with contextlib.suppress(_WriteTimeout):
            self.write(encode(message))

    def write(self, data: bytes) -> None:
        """Write a message that is encoded already.

        Raises:
            _WriteTimeout: A reader has taken nothing for long.
        """
        sample = self._type()
        sample.data = data
        try:
            self._writer.write(sample)
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_TIMEOUT:
                raise _WriteTimeout from None
            raise

    @property
    def readers(self) -> int:
        """Number of subscriptions that it has been matched with."""
        return len(self._writer.get_matched_subscriptions())

    def wait_for_readers(self, wall_s: float) -> bool:
        """Wait until every reliable reader has received all; false if they have not in time."""
        code: int = self._writer._wait_for_acks(self._writer._ref, round(wall_s * 1e9))
        return code == 0


class Subscription(Generic[M]):
    """Takes messages of one topic."""

    def __init__(
        self, participant: DomainParticipant, topic: str, kind: type[M], latched: bool
    ) -> None:
        """Announce it."""
        self.topic, self.kind, self.latched = topic, kind, latched
        qos = _qos(latched)
        announced = Topic(participant, f"rt{topic}", wire_type(kind), qos)
        self._reader = DataReader(participant, announced, qos)
        mask = SampleState.NotRead | ViewState.Any | InstanceState.Any
        self.condition = ReadCondition(self._reader, mask)

    def take(self) -> list[Sample[M]]:
        """Return all that has been received since, oldest first.

        Raises:
            CdrError: Bytes that are no such message.
        """
        return [
            Sample(
                decode(self.kind, one.data),
                one.sample_info.source_timestamp,
                one.sample_info.publication_handle & UNSIGNED,
            )
            for one in self._reader.take(100)
            if one.sample_info.valid_data
        ]

    @property
    def publishers(self) -> set[int]:
        """Handles of the publishers that it is matched with."""
        return {one & UNSIGNED for one in self._reader.get_matched_publications()}


class _WriteTimeout(Exception):
    """A reader has not acknowledged for long; the message is lost to it."""


def _qos(latched: bool) -> Qos:
    return Qos(
        Policy.Reliability.Reliable(BLOCKING_NS),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(1 if latched else DEPTH),
        # Jazzy's middleware reads version 1 alone.
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )


def _endpoint(one: Any) -> Endpoint:
    reliability, durability = one.qos[Policy.Reliability], one.qos[Policy.Durability]
    return Endpoint(
        one.topic_name.removeprefix("rt"),
        one.type_name.replace("::dds_::", "::").replace("::", "/").removesuffix("_"),
        isinstance(reliability, Policy.Reliability.Reliable),
        durability not in (None, Policy.Durability.Volatile),
    )
