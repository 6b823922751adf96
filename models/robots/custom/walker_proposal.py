"""Spec of a robot on four legs, proposed from its MJCF."""

from __future__ import annotations

from math import ceil

import msgspec
import mujoco
import numpy as np

from wayproof.models.robots.custom.feet import foot_sphere
from wayproof.models.robots.custom.legged import legged_mjcf
from wayproof.models.robots.custom.legged_parameters import leg_geometry, stance_height
from wayproof.models.robots.custom.source import RobotSpecError, Source
from wayproof.models.robots.custom.spec_file import Joints, Limits, Sensor, SpecFile
from wayproof.models.robots.custom.stride import SPARE, Stride, walked
from wayproof.models.robots.custom.writing import outline

LIMITS = Limits(speed=1.0, acceleration=1.5, jerk=15.0, yaw_rate=1.0, step_height=0.03)
"""Limits proposed for a robot on legs: those of the built-in quadruped in the warehouse."""

TORQUE_PER_WEIGHT = 1.6
"""Torque assumed where an MJCF has no limit: share of weight times the length of a leg."""

STANCES = (0.72, 0.78, 0.84)
"""Heights tried where the joints do not bear the robot on bent legs, as shares of a stretched leg.

The straighter a leg, the shorter the lever of the weight about its knee.
"""

ROOM = 10.0
"""Radius and height of a spec whose body is still to be measured, m."""


def find_feet(source: Source) -> list[str]:
    """Return names of the feet, front left first: named spheres and sites, else their bodies."""
    model = source.model
    found: dict[int, tuple[str, np.ndarray]] = {}
    for body in range(1, model.nbody):
        chain = _hinges(source, body)
        if len(chain) != 3 or int(model.body_weldid[body]) in found:
            continue
        link = int(model.body_weldid[body])
        foot = foot_sphere(source, link)
        if foot is None:
            continue
        own = model.geom(foot.geom).name if foot.whole else ""
        name = own or model.body(model.geom_bodyid[foot.geom]).name
        if name:
            found[link] = (name, source.place(foot.place))
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


def propose_walker(source: Source, spec: SpecFile, feet: list[str]) -> tuple[SpecFile, list[str]]:
    """Return a spec with feet, space, limits and a lidar, and the assumptions and measurements.

    Args:
        source: The MJCF.
        spec: Spec with the names of the robot, the MJCF and the base.
        feet: Names of the feet, front left, front right, rear left, rear right.

    Raises:
        RobotSpecError: It is no robot for the trot controller, or does not walk.
    """
    notes = ["limits are those of the built-in quadruped"]
    fl, fr, rl, rr = feet
    trunk = np.concatenate([outline(source, geom) for geom in source.colliding(source.base)])
    above = (0.0, 0.0, round(float(trunk[:, 2].max()) + 0.03, 3))
    spec = msgspec.structs.replace(
        spec, controller="trot", limits=LIMITS, feet=(fl, fr, rl, rr),
        sensors=(Sensor("lidar", "ideal-lidar-floor", above),),
    )  # fmt: skip
    try:
        mjcf = legged_mjcf(source, spec)
    except RobotSpecError as error:
        if "no torque limit" not in str(error):
            raise
        spec = _with_torques(source, spec)
        notes.append("joints.torque is assumed from the weight: the MJCF has no limits")
        mjcf = legged_mjcf(source, spec)
    spec, stride = _standing(mjcf, spec)
    if spec.stance is not None:
        notes.append("stance: legs so straight that the joints bear the weight on two of them")
    notes.append("radius, discs and height: measured as it walks ahead, in bends and on the spot")
    spec = msgspec.structs.replace(
        spec,
        radius=up(stride.reach + SPARE),
        height=up(stride.height + SPARE),
        discs=stride.discs(),
    )
    return spec, notes


def _with_torques(source: Source, spec: SpecFile) -> SpecFile:
    """Return the spec with torque limits by the robot's weight and the length of its legs."""
    weight = 9.81 * float(source.model.body_subtreemass[source.base])
    any_limit = msgspec.structs.replace(spec, joints=Joints(torque=(1.0, 1.0, 1.0)))
    legs = leg_geometry(mujoco.MjModel.from_xml_string(legged_mjcf(source, any_limit)), "")
    length = legs.thigh_length + legs.calf_length
    torque = round(TORQUE_PER_WEIGHT * weight * length / 4.0, 1)
    return msgspec.structs.replace(
        spec, joints=Joints(torque=(torque, torque, round(1.5 * torque, 1)))
    )


def _standing(mjcf: str, spec: SpecFile) -> tuple[SpecFile, Stride]:
    """Return the spec with the lowest stance that the joints bear in walking, and its stride."""
    stride = walked(mjcf, spec)
    geometry = leg_geometry(mujoco.MjModel.from_xml_string(mjcf), "")
    for share in STANCES:
        if stride.steady:
            break
        spec = msgspec.structs.replace(spec, stance=stance_height(geometry, share))
        stride = walked(mjcf, spec)
    if stride.fell:
        raise RobotSpecError("the robot falls as it walks with the proposed limits")
    if not stride.steady:
        raise RobotSpecError(
            f"the robot sinks by {stride.sag:.0%} as it walks: its joints' torque limits do "
            "not bear its weight on two legs"
        )
    return spec, stride


def up(length: float) -> float:
    """Round up to a centimetre."""
    return ceil(100.0 * length - 1e-9) / 100.0
