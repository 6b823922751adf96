"""Perturbations by name; an episode has one or none.

A new one is a file, whose class declares what it `changes`, and a line of `AnyPerturbation`.
"""

from __future__ import annotations

from typing import TypeAlias, get_args

import msgspec

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.perturbations.calibration import Calibration
from wayproof.harness.perturbations.clock_skew import ClockSkew
from wayproof.harness.perturbations.depth_dropout import DepthDropout
from wayproof.harness.perturbations.depth_noise import DepthNoise
from wayproof.harness.perturbations.depth_scale import DepthScale
from wayproof.harness.perturbations.displacement import Displacement
from wayproof.harness.perturbations.false_returns import FalseReturns
from wayproof.harness.perturbations.imu_bias import ImuBias
from wayproof.harness.perturbations.latency import Latency
from wayproof.harness.perturbations.motion import Motion
from wayproof.harness.perturbations.occlusion import Occlusion
from wayproof.harness.perturbations.out_of_order import OutOfOrder
from wayproof.harness.perturbations.perturbation import (
    MAX_SEVERITY,
    UNPERTURBED,
    Perturbation,
    Report,
)
from wayproof.harness.perturbations.pose_drift import PoseDrift
from wayproof.harness.perturbations.pose_freeze import PoseFreeze
from wayproof.harness.perturbations.pose_jump import PoseJump
from wayproof.harness.perturbations.pose_stop import PoseStop
from wayproof.harness.perturbations.rate import Rate
from wayproof.harness.perturbations.sensor_freeze import SensorFreeze
from wayproof.harness.perturbations.sensor_stop import SensorStop
from wayproof.harness.perturbations.slip import Slip
from wayproof.harness.perturbations.stack_stall import StackStall
from wayproof.harness.perturbations.stale_prior import StalePrior

AnyPerturbation: TypeAlias = (
    PoseDrift
    | PoseJump
    | DepthDropout
    | DepthNoise
    | DepthScale
    | FalseReturns
    | Occlusion
    | Calibration
    | Latency
    | Rate
    | Motion
    | ImuBias
    | Slip
    | StalePrior
    | SensorStop
    | SensorFreeze
    | PoseStop
    | PoseFreeze
    | ClockSkew
    | OutOfOrder
    | StackStall
)

PERTURBATIONS: dict[str, type[Perturbation]] = {
    str(one.__struct_config__.tag): one for one in get_args(AnyPerturbation)
}

NOT_MODES = ("severity", "window", "direction", "drift")
"""Fields that are no modes; all but the severity can only be set in a config."""

__all__ = [
    "NOT_MODES",
    "PERTURBATIONS",
    "UNPERTURBED",
    "AnyPerturbation",
    "Displacement",
    "Perturbation",
    "Report",
    "perturbation_from",
]


def perturbation_from(text: str) -> AnyPerturbation:
    """Read `KIND:SEVERITY`, or `KIND:SEVERITY:MODE` where a kind has modes; 2.5 is a severity too.

    Raises:
        InputError: The text is no perturbation; the message lists what is available.
    """
    kind, *rest = text.split(":")
    if kind not in PERTURBATIONS:
        raise unknown_name("perturbation", kind, PERTURBATIONS)
    own = [name for name in PERTURBATIONS[kind].__struct_fields__ if name not in NOT_MODES]
    fields = ["severity", *own]
    if not 1 <= len(rest) <= len(fields):
        form = ":".join([kind, "SEVERITY", *(f"[{name.upper()}]" for name in own)])
        raise InputError(f"--perturb {text}: expected {form}")
    _check_severity(text, rest[0])
    document = {"kind": kind, **dict(zip(fields, rest, strict=False))}
    try:
        perturbation: AnyPerturbation = msgspec.convert(document, AnyPerturbation, strict=False)
    except msgspec.ValidationError as error:
        message, _, place = str(error).partition(" - at `$.")
        raise InputError(f"--perturb {text}: {place.rstrip('`')}: {message}") from None
    return perturbation


def _check_severity(text: str, severity: str) -> None:
    try:
        good = 0.0 < float(severity) <= MAX_SEVERITY
    except ValueError:
        good = False
    if not good:
        raise InputError(
            f"--perturb {text}: severity: got {severity or 'nothing'}, expected above 0, "
            f"up to {MAX_SEVERITY:g}"
        )
