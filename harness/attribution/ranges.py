"""Reported ranges compared with ranges cast in the true scene, and settings that hide things.

Sweeps from the whole episode and from its end are cast from the true poses. A range that differs by
more than the noise of the device is off; one that is missing is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.inputs import Beams, Pose, SweepInput
from wayproof.maps import MapConfig
from wayproof.models.poses import Trail
from wayproof.models.robots import ROBOTS
from wayproof.models.scene import device_name
from wayproof.models.sensors.beams import DROPPED, MILLIMETRES, NO_RETURN
from wayproof.models.sensors.devices import DEVICES, Device, RangeNoise

Array = NDArray[np.float64]

SWEEPS = 16
"""Number of moments sampled over the whole episode, and again over its end."""

END_S = 3.0
"""Duration of the end of an episode, s."""

BEAMS = 1500
"""Number of beams of a sweep that are cast, evenly spread."""

SIGMAS = 4.0
TOLERANCE = 0.03
"""Tolerance of a range beyond its standard deviations, m."""

DEPTH_SLANT = 2.0
"""Greatest ratio of range to depth along slanted beams of a depth camera."""

FAR = 0.95
"""Fraction of the range of a device beyond which returns may be lost."""

LOST = 0.005
OFF = 0.1
"""Fraction of lost or wrong ranges beyond which the sensor is at fault."""

EARLY = 0.002
"""Fraction of false returns beyond which the sensor is at fault; without a fault there are none."""

EARLY_M = 0.3
"""Distance before the first surface, beyond the noise, from which a return is false, m."""

ASSUMED = RangeNoise(sigma=0.03, sigma_proportional=0.01, dropout=0.05)
"""Noise of an unknown device."""


@dataclass(frozen=True)
class RangeFacts:
    """Comparison of reported ranges with true ones.

    Attributes:
        lost: Fraction of them without one, less the dropout of the device.
        off: Fraction of returns that differ by more than the noise of the device.
        early: Fraction of returns that lie far before the first surface, less those as far behind
            it, as noise makes both.
        bias: Median of reported less true range, m.
        blind: Distance below which the map drops every return, m.
    """

    lost: float = 0.0
    off: float = 0.0
    early: float = 0.0
    bias: float = 0.0
    blind: float = 0.0

    @property
    def lied(self) -> bool:
        """Whether more returns are lost or wrong than the errors of the device explain."""
        return self.lost > LOST or self.off > OFF or self.early > EARLY

    @property
    def nearly_lied(self) -> bool:
        """Whether half as many as for `lied` are."""
        return self.lost > 0.5 * LOST or self.off > 0.5 * OFF or self.early > 0.5 * EARLY

    def __str__(self) -> str:
        """Describe the errors in words."""
        parts = []
        if self.lost > LOST:
            parts.append(f"{self.lost:.1%} of the echoes were lost")
        if self.early > EARLY and self.off <= OFF:  # else they are of the noise
            parts.append(f"{self.early:.1%} of the returns were false, far before any surface")
        if self.off > OFF:
            parts.append(
                f"{self.off:.0%} of the ranges were off by more than the device's noise "
                f"(median {self.bias:+.2f} m)"
            )
        return " and ".join(parts) or "the ranges were right"


def range_facts(case: Case, until: int) -> RangeFacts:
    """Compare sweeps up to a decision."""
    numbers = _sampled_moments(case, until)
    lost = expected = 0
    dropouts: list[float] = []
    errors: list[Array] = []
    off: list[NDArray[np.bool_]] = []
    early: list[NDArray[np.bool_]] = []
    behind: list[NDArray[np.bool_]] = []
    for number in numbers:
        moment, beams = case.moments[number], case.beams_at(number)
        case.space.place_movers(moment.truth)
        for sweep in moment.inputs.sweeps:
            device = device_of(case, sweep.sensor)
            true, reported = _compare(case, moment, beams[sweep.sensor], sweep, device)
            heard = np.isfinite(reported)
            noise = ASSUMED if device is None else device.noise
            sigma = np.sqrt(
                noise.sigma**2
                + (noise.sigma_proportional * true) ** 2
                + (noise.sigma_quadratic * true**2) ** 2
            )
            expected, lost = expected + len(true), lost + int((~heard).sum())
            dropouts.append(noise.dropout)
            error = (reported - true)[heard]
            errors.append(error)
            most = SIGMAS * sigma[heard] + TOLERANCE + noise.quantum
            off.append(np.abs(error) > most)
            early.append(error < -EARLY_M - most)
            behind.append(error > EARLY_M + most)
    every = np.concatenate(errors) if errors else np.zeros(0)
    return RangeFacts(
        lost=max(lost / max(expected, 1) - max(dropouts, default=0.0), 0.0),
        off=_share(off),
        early=max(_share(early) - _share(behind), 0.0),
        bias=float(np.median(every)) if len(every) else 0.0,
        blind=case.as_of(until).config.map.minimum_range,
    )


def _share(found: list[NDArray[np.bool_]]) -> float:
    """Return the fraction of beams that are marked; 0 of none."""
    marked = np.concatenate(found) if found else np.zeros(0, np.bool_)
    return float(marked.mean()) if len(marked) else 0.0


def device_of(case: Case, sensor: str) -> Device | None:
    """Return the device of a sensor; None if it is unknown."""
    named = getattr(case.config.sensors, sensor, "")
    if named in DEVICES:
        return DEVICES[named]
    if case.config.robot in ROBOTS:
        mounts = ROBOTS[case.config.robot].spec.mounts
        return next((mount.device for mount in mounts if mount.name == sensor), None)
    return None


def _sampled_moments(case: Case, until: int) -> list[int]:
    """Return moments with sweeps, of the whole episode and of its end."""
    swept = [k for k in range(until + 1) if case.moments[k].sweeps]
    end_ns = case.moments[until].time_ns - round(END_S * 1e9)
    ending = [k for k in swept if case.moments[k].time_ns >= end_ns]
    chosen = {part[k] for part in (swept, ending) for k in _evenly(len(part), SWEEPS)}
    return sorted(chosen)


def _evenly(count: int, most: int) -> list[int]:
    return sorted({int(k) for k in np.linspace(0, count - 1, min(count, most))}) if count else []


def _compare(
    case: Case, moment: Moment, beams: Beams, sweep: SweepInput, device: Device | None
) -> tuple[Array, Array]:
    """Return true and reported ranges (n,) of beams that should have a return, nan if lost."""
    placed = beams.place(sweep, _true_pose(moment), moment.pose.sequence)
    stride = max(1, len(placed.ranges_mm) // BEAMS)
    some = slice(int(moment.pose.sequence) % stride, None, stride)
    directions = np.asarray(placed.directions)[some]
    ranges = placed.ranges_mm[some]
    moments = np.asarray(placed.moments)[some]
    origins = placed.origins[0] if len(placed.origins) == 1 else placed.origins[moments]
    true = case.space.cast(origins, directions)
    nearest = 0.0 if device is None else device.minimum_range
    nearest *= DEPTH_SLANT if beams.table.measures == "depth" else 1.0
    grazing = device is not None and device.noise.grazing > 0.0
    inside = (true > nearest + TOLERANCE) & (true < FAR * beams.range)
    silent = (ranges == DROPPED) | (ranges == NO_RETURN)
    if grazing:  # the device itself loses returns at grazing angles
        inside &= ~silent
    reported = np.where(silent, np.nan, ranges / MILLIMETRES)
    return true[inside], reported[inside]


def _true_pose(moment: Moment) -> Pose:
    """Return the true pose, with the estimated history shifted by the current error."""
    pose = moment.inputs.pose
    position, quaternion = moment.true_position, np.array(moment.truth.quaternion)
    trail = pose.trail
    if trail is not None:
        shifted = trail.positions - moment.error
        trail = Trail(shifted, trail.quaternions, trail.period)
    return replace(pose, position=position, quaternion=quaternion, trail=trail)


UNSEEN = ("kind", "resolution", "memory_mib", "dynamic", "decay_period")
"""Settings of a map that are about its cells, not about what it takes for evidence."""

STAYS_WITHIN = 0.6
"""Distance from its start within which a robot counts as never having left it, m."""


def settings_of_sight(case: Case) -> Iterator[str]:
    """Yield the settings that leave out returns, or floor, in words; none of a usual episode."""
    default = MapConfig()
    for one in fields(MapConfig):
        value = getattr(case.config.map, one.name)
        if one.name not in UNSEEN and value != getattr(default, one.name):
            yield f"map.{one.name} = {value}"
    mounts = ROBOTS[case.config.robot].spec.mounts if case.config.robot in ROBOTS else ()
    for mount in mounts:
        own, used = device_name(mount.device), getattr(case.config.sensors, mount.name, "")
        if used not in ("", "own", own):
            yield f"sensors.{mount.name} = {used}"
    yield from _blind_start(case)


def _blind_start(case: Case) -> Iterator[str]:
    """Yield the floor about the start that no sensor sees, if the robot never left it."""
    declared, mission = case.config.episode.start_clear_radius, case.mission
    if not mission.planar or case.config.costmap.unknown_policy != "forbid":
        return
    nearest = min(
        (_nearest_floor(beams, mission.start[2]) for beams in case.beams_at(0).values()),
        default=np.inf,
    )
    away = [np.linalg.norm(one.true_position[:2] - mission.start[:2]) for one in case.moments]
    if nearest > mission.radius + declared and max(away) <= STAYS_WITHIN:
        yield (
            f"episode.start_clear_radius = {declared:g} m, which declares the floor free to "
            f"{mission.radius + declared:.2f} m, where the sensors see none nearer than "
            f"{nearest:.2f} m"
        )


def _nearest_floor(beams: Beams, height: float) -> float:
    """Return the least distance at which a beam of a level robot meets a level floor, m."""
    position, _ = beams.mounting
    directions = beams.directions_in_base()
    down = directions[directions[:, 2] < 0.0]
    reach = (height + position[2]) / -down[:, 2]
    spots = position[:2] + (reach[:, None] * down[:, :2])[reach <= beams.range]
    return float(np.hypot(spots[:, 0], spots[:, 1]).min(initial=np.inf))
