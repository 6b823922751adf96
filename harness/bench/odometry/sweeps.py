"""Sweeps of a log for odometries: points in the body's frame with times, and true poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import Trail, rotation_matrices

Array = NDArray[np.float64]

LEAST_BEAMS = 1000
"""Number of beams of a sensor that odometries get; altimeters and the like are left out."""


@dataclass(frozen=True)
class Sweeps:
    """All sweeps of an episode.

    Attributes:
        points: (k, 3) of each sweep, in the frame of the base at the instant of each point, m.
        ages: (k,) of each point before the end of its sweep, s; 0 without a rolling shutter.
        inputs: Inputs of the decisions, with the estimated poses.
        truths: (n, 4, 4) true poses T_world_base.
        estimates: (n, 3) positions of the episode's own estimator, m.
    """

    points: list[Array]
    ages: list[Array]
    inputs: list[Inputs]
    truths: Array
    estimates: Array

    @property
    def way(self) -> float:
        """Length of the true way, m."""
        return float(np.linalg.norm(np.diff(self.truths[:, :3, 3], axis=0), axis=1).sum())


def read_sweeps(path: Path) -> Sweeps:
    """Read the sweeps of a full log whose decisions all have a truth."""
    log = open_log(path)
    messages = read_messages(path)
    truths = {one.sequence: one for one in messages if isinstance(one, pb.Truth)}
    points, ages, inputs, poses = [], [], [], []
    for record in log.records():
        given = record.inputs
        if given.sequence not in truths:
            continue
        placed = [
            (beams.place(sweep, _at_rest(given.pose), given.sequence), beams)
            for sweep in given.sweeps
            if (beams := log.beams[sweep.sensor]).table.beams >= LEAST_BEAMS
        ]
        if not placed:
            continue
        points.append(np.concatenate([one.points for one, _ in placed]))
        ages.append(np.concatenate([beams.ages_of(one) for one, beams in placed]))
        inputs.append(given)
        poses.append(_matrix(truths[given.sequence]))
    estimates = np.array([one.pose.position for one in inputs])
    return Sweeps(points, ages, inputs, truths=np.array(poses), estimates=estimates)


def _at_rest(pose: Pose) -> Pose:
    """Return the pose of the base in its own frame, at all instants of a sweep."""
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    trail = pose.trail
    if trail is not None:
        count = len(trail.positions)
        trail = Trail(np.zeros((count, 3)), np.tile(upright, (count, 1)), trail.period)
    return Pose(np.zeros(3), upright, 0.0, trail)


def _matrix(truth: pb.Truth) -> Array:
    T_world_base = np.eye(4)
    T_world_base[:3, :3] = rotation_matrices(np.array(truth.quaternion)[None])[0]
    T_world_base[:3, 3] = truth.position
    return T_world_base
