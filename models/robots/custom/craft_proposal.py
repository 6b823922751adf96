"""Spec of a craft of four rotors, proposed from its MJCF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.rotorcraft import all_rigid, rotorcraft_mjcf
from wayproof.models.robots.custom.source import Source
from wayproof.models.robots.custom.spec_file import Limits, Rotor, Sensor, SpecFile
from wayproof.models.robots.custom.stride import SPARE
from wayproof.models.robots.custom.walker_proposal import up
from wayproof.models.robots.custom.writing import rigid_body, surface

AIR_LIMITS = Limits(speed=1.5, acceleration=2.0, jerk=10.0, yaw_rate=1.5, tilt=1.2)
"""Limits proposed for a craft of four rotors."""

THRUST_TO_WEIGHT = 2.5
"""Ratio of largest thrust to weight assumed where an MJCF has no limit."""

YAW_RATIO = 0.015
"""Reaction torque by thrust assumed where an MJCF has none, m."""

ROTOR_WORDS = ("rotor", "motor", "prop", "thrust")
"""Words in the names of sites, bodies and geoms that stand where a rotor is."""

ROTOR_SHARE = 0.3
"""Radius of a rotor assumed, as a share of the shorter distance between two."""


class RotorPlace(NamedTuple):
    """Rotor: its name, place (3,) in the base's frame, m, and actuator, -1 for none."""

    name: str
    place: Array
    actuator: int


def find_rotors(source: Source) -> list[RotorPlace]:
    """Return four rotors in an X, rear right first; else none.

    They are the sites that thrusters push at; else four sites, bodies or geoms of such names.
    """
    model, data = source.model, source.data
    thrusters = [
        n for n in range(model.nu)
        if model.actuator_trntype[n] == mujoco.mjtTrn.mjTRN_SITE and model.actuator_gear[n, 2]
    ]  # fmt: skip
    sites = [int(model.actuator_trnid[n, 0]) for n in thrusters]
    pushed = [
        RotorPlace(model.site(site).name, source.place(data.site_xpos[site]), n)
        for n, site in zip(thrusters, sites, strict=True)
    ]
    for group in (pushed, *_named_rotors(source)):
        if ordered := _in_x(group):
            return ordered
    return []


def _named_rotors(source: Source) -> Iterator[list[RotorPlace]]:
    """Yield groups of sites, bodies or geoms that may be rotors: alike but for digits in names."""
    model, data = source.model, source.data
    robot = model.body_rootid == model.body_rootid[source.base]
    for names, bodies, places in (
        ([model.site(n).name for n in range(model.nsite)], model.site_bodyid, data.site_xpos),
        ([model.body(n).name for n in range(model.nbody)], np.arange(model.nbody), data.xpos),
        ([model.geom(n).name for n in range(model.ngeom)], model.geom_bodyid, data.geom_xpos),
    ):
        groups: dict[str, list[RotorPlace]] = {}
        for name, body, place in zip(names, bodies, places, strict=True):
            if robot[body] and any(word in name.lower() for word in ROTOR_WORDS):
                stem = "".join(letter for letter in name if not letter.isdigit())
                groups.setdefault(stem, []).append(RotorPlace(name, source.place(place), -1))
        yield from groups.values()


def _in_x(places: list[RotorPlace]) -> list[RotorPlace]:
    """Return four places in the order rear right, rear left, front left, front right; else none."""
    if len(places) != 4:
        return []
    middle = np.mean([one.place for one in places], axis=0)
    ordered = []
    for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        fits = [
            one for one in places
            if (one.place - middle)[0] * x > 0.0 and (one.place - middle)[1] * y > 0.0
        ]  # fmt: skip
        if len(fits) != 1:
            return []
        ordered += fits
    return ordered


def propose_craft(
    source: Source, spec: SpecFile, rotors: list[RotorPlace]
) -> tuple[SpecFile, list[str]]:
    """Return a spec with rotors, space, limits and sensors, and the assumptions made.

    Args:
        source: The MJCF.
        spec: Spec with the names of the robot, the MJCF and the base.
        rotors: Rear right, rear left, front left, front right.

    Raises:
        RobotSpecError: It is no craft for the geometric controller.
    """
    rotor, notes = _rotor(source, rotors)
    first, second, third, fourth = (one.name for one in rotors)
    altimeter = Sensor("altimeter", "ideal-altimeter", (0.0, 0.0, 0.0))
    spec = msgspec.structs.replace(
        spec, controller="geometric", limits=AIR_LIMITS, rotors=(first, second, third, fourth),
        rotor=rotor, sensors=(altimeter,),
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(rotorcraft_mjcf(source, spec))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = surface(model, data)
    low, high = (float(n(points[:, 2])) for n in (np.min, np.max))
    centre = float(rigid_body(source, all_rigid(source))[1][2])
    return (
        msgspec.structs.replace(
            spec,
            radius=up(float(np.linalg.norm(points, axis=1).max()) + SPARE),
            height=up(high - low + 2.0 * SPARE),
            sensors=(
                Sensor("lidar", "ideal-lidar-wide", (0.0, 0.0, round(centre + high + 0.01, 4))),
                Sensor("depth", "ideal-depth-camera", (0.0, 0.0, 0.0)),
                Sensor("altimeter", "ideal-altimeter", (0.0, 0.0, round(centre + low, 4))),
            ),
        ),
        notes,
    )


def _rotor(source: Source, rotors: list[RotorPlace]) -> tuple[Rotor, list[str]]:
    """Return figures of the rotors by their thrusters, and the assumptions made."""
    model = source.model
    notes = ["lag and drag of the rotors are assumed"]
    actuators = [one.actuator for one in rotors if one.actuator >= 0]
    limited = [n for n in actuators if model.actuator_ctrllimited[n]]
    thrust = min(
        (float(model.actuator_ctrlrange[n, 1] * model.actuator_gear[n, 2]) for n in limited),
        default=0.0,
    )
    weight = 9.81 * float(model.body_subtreemass[source.base])
    if len(limited) < 4 or not 1.3 * weight < 4.0 * thrust < 20.0 * weight:
        thrust = THRUST_TO_WEIGHT * weight / 4.0
        notes.append("rotor.thrust is assumed from the weight")
    gear = model.actuator_gear[actuators[0]] if actuators else np.zeros(6)
    yaw = float(gear[5] / gear[2]) if gear[5] else YAW_RATIO
    if not gear[5]:
        notes.append("rotor.yaw_ratio is assumed")
    side = float(np.ptp([one.place[:2] for one in rotors], axis=0).min())
    radius = round(ROTOR_SHARE * side, 4)
    return Rotor(radius=radius, thrust=round(thrust, 4), yaw_ratio=yaw, lag=0.035), notes
