"""Floor that no sensor sees from the start, beyond the space declared free there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wayproof.harness.config import Config
from wayproof.models.robots import RobotSpec
from wayproof.models.sensors.beams import directions
from wayproof.models.sensors.caster import Caster

STEP = 0.05
"""The proposed radius is a multiple of it, m."""


def warn_of_blind_start(
    casters: Sequence[Caster], spec: RobotSpec, config: Config
) -> tuple[str, ...]:
    """Warn of a robot that may find no way out of the floor that it cannot see from its start.

    The start is declared free up to `episode.start_clear_radius` beyond the body, which it may
    leave by as much in order to see more. Under `forbid` it enters nothing else unseen.

    Args:
        casters: Sensors of the robot.
        spec: The robot; one that flies is never warned of.
        config: Config with the resolved start.

    Returns:
        A warning with the radius that declares it free, or none.
    """
    if spec.motion == "air" or config.costmap.unknown_policy != "forbid":
        return ()
    nearest = min((nearest_floor(caster, spec.rest_height) for caster in casters), default=math.inf)
    declared = config.episode.start_clear_radius
    if not math.isfinite(nearest) or nearest <= spec.radius + 2.0 * declared:
        return ()
    enough = STEP * math.ceil((nearest - spec.radius) / STEP - 1e-9)
    return (
        f"the sensors see no floor nearer than {nearest:.2f} m, and what is declared free at the "
        f"start ends at {spec.radius + declared:.2f} m: the robot may find no way out; "
        f"--set episode.start_clear_radius={enough:g} declares it free",
    )


def nearest_floor(caster: Caster, rest_height: float) -> float:
    """Return the least distance from the base at which a beam of a level robot meets its floor, m.

    Args:
        caster: A sensor.
        rest_height: Height of the base above the floor, m.

    Returns:
        Infinity if no beam meets the floor within the sensor's range.
    """
    if caster.table.listed:
        return math.inf
    position, R = caster.mounting
    beams = directions(caster.table, 0) @ R.T
    down = beams[beams[:, 2] < 0.0]
    reach = (rest_height + position[2]) / -down[:, 2]
    met = (reach > 0.0) & (reach <= caster.mount.device.range)
    spots = position[:2] + reach[met, None] * down[met, :2]
    return float(np.hypot(spots[:, 0], spots[:, 1]).min(initial=math.inf))
