"""Robots on four legs: the space that one takes up as it walks, and a spec by its MJCF."""

from __future__ import annotations

from functools import lru_cache
from math import ceil
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.legged import legged_mjcf
from wayproof.models.robots.custom.legged_parameters import (
    leg_geometry,
    legged_parameters,
    stance_height,
)
from wayproof.models.robots.custom.source import RobotSpecError, Source, foot_sphere
from wayproof.models.robots.custom.spec_file import Joints, Limits, Sensor, SpecFile
from wayproof.models.robots.custom.writing import outline, surface
from wayproof.models.robots.quadruped import QuadrupedController

GROUND = """<mujoco><option timestep="0.002" integrator="implicitfast" cone="pyramidal"
  iterations="50"/><worldbody><geom name="floor" type="plane" size="50 50 1"
  friction="0.8 0.005 0.0001"/></worldbody></mujoco>"""
"""Level ground with the options and the friction of every world."""

PREFIX = "robot/"

COURSE = ((1.5, 1.0, 0.0), (1.5, 0.7, 1.0), (1.5, 0.7, -1.0), (1.0, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Time, s, and shares of the spec's speed and yaw rate: ahead, in both bends, on the spot, stop."""

SAMPLE = 10
"""Physics steps between two looks at the body's outline."""

SPARE = 0.01
"""Excess of proposed discs and radii, m."""


MAX_SAG = 0.03
"""Maximum drop of the base as it walks, as a share of its height in standing.

Nineteen published robots drop by 0.2 to 2 %. ANYmal B, whose joints of 40 Nm do not bear 33 kg on
two bent legs, drops by 20 % and falls.
"""


class Stride(NamedTuple):
    """Outline of a body as it walks.

    Attributes:
        corners: (n, 2) corners of the convex outline about the base's origin, x ahead, m.
        height: Highest point above the ground, m.
        fell: Whether the robot fell.
        sag: Greatest drop of the base below its height in standing, as a share of that height.
    """

    corners: Array
    height: float
    fell: bool
    sag: float

    @property
    def steady(self) -> bool:
        """Whether the robot stays up, at the height that it stands at."""
        return not self.fell and self.sag <= MAX_SAG

    @property
    def reach(self) -> float:
        """Greatest distance of the outline from the base's origin, m."""
        return float(np.linalg.norm(self.corners, axis=1).max())

    def uncovered(self, discs: tuple[tuple[float, float], ...]) -> float:
        """Return how far the outline is beyond the discs (offset, radius), m; 0 if it is not."""
        gaps = [
            np.linalg.norm(self._outline - (offset, 0.0), axis=1) - radius
            for offset, radius in discs
        ]
        return max(float(np.min(gaps, axis=0).max()), 0.0)

    @property
    def _outline(self) -> Array:
        """Return corners and points 1 cm apart between them."""
        points = []
        for tail, head in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            count = max(ceil(float(np.linalg.norm(head - tail)) / 0.01), 1)
            points.append(tail + np.arange(count)[:, None] / count * (head - tail))
        return np.concatenate(points)

    def discs(self) -> tuple[tuple[float, float], ...]:
        """Return discs in a row ahead that cover the outline: as many as it is longer than wide."""
        outline = self._outline
        low, high = outline.min(axis=0), outline.max(axis=0)
        half_width = float(np.abs(outline[:, 1]).max())
        length = float(high[0] - low[0])
        count = int(np.clip(ceil(length / (2.0 * half_width)) + 1, 2, 6))
        best: tuple[tuple[float, float], ...] = ()
        for inset in np.linspace(0.5, 1.0, 26) * half_width:
            offsets = np.linspace(low[0] + inset, high[0] - inset, count)
            gaps = np.abs(outline[:, None, 0] - offsets)
            radius = float(np.hypot(gaps.min(axis=1), outline[:, 1]).max()) + SPARE
            if not best or radius < best[0][1]:
                radius = ceil(100.0 * radius) / 100.0
                best = tuple((round(float(offset), 3), radius) for offset in offsets)
        return best


@lru_cache(maxsize=16)
def walked(mjcf: str, spec: SpecFile) -> Stride:
    """Walk a robot over a course and return its outline.

    Args:
        mjcf: The robot alone, in the form of the trot controller.
        spec: Its spec.
    """
    ground = mujoco.MjSpec.from_string(GROUND)
    robot = mujoco.MjSpec.from_string(mjcf)
    ground.attach(robot, prefix=PREFIX, frame=ground.worldbody.add_frame())
    model = ground.compile()
    data = mujoco.MjData(model)
    parameters = legged_parameters(model, PREFIX, spec)
    controller = QuadrupedController(model, PREFIX, parameters)
    controller.reset(data, np.array([0.0, 0.0, parameters.gait.height]), 0.0)
    base = model.body(PREFIX + "base").id
    alone = mujoco.MjModel.from_xml_string(mjcf)
    own = mujoco.MjData(alone)
    points, height, fell, sag = [], 0.0, False, 0.0
    for time, speed, turn in COURSE:
        command = np.array([speed * spec.limits.speed, 0.0, turn * spec.limits.yaw_rate])
        for step in range(round(time / model.opt.timestep)):
            controller.walk(data, command)
            mujoco.mj_step(model, data)
            sag = max(sag, 1.0 - float(data.xpos[base, 2]) / parameters.gait.height)
            if step % SAMPLE:
                continue
            own.qpos[:] = data.qpos
            mujoco.mj_kinematics(alone, own)
            seen = surface(alone, own)
            height = max(height, float(seen[:, 2].max()))
            R = data.xmat[base].reshape(3, 3)
            ahead = R[:2, 0] / np.hypot(*R[:2, 0])
            offset = seen[:, :2] - data.xpos[base, :2]
            left = np.array([-ahead[1], ahead[0]])
            points.append(np.column_stack([offset @ ahead, offset @ left]))
            fell |= bool(R[2, 2] < np.cos(spec.limits.tilt))
    from scipy.spatial import ConvexHull  # slow to load, and few robots are measured

    cloud = np.concatenate([one[ConvexHull(one).vertices] for one in points])
    return Stride(cloud[ConvexHull(cloud).vertices], height, fell, sag)


def stride_findings(spec: SpecFile, stride: Stride) -> list[str]:
    """Return the values of a spec that the walking body exceeds, each with one that would do."""
    wrong = []
    if stride.fell:
        wrong.append("limits: the robot falls as it walks with these")
    elif not stride.steady:
        wrong.append(
            f"stance: the base sinks by {stride.sag:.0%} as it walks: the joints' torque does not "
            "bear the weight on two legs; expected straighter legs (a larger stance), less speed "
            "or more torque"
        )
    for name, given, reach in (
        ("radius", spec.radius, stride.reach), ("height", spec.height, stride.height)
    ):  # fmt: skip
        if given < reach:
            wrong.append(f"{name}: got {given:g} m, but walking the body reaches {reach:.3f} m")
    beyond = stride.uncovered(spec.discs) if spec.discs else 0.0
    if beyond > 0.0:
        discs = ", ".join(f"[{offset:g}, {radius:g}]" for offset, radius in stride.discs())
        wrong.append(f"discs: walking the body reaches {beyond:.3f} m beyond them; expected such "
                     f"as discs = [{discs}]")  # fmt: skip
    return wrong


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
