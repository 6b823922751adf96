"""Rotorcraft with four rotors in an X, rewritten for the geometric controller.

It becomes one rigid body whose origin is its centre of mass; rotors are made of the spec's numbers,
because an MJCF has no thrust limits, reaction torques or lags of its own that could be trusted.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.source import RobotSpecError, Source, find
from wayproof.models.robots.custom.spec_file import Limits, Rotor, Sensor, SpecFile
from wayproof.models.robots.custom.walker import SPARE, up
from wayproof.models.robots.custom.writing import (
    HEAD,
    Assets,
    check_size,
    geoms,
    inertial,
    numbers,
    rangefinders,
    rigid_body,
    sensor_sites,
    surface,
)
from wayproof.models.robots.quadrotor.model import ROTOR_THICKNESS, ROTORS, rotor_motor
from wayproof.models.robots.quadrotor.parameters import GRAVITY, Airframe, Gains, Parameters

MAX_ROTOR_ASYMMETRY = 0.05
"""Maximum distance of a rotor off the rectangle about the centre of mass, as a share of its own."""

RESIDUAL_LAG = 0.014
"""Rotor lag that remains after its inversion, s: that of the craft the gains were tuned on."""

MIN_THRUST_TO_WEIGHT = 1.3
"""Minimum ratio of largest thrust to weight that leaves thrust to steer with."""


def rotorcraft_mjcf(source: Source, spec: SpecFile) -> str:
    """Write the craft alone, in the form of the geometric controller.

    Raises:
        RobotSpecError: It is no X of four rotors, or the spec does not fit it.
    """
    if spec.rotors is None or spec.rotor is None:
        raise RobotSpecError(
            "rotors, rotor: got none, expected them for the controller 'geometric'"
        )
    bodies = all_rigid(source)
    mass, origin, _ = rigid_body(source, bodies)
    trunk = inertial(source, bodies, origin)
    places = [_place(source, name) - origin for name in spec.rotors]
    arm_x, arm_y = _arms(places)
    if 4.0 * spec.rotor.thrust < MIN_THRUST_TO_WEIGHT * mass * GRAVITY:
        weight = mass * GRAVITY
        raise RobotSpecError(
            f"rotor.thrust: four of {spec.rotor.thrust:g} N lift {weight:.3g} N, expected "
            f"{MIN_THRUST_TO_WEIGHT} times the weight"
        )
    assets = Assets()
    moving = sorted({int(source.model.body_weldid[body]) for body in bodies})
    trunk += "".join(geoms(source, body, origin, assets) for body in moving)
    trunk += sensor_sites(spec, origin)
    airframe = _airframe(spec, mass, (0.0, 0.0, 0.0), arm_x, arm_y)
    discs = "".join(_rotor(airframe, *row, float(places[i][2])) for i, row in enumerate(ROTORS))
    motors = "".join(rotor_motor(airframe, name, spin) for name, _, _, spin in ROTORS)
    return f"""<mujoco model="{spec.name}">
  {HEAD}
  <asset>{assets.text}</asset>
  <worldbody>
    <body name="base"><freejoint name="root"/>{trunk}{discs}</body>
  </worldbody>
  <actuator>{motors}</actuator>
  <sensor>{rangefinders(spec)}</sensor>
</mujoco>"""


def rotorcraft_parameters(model: mujoco.MjModel, prefix: str, spec: SpecFile) -> Parameters:
    """Return the geometric controller's parameters; mass, inertia and arms by the model.

    Raises:
        RobotSpecError: The spec says nothing of the rotors.
        KeyError: A name is missing.
    """
    base = model.body(prefix + "base").id
    R, inertia = np.empty(9), np.diag(model.body_inertia[base])
    mujoco.mju_quat2Mat(R, model.body_iquat[base])
    turn = R.reshape(3, 3)
    xx, yy, zz = np.diag(turn @ inertia @ turn.T).tolist()
    arm_x, arm_y = np.abs(model.site(prefix + ROTORS[0][0]).pos[:2]).tolist()
    gains = Gains()
    if spec.rotor is None:
        raise RobotSpecError("rotor: got none, expected it for the controller 'geometric'")
    lead = max(gains.lag_lead, 1.0 - RESIDUAL_LAG / spec.rotor.lag)
    airframe = _airframe(spec, float(model.body_mass[base]), (xx, yy, zz), arm_x, arm_y)
    return Parameters(airframe=airframe, gains=gains._replace(lag_lead=lead))


def check_rotorcraft(spec: SpecFile, model: mujoco.MjModel) -> None:
    """Refuse a radius or height that the craft exceeds."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    check_size(spec, surface(model, data), flying=True)


def _airframe(
    spec: SpecFile, mass: float, inertia: tuple[float, float, float], arm_x: float, arm_y: float
) -> Airframe:
    assert spec.rotor is not None
    rotor = spec.rotor
    return Airframe(
        mass=mass,
        inertia=inertia,
        arm_x=arm_x,
        arm_y=arm_y,
        rotor_radius=rotor.radius,
        thrust_max=rotor.thrust,
        yaw_ratio=rotor.yaw_ratio,
        rotor_lag=rotor.lag,
        drag=rotor.drag,
        body_drag=rotor.body_drag,
    )


def all_rigid(source: Source) -> list[int]:
    """Return every body of the craft; propellers on joints count where they are at rest."""
    model = source.model
    bodies = np.flatnonzero(model.body_rootid == model.body_rootid[source.base]).tolist()
    return [body for body in bodies if body >= source.base]


def _place(source: Source, name: str) -> Array:
    data, kinds = source.data, mujoco.mjtObj
    for kind, places in (
        (kinds.mjOBJ_SITE, data.site_xpos),
        (kinds.mjOBJ_GEOM, data.geom_xpos),
        (kinds.mjOBJ_BODY, data.xpos),
    ):
        found = find(source.model, kind, name)
        if found is not None:
            return source.place(places[found])
    raise RobotSpecError(f"rotors: no site, geom or body '{name}' in the MJCF")


def _arms(places: list[Array]) -> tuple[float, float]:
    """Return distances of the rotors ahead of and beside the centre of mass, m."""
    arm_x, arm_y = (float(np.abs(np.array(places)[:, i]).mean()) for i in (0, 1))
    for (name, x, y, _), place in zip(ROTORS, places, strict=True):
        off = hypot(place[0] - x * arm_x, place[1] - y * arm_y)
        if off > MAX_ROTOR_ASYMMETRY * hypot(arm_x, arm_y):
            raise RobotSpecError(
                f"rotors: the {name.replace('_', ' ')} one is at ({place[0]:.4f}, {place[1]:.4f}) "
                "from the centre of mass, expected an X: rear right, rear left, front left, front "
                "right"
            )
    return arm_x, arm_y


def _rotor(airframe: Airframe, name: str, x: int, y: int, spin: int, height: float) -> str:
    at = numbers((x * airframe.arm_x, y * airframe.arm_y, height))
    thickness = min(ROTOR_THICKNESS, 0.2 * airframe.rotor_radius)
    size = numbers((airframe.rotor_radius, thickness / 2.0))
    return (
        f'<geom name="{name}_disc" type="cylinder" size="{size}" pos="{at}"/>'
        f'<site name="{name}" pos="{at}"/>'
    )


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
    rotor, notes = _rotor_figures(source, rotors)
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


def _rotor_figures(source: Source, rotors: list[RotorPlace]) -> tuple[Rotor, list[str]]:
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
