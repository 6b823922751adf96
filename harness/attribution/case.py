"""An episode as its causes are worked out from: what was sensed and decided, and what was true."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams, Inputs, inputs_from_messages
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.paths import densely
from wayproof.harness.log.reader import Log
from wayproof.harness.mission import Mission
from wayproof.harness.recompute.segments import Segment, SegmentedStack, segments_of
from wayproof.harness.result import Contact
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import path_of
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moment:
    """One decision with its inputs, and the truth at that time."""

    pose: pb.Pose
    sweeps: tuple[pb.Sweep, ...]
    latency: pb.Latency
    decision: pb.Decision
    truth: pb.Truth

    @property
    def inputs(self) -> Inputs:
        """What the decision was made on."""
        return inputs_from_messages(self.pose, list(self.sweeps))

    @property
    def time_ns(self) -> int:
        """Simulated time, ns."""
        return self.pose.timestamp.ToNanoseconds()

    @property
    def true_position(self) -> Array:  # (3,)
        """Of the base, m."""
        return np.array(self.truth.position)

    @property
    def error(self) -> Array:  # (3,)
        """Believed less true position, m."""
        return np.array(self.pose.position) - self.true_position

    @property
    def turn(self) -> float:
        """Believed less true heading, rad."""
        turned = yaw_of(self.pose.quaternion) - yaw_of(self.truth.quaternion)
        return (turned + math.pi) % (2.0 * math.pi) - math.pi

    @property
    def effect_ns(self) -> int:
        """When the robot began to follow its trajectory, unless it was discarded."""
        start = self.decision.trajectory.start.ToNanoseconds()
        return max(start, self.time_ns + round(self.latency.delay_s * 1e9))


@dataclass(frozen=True)
class Case:
    """One episode.

    Attributes:
        config: Settings.
        mission: What the stack was told.
        runs: Its stacks, in order; one if the log was never forked.
        outcome: How it ended.
        reason: In words.
        end_s: When, in simulated time.
        contact: What ended it, if something was touched.
        moments: Every decision.
        space: The truth.
    """

    config: Config
    mission: Mission
    runs: tuple[Segment, ...]
    outcome: str
    reason: str
    end_s: float
    contact: Contact | None
    moments: tuple[Moment, ...]
    space: TrueSpace

    @property
    def axes(self) -> int:
        """In how many axes the robot moves: 2 on the ground."""
        return self.mission.axes

    def followed(self, time_ns: int) -> pb.Trajectory | None:
        """The trajectory that the robot followed at a time; none before the first took effect."""
        begun = [
            one.decision.trajectory
            for one in self.moments
            if one.effect_ns <= time_ns and not one.decision.deadline_missed
        ]
        return begun[-1] if begun else None

    def as_of(self, number: int) -> Case:
        """The case with the settings and the mission that a decision was made with."""
        runs = tuple(run for run in self.runs if run.begin <= number)
        return replace(self, config=runs[-1].config, mission=runs[-1].mission, runs=runs)

    def beams_at(self, number: int) -> Mapping[str, Beams]:
        """The sensors of a decision's sweeps, by name."""
        return [run.beams for run in self.runs if run.begin <= number][-1]

    def navigator_at(self, number: int) -> Navigator:
        """The stack's map and costmap as they were for one decision."""
        stack = SegmentedStack(self.as_of(number).runs)
        for moment in self.moments[: number + 1]:
            stack.watch(moment.inputs)
        navigator = stack.navigator
        navigator.costmap.update(self.moments[number].decision.localization_margin_m)
        return navigator


def read_case(log: Log) -> Case:
    """A log as a case.

    Raises:
        InputError: It holds no sweeps or no truth, or its scene cannot be compiled.
    """
    log.check_sweeps()
    moments = tuple(moments_of(read_messages(log.path)))
    if not moments:
        raise InputError(f"log '{log.path}': no decisions in it")
    try:
        space = TrueSpace(safe_scene(log.scene))
    except (KeyError, *NOT_COMPILED) as error:
        text = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene: {text}") from None
    return Case(
        config=log.config,
        mission=log.mission,
        runs=tuple(segments_of(log)),
        outcome=log.result["outcome"],
        reason=log.result.get("reason", ""),
        end_s=float(log.result.get("sim_time_s", moments[-1].time_ns * 1e-9)),
        contact=Contact.from_text(log.result.get("contact", "")),
        moments=moments,
        space=space,
    )


def moments_of(messages: Iterable[Message]) -> Iterator[Moment]:
    """Group a log's messages by decision."""
    sweeps: list[pb.Sweep] = []
    pose, latency, decision = pb.Pose(), pb.Latency(), pb.Decision()
    for message in messages:
        if isinstance(message, pb.Sweep):
            sweeps.append(message)
        elif isinstance(message, pb.Pose):
            pose = message
        elif isinstance(message, pb.Latency):
            latency = message
        elif isinstance(message, pb.Decision):
            decision = message
        elif isinstance(message, pb.Truth):
            yield Moment(pose, tuple(sweeps), latency, decision, message)
            sweeps = []


def yaw_of(quaternion: Sequence[float]) -> float:
    """Heading of an orientation w x y z, rad."""
    w, x, y, z = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


LAG = 0.5
"""A trajectory begins where the body should be by now: so far behind it still is on its way, m."""


def off_path(trajectory: pb.Trajectory, believed: Array, axes: int) -> tuple[float, Array]:
    """How far a believed position (3,) is from a trajectory's path, m, and its nearest point.

    What the body lags behind the path's begin, in its direction, does not count.
    """
    path = path_of(trajectory.path)
    if axes == 2:
        path[:, 2] = believed[2]
    places = densely(path, 0.02)
    ahead = places[min(5, len(places) - 1)] - places[0]
    if (length := float(np.linalg.norm(ahead))) > 0.0:
        behind = np.arange(LAG, 0.0, -0.02)[:, None] * (ahead / length)
        places = np.vstack([places[0] - behind, places])
    gaps = np.linalg.norm((places - believed)[:, :axes], axis=1)
    nearest = int(gaps.argmin())
    return float(gaps[nearest]), places[nearest]
