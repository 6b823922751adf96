"""Perturbation of the pose's stream: the last estimate comes again and again, stamped as new."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.pose_stop import PoseStop


class PoseFreeze(PoseStop, frozen=True, tag="pose_freeze"):
    """The last pose is repeated for a while under new stamps, as by a filter that hangs."""

    restamps: ClassVar[bool] = True
