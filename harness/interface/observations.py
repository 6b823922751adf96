"""Observations of a stack on trial, built from the logged inputs alone."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.config_document import settings_for_stacks
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.inputs import Beams, Inputs, Pose, SweepInput
from wayproof.harness.interface.types import (
    Array,
    Fate,
    Observation,
    Reference,
    Sensor,
    Sweep,
    Task,
)
from wayproof.harness.mission import Mission
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import Trail
from wayproof.planners import Trajectory

AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


def task_of(config: Config, mission: Mission, infos: Mapping[str, pb.SensorInfo]) -> Task:
    """Return the task of one mission.

    Args:
        config: Settings of the episode.
        mission: Mission of the episode.
        infos: Sensors by name; the first one's rate is that of the observations.
    """
    return Task(
        robot=config.robot,
        seed=seed_of_stack(config.seed),
        mission=copy.deepcopy(mission),
        goal_tolerance=config.episode.goal_tolerance,
        period_s=1.0 / next(iter(infos.values())).rate_hz,
        delay_s=config.latency.expected,
        deadline_s=config.latency.deadline,
        sensors={name: Sensor(_copy_info(info)) for name, info in infos.items()},
        settings=settings_for_stacks(config),
        prior=logged_cells(config) if config.prior.policy != "ignore" else None,
    )


def seed_of_stack(seed: int) -> int:
    """Return the seed of a stack's own random numbers in an episode: not that of its world."""
    return int.from_bytes(hashlib.sha256(f"stack {seed}".encode()).digest()[:7], "big")


def reference_at(trajectory: Trajectory, time_ns: int, height_m: float | None) -> Reference:
    """Return the commanded state of a robot that follows a trajectory.

    Args:
        trajectory: Trajectory that it follows.
        time_ns: Time of the state.
        height_m: Height of the base above the plane that a ground robot is planned in; else none.
    """
    sample = trajectory.at(time_ns)
    position, velocity = sample.position.copy(), sample.velocity.copy()
    if height_m is not None:
        position[2] = height_m
    return Reference(position, velocity, sample.heading, sample.yaw_rate, sample.at_rest)


def read_only(array: AnyArray) -> AnyArray:
    """Return a read-only copy of an array: whoever writes to it all the same has memory of its own.

    The referee judges by the array itself.
    """
    own = array.copy()
    own.flags.writeable = False
    return own


class ObservationBuilder:
    """Builds the observations of one mission, one after the other."""

    def __init__(self, config: Config, mission: Mission, beams: Mapping[str, Beams]) -> None:
        """Start before the first observation."""
        self._config, self._mission, self._beams = config, mission, copy.deepcopy(beams)
        self._before: tuple[int, Array, float] | None = None  # time, position and heading

    def take_over(self, before: ObservationBuilder) -> None:
        """Go on after the observations of another builder."""
        self._before = before._before

    def build(self, inputs: Inputs, followed: Trajectory, last: Fate | None) -> Observation:
        """Return the observation of one set of inputs.

        Args:
            inputs: Sweeps and pose of one instant.
            followed: The trajectory that the robot follows.
            last: Fate of the previous command.
        """
        effect_ns = inputs.time_ns + self._config.latency.expected_ns
        velocity, yaw_rate = self._twist(inputs)
        covariance = inputs.pose.covariance
        height = float(inputs.pose.position[2]) if self._mission.motion == "ground" else None
        reference = reference_at(followed, effect_ns, height)
        reference.position.flags.writeable = reference.velocity.flags.writeable = False
        own_pose = _own(inputs.pose)
        return Observation(
            time_ns=inputs.time_ns,
            sequence=inputs.sequence,
            position=read_only(inputs.pose.position),
            quaternion=read_only(inputs.pose.quaternion),
            position_sigma=inputs.pose.position_sigma,
            heading_sigma=inputs.pose.heading_sigma,
            velocity=velocity,
            yaw_rate=yaw_rate,
            sweeps=tuple(self._sweep(sweep, own_pose, inputs.sequence) for sweep in inputs.sweeps),
            effect_ns=effect_ns,
            reference=reference,
            last=last,
            trail=_read_only_trail(inputs.pose.trail),
            covariance=None if covariance is None else read_only(covariance),
            unheld=read_only(inputs.pose.unheld),
            goal=read_only(np.array(self._mission.goal) if inputs.goal is None else inputs.goal),
            goals_reached=inputs.goals_reached,
            pose_age_ns=inputs.pose.age_ns,
        )

    def _sweep(self, sweep: SweepInput, pose: Pose, sequence: int) -> Sweep:
        beams, ranges_mm = copy.deepcopy(sweep.beams), sweep.ranges_mm.copy()
        own = replace(sweep, ranges_mm=ranges_mm, beams=beams)
        place = partial(self._beams[sweep.sensor].place, own, pose, sequence)
        classes = None if sweep.classes is None else read_only(sweep.classes)
        return Sweep(
            sweep.sensor, read_only(sweep.ranges_mm), classes, place, sweep.age_ns, sweep.lag
        )

    def _twist(self, inputs: Inputs) -> tuple[Array, float]:
        """Return the velocity (3,), m/s, and yaw rate, rad/s, from this pose and the one before."""
        position, heading = inputs.pose.position, inputs.pose.heading
        before, self._before = self._before, (inputs.time_ns, position, heading)
        if before is None:
            return np.zeros(3), 0.0
        elapsed = (inputs.time_ns - before[0]) * 1e-9
        return (position - before[1]) / elapsed, wrap_angle(heading - before[2]) / elapsed


def _own(pose: Pose) -> Pose:
    """Return what a sweep is placed by, with memory of its own."""
    trail = _read_only_trail(pose.trail)
    return Pose(pose.position.copy(), pose.quaternion.copy(), pose.position_sigma, trail)


def _read_only_trail(trail: Trail | None) -> Trail | None:
    if trail is None:
        return None
    return Trail(read_only(trail.positions), read_only(trail.quaternions), trail.period)


def _copy_info(info: pb.SensorInfo) -> pb.SensorInfo:
    copied = pb.SensorInfo()
    copied.CopyFrom(info)
    return copied
