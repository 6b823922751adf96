"""Parameters of the trot controller for a quadruped of any size, from its compiled model."""

from __future__ import annotations

from math import hypot, sqrt

import mujoco
import numpy as np

from wayproof.models.robots.custom.source import RobotSpecError
from wayproof.models.robots.custom.spec_file import SpecFile
from wayproof.models.robots.quadruped.legs import foot_jacobian
from wayproof.models.robots.quadruped.parameters import (
    JOINTS,
    LEGS,
    Actuators,
    Gait,
    Geometry,
    Legs,
    Parameters,
    Prediction,
    Tracking,
    standing_joints,
)

STANCE_SHARE = 0.65
"""Height of the stance as a share of the stretched leg, at which the gait was tuned."""

TUNED_LEG, TUNED_MASS, TUNED_FOOT = 0.426, 15.02, 0.502
"""Stretched leg, m, mass and `foot_mass`, kg, of the robot that gait and gains were tuned on."""

GRAVITY = 9.81

UNLIMITED_SPEED = 1e6
"""No-load speed of a motor without a torque curve, rad/s."""


def legged_parameters(model: mujoco.MjModel, prefix: str, spec: SpecFile) -> Parameters:
    """Return the trot controller's parameters for the robot in a compiled model.

    Raises:
        ValueError: The stance is beyond the legs or the joints' ranges.
        KeyError: A name is missing.
    """
    geometry = leg_geometry(model, prefix)
    mass = float(model.body_subtreemass[model.body(prefix + "base").id])
    leg = geometry.thigh_length + geometry.calf_length
    height = spec.stance or stance_height(geometry, STANCE_SHARE)
    torque = [float(model.actuator(f"{prefix}FL_{joint}").ctrlrange[1]) for joint in JOINTS]
    speed = spec.joints.speed or (UNLIMITED_SPEED, UNLIMITED_SPEED, UNLIMITED_SPEED)
    try:
        standing = standing_joints(geometry, height)
    except ValueError as error:
        raise RobotSpecError(f"stance: {error}") from None
    _check_stance(model, prefix, standing)
    foot = foot_mass(model, prefix, geometry, standing)
    parameters = scaled(mass / TUNED_MASS, leg / TUNED_LEG, foot / TUNED_FOOT)
    return parameters._replace(
        geometry=geometry,
        actuators=Actuators((torque[0], torque[1], torque[2]), speed),
        gait=parameters.gait._replace(
            height=height,
            swing_height=spec.swing_height or parameters.gait.swing_height,
            capture_time=sqrt(height / GRAVITY),
        ),
    )


def stance_height(geometry: Geometry, share: float) -> float:
    """Return the height of the base whose legs are at a share of their stretched length, m."""
    leg = geometry.thigh_length + geometry.calf_length
    return round(share * leg + geometry.foot_radius, 3)


def foot_mass(
    model: mujoco.MjModel, prefix: str, geometry: Geometry, standing: tuple[float, float, float]
) -> float:
    """Return the largest mass of a foot as a force on it feels it, the motors' rotors included, kg.

    The mean diagonal of (J M^-1 J^T)^-1 (Khatib 1987, eq. 51) of a leg as it stands.
    """
    data = mujoco.MjData(model)
    legs = [[model.joint(f"{prefix}{leg}_{joint}") for joint in JOINTS] for leg in LEGS]
    for joints in legs:
        data.qpos[[int(joint.qposadr[0]) for joint in joints]] = standing
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    masses = []
    for leg, joints in enumerate(legs):
        dofs = [int(joint.dofadr[0]) for joint in joints]
        J = np.zeros((3, 3))
        foot_jacobian(geometry, leg, np.array(standing), J)
        felt = np.linalg.inv(J @ np.linalg.inv(full[np.ix_(dofs, dofs)]) @ J.T)
        masses.append(float(np.trace(felt)) / 3.0)
    return max(masses)


def scaled(mass: float, length: float, foot: float) -> Parameters:
    """Scale gait and gains to a robot of another size, from the one that they were tuned at.

    Dynamic similarity (Alexander and Jayes 1983): lengths grow by s, forces by m, times by sqrt(s).
    A foot that is heavier than that is held more stiffly, so that it swings as fast.

    Args:
        mass: Mass of the robot, kg.
        length: Length of a stretched leg, m.
        foot: Foot mass by `foot_mass`, kg.
    """
    m, s, t, f = mass, length, sqrt(length), max(mass, foot)
    gait, prediction, legs, tracking = Gait(), Prediction(), Legs(), Tracking()
    return Parameters(
        gait=gait._replace(
            period=gait.period * t,
            swing_height=gait.swing_height * s,
            settle_time=gait.settle_time * t,
            yaw_acceleration=gait.yaw_acceleration / s,
            position_leash=gait.position_leash * s,
            raibert_gain=gait.raibert_gain * t,
            balance_forward=gait.balance_forward * s,
            balance_sideways=gait.balance_sideways * s,
            contact_force=gait.contact_force * m,
            early_contact_force=gait.early_contact_force * m,
            ground_time=gait.ground_time * t,
            longest_wait=gait.longest_wait * t,
        ),
        prediction=prediction._replace(
            step_time=prediction.step_time * t,
            largest_normal_force=prediction.largest_normal_force * m,
            weight_position=_times(prediction.weight_position, 1.0 / s**2),
            weight_angular_velocity=_times(prediction.weight_angular_velocity, 1.0 / s),
            weight_velocity=_times(prediction.weight_velocity, 1.0 / s),
            weight_force=prediction.weight_force / m**2,
            penalty=prediction.penalty / m**2,
        ),
        legs=legs._replace(
            swing_stiffness=legs.swing_stiffness * f / s,
            swing_damping=legs.swing_damping * f / t,
            stance_damping=legs.stance_damping * m * s * t,
            reach_speed=legs.reach_speed * t,
            press=legs.press * s,
        ),
        tracking=tracking._replace(
            forward_low=tracking.forward_low * t,
            forward_high=tracking.forward_high * t,
            lateral=tracking.lateral * t,
            yaw_rate=tracking.yaw_rate / t,
        ),
    )


def _times(values: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    return values[0] * factor, values[1] * factor, values[2] * factor


def leg_geometry(model: mujoco.MjModel, prefix: str) -> Geometry:
    """Return means over the legs of the written robot, links at rest along the base.

    Args:
        model: Compiled model with the robot in it.
        prefix: Prefix of the robot's names there.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = model.body(prefix + "base").id
    R, at = data.xmat[base].reshape(3, 3), data.xpos[base]
    rows = []
    for leg in LEGS:
        hip, thigh, calf = (data.xanchor[model.joint(f"{prefix}{leg}_{j}").id] for j in JOINTS)
        foot = model.geom(f"{prefix}{leg}_foot").id
        hip, thigh, calf, end = ((p - at) @ R for p in (hip, thigh, calf, data.geom_xpos[foot]))
        upper, lower = calf - thigh, end - calf
        rows.append(
            (
                abs(thigh[0]), abs(hip[1]), abs(end[1] - hip[1]), hypot(upper[0], upper[2]),
                hypot(lower[0], lower[2]), model.geom_size[foot, 0],
            )
        )  # fmt: skip
    return Geometry(*np.mean(rows, axis=0).tolist())


def _check_stance(model: mujoco.MjModel, prefix: str, standing: tuple[float, float, float]) -> None:
    for leg in LEGS:
        for joint, angle in zip(JOINTS, standing, strict=True):
            named = model.joint(f"{prefix}{leg}_{joint}")
            low, high = model.jnt_range[named.id]
            if model.jnt_limited[named.id] and not low <= angle <= high:
                raise RobotSpecError(
                    f"stance: {leg} {joint} at {angle:.2f} rad from straight down, beyond its "
                    f"range {low:.2f} to {high:.2f}: expected knees that bend backwards"
                )
