"""Spec files proposed from an MJCF: base, feet or rotors, and the space that the body takes up."""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np

from wayproof.models.robots.custom.legged import legged_mjcf, lowest_sphere
from wayproof.models.robots.custom.source import RobotSpecError, Source, find_mjcf, open_source
from wayproof.models.robots.custom.spec_file import Limits, Rotor, Sensor, SpecFile
from wayproof.models.robots.custom.stride import SPARE, walked
from wayproof.models.robots.custom.writing import outline, surface

LIMITS = Limits(speed=1.0, acceleration=1.5, jerk=15.0, yaw_rate=1.0, step_height=0.03)
"""Limits proposed for a robot on legs: those of the built-in quadruped in the warehouse."""

AIR_LIMITS = Limits(speed=1.5, acceleration=2.0, jerk=10.0, yaw_rate=1.5, tilt=1.2)
"""Limits proposed for a craft of four rotors."""

TORQUE_PER_WEIGHT = 1.6
"""Torque assumed where an MJCF has no limit: share of weight times the length of a leg."""

THRUST_TO_WEIGHT = 2.5
"""Ratio of largest thrust to weight assumed where an MJCF has no limit."""

ROOM = 10.0
"""Radius and height of a spec whose body is still to be measured, m."""


class Proposal(NamedTuple):
    """A spec for an MJCF.

    Attributes:
        spec: The spec.
        notes: What was assumed or measured, a line each.
    """

    spec: SpecFile
    notes: list[str]

    def toml(self) -> str:
        """Return the spec file's text, with the notes as comments."""
        spec = self.spec
        lines = [f"# {note}" for note in self.notes]
        lines += [
            f'name = "{spec.name}"', f'mjcf = "{spec.mjcf}"', f'base = "{spec.base}"',
            f'controller = "{spec.controller}"',
        ]  # fmt: skip
        for name in ("feet", "rotors"):
            if (names := getattr(spec, name)) is not None:
                lines.append(f"{name} = [{', '.join(chr(34) + one + chr(34) for one in names)}]")
        lines.append(f"radius = {spec.radius:g}")
        if spec.discs:
            discs = ", ".join(f"[{offset:g}, {radius:g}]" for offset, radius in spec.discs)
            lines.append(f"discs = [{discs}]")
        lines += [f"height = {spec.height:g}", "", "[limits]"]
        lines += [
            f"{name} = {getattr(spec.limits, name):g}"
            for name in ("speed", "acceleration", "jerk", "yaw_rate", "tilt", "step_height")
        ]
        if spec.joints.torque is not None:
            lines += ["", "[joints]", f"torque = {list(spec.joints.torque)}"]
        if spec.rotor is not None:
            rotor = spec.rotor
            lines += ["", "[rotor]"] + [
                f"{name} = {getattr(rotor, name):g}"
                for name in ("radius", "thrust", "yaw_ratio", "lag")
            ]
        for sensor in spec.sensors:
            lines += ["", "[[sensors]]", f'name = "{sensor.name}"', f'device = "{sensor.device}"',
                      f"position = {[round(n, 4) for n in sensor.position]}"]  # fmt: skip
        return "\n".join(lines) + "\n"


def propose(named: str, folder: Path) -> Proposal:
    """Propose a spec for an MJCF.

    Args:
        named: As a spec file names it: from the folder, or `package:path`.
        folder: Folder that the spec file will lie in.

    Raises:
        RobotSpecError: Neither four legs nor four rotors were found, or the body does not fit the
            controller; the message is one line.
    """
    path = find_mjcf(named, folder)
    base = _base(path)
    source = open_source(path, base)
    name = "".join(c if c.isalnum() or c in "-_" else "-" for c in path.stem)[:40]
    if rotors := _rotors(source):
        return _craft(source, name, named, base, rotors)
    feet = _feet(source)
    if len(feet) == 4:
        return _walker(source, name, named, base, feet)
    raise RobotSpecError(
        f"mjcf '{path.name}': found {len(feet)} legs of three hinges below '{base}', and no four "
        "rotors, expected four of one; another robot needs a controller of its own"
    )


def _base(path: Path) -> str:
    """Return the body that moves freely: the one with a free joint, or the first of the world."""
    try:
        tree = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError) as error:
        raise RobotSpecError(f"mjcf '{path}': {' '.join(str(error).split())[:300]}") from None
    bodies = list(tree.worldbody.bodies)
    free = [b for b in bodies if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in b.joints)]
    chosen = free or [body for body in bodies if not body.joints]
    if not chosen or not chosen[0].name:
        raise RobotSpecError(f"mjcf '{path.name}': no body with a name and a free joint")
    return str(chosen[0].name)


def _feet(source: Source) -> list[str]:
    """Return names of the feet, front left first: named spheres and sites, else their bodies."""
    model = source.model
    found: dict[int, tuple[str, np.ndarray]] = {}
    for body in range(1, model.nbody):
        chain = _hinges(source, body)
        if len(chain) != 3 or int(model.body_weldid[body]) in found:
            continue
        link = int(model.body_weldid[body])
        sphere = lowest_sphere(source, link)
        if sphere is None:
            continue
        geom, place, _ = sphere
        own = model.geom(geom).name if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE else ""
        name = own or model.body(model.geom_bodyid[geom]).name
        if name:
            found[link] = (name, source.place(place))
    middle = np.mean([place for _, place in found.values()], axis=0) if found else np.zeros(3)
    order = {}
    for name, place in found.values():
        front, left = place[0] > middle[0], place[1] > middle[1]
        order[(not front, not left)] = name
    return [order[key] for key in sorted(order)] if len(found) == 4 else list(order.values())[:3]


def _hinges(source: Source, body: int) -> list[int]:
    """Return the hinges between a body and the base; of another tree, none."""
    model, joints = source.model, []
    link = int(model.body_weldid[body])
    while link not in (source.base, 0):
        count, first = int(model.body_jntnum[link]), int(model.body_jntadr[link])
        joints += list(range(first, first + count))
        link = int(model.body_weldid[model.body_parentid[link]])
    return joints if link == source.base else []


def _walker(source: Source, name: str, named: str, base: str, feet: list[str]) -> Proposal:
    notes = [f"proposed for {source.path.name}: limits are those of the built-in quadruped"]
    fl, fr, rl, rr = feet
    points = surface(source.model, source.data)
    trunk = np.concatenate([outline(source, geom) for geom in source.colliding(source.base)])
    top = float(trunk[:, 2].max())
    spec = SpecFile(
        name=name, mjcf=named, base=base, controller="trot", radius=ROOM, height=ROOM,
        limits=LIMITS, feet=(fl, fr, rl, rr),
        sensors=(Sensor("lidar", "ideal-lidar-floor", (0.0, 0.0, round(top + 0.03, 3))),),
    )  # fmt: skip
    try:
        mjcf = legged_mjcf(source, spec)
    except RobotSpecError as error:
        if "no torque limit" not in str(error):
            raise
        mass = float(source.model.body_subtreemass[source.base])
        reach = float(np.ptp(points[:, 2]))
        torque = round(TORQUE_PER_WEIGHT * mass * 9.81 * reach / 4.0, 1)
        joints = msgspec.structs.replace(spec.joints, torque=(torque, torque, 1.5 * torque))
        spec = msgspec.structs.replace(spec, joints=joints)
        notes.append("joints.torque is assumed from the weight: the MJCF has no limits")
        mjcf = legged_mjcf(source, spec)
    stride = walked(mjcf, spec)
    if stride.fell:
        raise RobotSpecError("the robot falls as it walks with the proposed limits")
    notes.append("radius, discs and height: measured as it walks ahead, in bends and on the spot")
    spec = msgspec.structs.replace(
        spec,
        radius=_up(stride.reach + SPARE),
        height=_up(stride.height + SPARE),
        discs=stride.discs(),
    )
    return Proposal(spec, notes)


def _rotors(source: Source) -> list[int]:
    """Return the four actuators that push along z at sites, rear right first; else none."""
    model = source.model
    sites = [
        n for n in range(model.nu)
        if model.actuator_trntype[n] == mujoco.mjtTrn.mjTRN_SITE and model.actuator_gear[n, 2]
    ]  # fmt: skip
    if len(sites) != 4:
        return []
    places = np.array(
        [source.place(source.data.site_xpos[model.actuator_trnid[n, 0]]) for n in sites]
    )
    middle = places.mean(axis=0)
    order = []
    for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        fits = [n for n, place in zip(sites, places - middle, strict=True)
                if place[0] * x > 0.0 and place[1] * y > 0.0]  # fmt: skip
        if len(fits) != 1:
            return []
        order += fits
    return order


def _craft(source: Source, name: str, named: str, base: str, rotors: list[int]) -> Proposal:
    model = source.model
    notes = [f"proposed for {source.path.name}: lag and drag of the rotors are assumed"]
    sites = [model.site(int(model.actuator_trnid[n, 0])).name for n in rotors]
    mass = float(model.body_subtreemass[source.base])
    thrust = [
        float(model.actuator_ctrlrange[n, 1] * model.actuator_gear[n, 2]) for n in rotors
        if model.actuator_ctrllimited[n]
    ]  # fmt: skip
    weight = mass * 9.81
    if len(thrust) < 4 or not 1.3 * weight < 4.0 * min(thrust) < 20.0 * weight:
        thrust = [THRUST_TO_WEIGHT * weight / 4.0]
        notes.append("rotor.thrust is assumed from the weight")
    gear = model.actuator_gear[rotors[0]]
    yaw = float(gear[5] / gear[2]) or 0.015
    places = np.array([source.place(source.data.site_xpos[model.actuator_trnid[n, 0]])
                       for n in rotors])  # fmt: skip
    side = float(np.ptp(places[:, :2], axis=0).min())
    radius = round(0.3 * side, 4)
    points = surface(model, source.data) - source.data.subtree_com[source.base]
    spread = float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
    reach = max(float(np.linalg.norm(points, axis=1).max()), spread + radius)
    low, high = (float(n(points[:, 2])) for n in (np.min, np.max))
    spec = SpecFile(
        name=name, mjcf=named, base=base, controller="geometric",
        radius=_up(reach + SPARE), height=_up(max(high - low, 0.05) + 2.0 * SPARE),
        limits=AIR_LIMITS, rotors=(sites[0], sites[1], sites[2], sites[3]),
        rotor=Rotor(radius=radius, thrust=round(min(thrust), 4), yaw_ratio=yaw, lag=0.035),
        sensors=(
            Sensor("lidar", "ideal-lidar-wide", (0.0, 0.0, round(high + 0.01, 4))),
            Sensor("depth", "ideal-depth-camera", (0.0, 0.0, 0.0)),
            Sensor("altimeter", "ideal-altimeter", (0.0, 0.0, round(low, 4))),
        ),
    )  # fmt: skip
    return Proposal(spec, notes)


def _up(length: float) -> float:
    """Round up to a centimetre."""
    return ceil(100.0 * length - 1e-9) / 100.0
