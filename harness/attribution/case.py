"""Data for the attribution of one episode: inputs, decisions and ground truth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.config import Config
from wayproof.harness.decision import path_of, widening_of
from wayproof.harness.errors import InputError
from wayproof.harness.goals import leg_towards
from wayproof.harness.input_messages import inputs_from_messages
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.decision_messages import DecisionMessages
from wayproof.harness.log.paths import densely
from wayproof.harness.log.reader import Log, as_truth
from wayproof.harness.mission import Mission
from wayproof.harness.recompute.keyframes import map_before, start_at
from wayproof.harness.recompute.moments import Segment, SegmentedStack, segments_of
from wayproof.harness.result import Contact
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.columns import Window
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

Array = NDArray[np.float64]

NO_SCENE = """<mujoco><worldbody><body name="robot_base"><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
"""Scene of a recording, in MJCF: nothing is known to stand anywhere."""


@dataclass(frozen=True)
class Moment:
    """One decision with its inputs and the ground truth.

    In a recording the recorded motion stands for the truth.

    Attributes:
        answer: Answer of the stack on trial; None of the built-in one.
        goal: Goal of its own, in a recording.
        added_delay_s: Part of the delay that a perturbation added, s.
        prediction: Prediction of a predictor from outside; None without one.
    """

    pose: pb.Pose
    sweeps: tuple[pb.Sweep, ...]
    latency: pb.Latency
    decision: pb.Decision
    truth: pb.Truth
    answer: pb.StackCommand | None = None
    goal: pb.Goal | None = None
    added_delay_s: float = 0.0
    prediction: pb.Prediction | None = None

    @property
    def inputs(self) -> Inputs:
        """Inputs of the decision."""
        return inputs_from_messages(
            self.pose, list(self.sweeps), goal=self.goal, prediction=self.prediction
        )

    @property
    def time_ns(self) -> int:
        """Simulated time, ns."""
        return self.pose.timestamp.ToNanoseconds()

    @property
    def true_position(self) -> Array:  # (3,)
        """True position of the base, m."""
        return np.array(self.truth.position)

    @property
    def error(self) -> Array:  # (3,)
        """Estimated less true position, m."""
        return np.array(self.pose.position) - self.true_position

    @property
    def believed(self) -> Array:  # (3,)
        """Estimated position, m."""
        return self.true_position + self.error

    @property
    def turn(self) -> float:
        """Estimated less true heading, rad."""
        turned = yaw_of(self.pose.quaternion) - yaw_of(self.truth.quaternion)
        return (turned + math.pi) % (2.0 * math.pi) - math.pi

    @property
    def effect_ns(self) -> int:
        """Time from which the robot follows the trajectory, unless it is discarded, ns."""
        start = self.decision.trajectory.start.ToNanoseconds()
        return max(start, self.time_ns + round(self.latency.delay_s * 1e9))


@dataclass(frozen=True)
class Case:
    """One episode.

    Attributes:
        config: Settings.
        mission: Mission of the stack.
        segments: Segments, in order; one if the log was never forked.
        outcome: Outcome.
        reason: Reason of the outcome, in words.
        end_s: Simulated time of the end, s.
        contact: Contact that ended it, if any.
        moments: All decisions.
        space: True geometry.
        keyframes: States of the stack in the log, which are claims of it.
    """

    config: Config
    mission: Mission
    segments: tuple[Segment, ...]
    outcome: str
    reason: str
    end_s: float
    contact: Contact | None
    moments: tuple[Moment, ...]
    space: TrueSpace
    keyframes: tuple[pb.Keyframe, ...] = ()

    @property
    def axes(self) -> int:
        """Number of axes of motion: 2 on the ground, 3 in the air."""
        return self.mission.axes

    def followed(self, time_ns: int) -> pb.Trajectory | None:
        """Return the trajectory that the robot followed at a time; None before the first."""
        begun = [
            one.decision.trajectory
            for one in self.moments
            if one.effect_ns <= time_ns and not one.decision.deadline_missed
        ]
        return begun[-1] if begun else None

    def as_of(self, number: int) -> Case:
        """Return the case with the settings and the mission of a decision."""
        segments = tuple(one for one in self.segments if one.begin <= number)
        last = segments[-1]
        goal = self.moments[number].goal if self.moments else None
        mission = leg_towards(last.mission, goal)
        return replace(self, config=last.config, mission=mission, segments=segments)

    def beams_at(self, number: int) -> Mapping[str, Beams]:
        """Return the beam geometry of a decision, by sensor name."""
        return [one.beams for one in self.segments if one.begin <= number][-1]

    def keyframe_at(self, number: int) -> pb.Keyframe | None:
        """Return the last keyframe with a map up to a decision, with the same settings."""
        begin = self.as_of(number).segments[-1].begin
        keyframe = map_before(self.keyframes, number)
        return None if keyframe is None or keyframe.sequence < begin else keyframe

    def navigator_at(self, number: int, keyframe: pb.Keyframe | None = None) -> Navigator:
        """Return a stack with the map and costmap of one decision.

        Args:
            number: Number of the decision.
            keyframe: State to start from, in place of the start of the log: from `keyframe_at`.

        Raises:
            InputError: The keyframe holds no map of this stack.
        """
        stack = SegmentedStack(self.as_of(number).segments)
        begin = 0
        if keyframe is not None:
            begin = keyframe.sequence + 1
            start_at(stack, keyframe)
        for moment in self.moments[begin : number + 1]:
            stack.watch(moment.inputs)
        navigator = stack.go_to(number)
        update_as_decided(navigator, self.moments[number].decision)
        return navigator

    def empty_navigator_at(self, number: int) -> Navigator:
        """Return a stack with the grid and the margin of one decision, and nothing in its map."""
        navigator = SegmentedStack(self.as_of(number).segments).go_to(number)
        update_as_decided(navigator, self.moments[number].decision)
        return navigator


def update_as_decided(navigator: Navigator, decision: pb.Decision) -> None:
    """Update a costmap with the place and the margin that a decision had."""
    navigator.mapper.stand_at(np.array(decision.position))
    margin, widening = decision.localization_margin_m, widening_of(decision)
    navigator.costmap.update(margin, widening=widening)


MOST_SEARCHED = 15_000_000
"""Largest grid of the plane or the space of motion that is searched for ways, cells: that takes up
to 160 bytes for each."""


def with_whole_area(case: Case) -> Case | None:
    """Return the case with costmaps of the whole operating area, where ways are searched for.

    None if that takes too much memory.
    """
    for one in case.segments:
        try:
            area = Window.covering(one.mission.low, one.mission.high, one.config.map.resolution)
        except ValueError:
            return None
        if math.prod(area.shape[: one.mission.axes]) > MOST_SEARCHED:
            return None

    def whole(config: Config) -> Config:
        return replace(config, costmap=replace(config.costmap, window=0.0))

    segments = tuple(replace(one, config=whole(one.config)) for one in case.segments)
    return replace(case, config=whole(case.config), segments=segments)


def read_case(log: Log) -> Case:
    """Read a log as a case.

    Raises:
        InputError: It has no sweeps or no truth, or its scene cannot be compiled.
    """
    log.check_sweeps()
    keyframes: list[pb.Keyframe] = []
    moments = tuple(moments_of(_without_keyframes(keyframes, read_messages(log.path))))
    if not moments:
        raise InputError(f"log '{log.path}': no decisions in it")
    return Case(
        config=log.config,
        mission=leg_towards(log.mission, moments[-1].goal),
        segments=tuple(segments_of(log)),
        outcome=log.result["outcome"],
        reason=log.result.get("reason", ""),
        end_s=float(log.result.get("sim_time_s", moments[-1].time_ns * 1e-9)),
        contact=Contact.from_text(log.result.get("contact", "")),
        moments=moments,
        space=true_space(log),
        keyframes=tuple(keyframes) if log.config.keyframe_period else (),
    )


def true_space(log: Log) -> TrueSpace:
    """Return the true geometry of a log's scene; an empty one of a recording.

    Raises:
        InputError: The scene in the log cannot be compiled.
    """
    try:
        recorded = log.config.recording is not None
        return TrueSpace(NO_SCENE if recorded else safe_scene(log.scene))
    except (KeyError, *NOT_COMPILED) as error:
        text = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene: {text}") from None


def _without_keyframes(
    keyframes: list[pb.Keyframe], messages: Iterable[Message]
) -> Iterator[Message]:
    """Yield the other messages, and collect the keyframes."""
    for message in messages:
        if isinstance(message, pb.Keyframe):
            keyframes.append(message)
        else:
            yield message


def moments_of(messages: Iterable[Message]) -> Iterator[Moment]:
    """Group the messages of a log by decision."""
    given, decision, added_s = DecisionMessages(), pb.Decision(), 0.0
    for message in messages:
        if given.take(message):
            continue
        if isinstance(message, pb.Decision):
            decision = message
        elif isinstance(message, pb.Perturbation):
            added_s = message.added_delay_s
        truth = _truth_of(message, given)
        if truth is not None:
            yield Moment(
                pose=given.pose,
                sweeps=tuple(given.sweeps),
                latency=given.latency,
                decision=decision,
                truth=truth,
                answer=given.answer,
                goal=given.goal,
                added_delay_s=added_s,
                prediction=given.prediction,
            )
            given, added_s = given.next(), 0.0


def _truth_of(message: Message, given: DecisionMessages) -> pb.Truth | None:
    """Return the truth of a decision if a message completes it; a recording's decision itself does.

    Args:
        message: Message that follows what precedes a decision.
        given: Messages that preceded the decision.
    """
    if isinstance(message, pb.Truth):
        return message
    if isinstance(message, pb.Decision) and given.motion is not None:
        return as_truth(given.motion)
    return None


def yaw_of(quaternion: Sequence[float]) -> float:
    """Return the heading of an orientation w x y z, rad."""
    w, x, y, z = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


LAG = 0.5
"""Distance that a body may lag behind the start of a trajectory, m."""


def off_path(trajectory: pb.Trajectory, believed: Array, axes: int) -> tuple[float, Array]:
    """Return the distance of an estimated position (3,) from a path, m, and the nearest point.

    A lag behind the start of the path, in its direction, does not count.
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
