"""Checks of the log of a recording, which has no simulation and no truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.decision import Difference
from wayproof.harness.replay.consistency.subject import SAME, Subject, is_number
from wayproof.harness.result import RECORDED, recorded_figures, way_of


def check_recorded_result(subject: Subject) -> Iterator[Difference]:
    """Check that the figures of a recording's result follow from decisions and motion."""
    result, content = subject.log.result, subject.content
    if result["outcome"] not in (RECORDED, "error"):
        yield Difference("result.outcome", result["outcome"], RECORDED)
    for name, value in recorded_figures(content.decisions, content.motions).items():
        same = result.get(name) == value or (
            not isinstance(value, str) and is_number(result.get(name), value)
        )
        if not same:
            yield Difference(f"result.{name}", result.get(name, "none"), f"{value}")


def check_recorded_way(subject: Subject) -> Iterator[Difference]:
    """Check that the way is unbroken and leads through the poses, but for a perturbation's error.

    A pose that a perturbation makes late is one that the way led through before.

    A way of one pose begins anew: it was not recorded how the robot got there.

    A pose that an estimator made of the sweeps is an input of its own.
    """
    before, passed = None, []
    perturbation = subject.log.config.perturbation
    late = perturbation is not None and perturbation.delays_pose
    estimated = subject.log.config.estimate.kind != "model"
    shifts = {one.sequence: list(one.pose_shift) for one in subject.content.perturbations}
    for motion, pose in zip(subject.content.motions, subject.content.poses, strict=False):
        way, place = way_of(motion), f"/recorded[{motion.sequence}]"
        ends = way[0, :3].tolist(), way[-1, :3].tolist()
        joins = before is None or len(way) == 1 or ends[0] == before
        if ends[1] != list(motion.position) or not joins:
            yield Difference(f"{place}.way", f"{ends}", f"{[before, list(motion.position)]}")
            return
        before = ends[1]
        shift = shifts.get(motion.sequence, [0.0, 0.0, 0.0])
        passed.append(motion.position)
        possible = np.array(passed if late else passed[-1:]) + shift
        off = np.abs(possible - pose.position).max(axis=1).min()
        if not estimated and not off <= SAME:
            yield Difference(f"{place}.position", f"{list(motion.position)}", f"{pose.position}")
            return
