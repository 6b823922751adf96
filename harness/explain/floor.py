"""The floor that the sweeps of a decision were levelled by, in words."""

from __future__ import annotations

import math

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.filters.ground_fit import fitted_ground
from wayproof.maps.ground_fit import GroundPlane


def floor_in_words(case: Case, moment: Moment) -> str:
    """Name each sensor whose sweep was levelled, with the plane of its floor; empty without one.

    Args:
        case: The episode.
        moment: The decision.
    """
    inputs, beams = moment.inputs, case.beams_at(moment.decision.sequence)
    planes = {
        sweep.sensor: fitted_ground(
            beams[sweep.sensor].place(sweep, inputs.pose, inputs.sequence),
            case.config,
            case.mission,
        )
        for sweep in inputs.sweeps
    }
    return "; ".join(f"{name} {_plane(one)}" for name, one in planes.items() if one is not None)


def _plane(plane: GroundPlane) -> str:
    height, along_x, along_y = plane.numbers[:3].tolist()
    tilt = math.degrees(math.atan(math.sqrt(along_x * along_x + along_y * along_y)))
    return (
        f"saw it {100.0 * height:.1f} cm high below the sensor, tilted by {tilt:.1f} degrees, with "
        f"{100.0 * plane.range_deviation:.1f} cm of noise: levelled"
    )
