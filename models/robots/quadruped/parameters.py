"""Parameters of the quadruped, each with its source.

NamedTuples of floats rather than dataclasses, because numba kernels take them as they are.
"""

from __future__ import annotations

from math import acos, atan2, cos, sin
from typing import NamedTuple

LEGS = ("FL", "FR", "RL", "RR")
"""Names of the legs, front left to rear right, in the order of every array with a leg axis."""

JOINTS = ("hip", "thigh", "calf")
"""Names of a leg's joints in order: abduction about x, then two pitch joints about y."""


class Geometry(NamedTuple):
    """Leg geometry; legs are mirror images. Source: Unitree, go2_description URDF, joint origins.

    Attributes:
        hip_x: Hip joint ahead of (behind) the base origin, m.
        hip_y: Hip joint beside the base origin, m.
        thigh_y: Thigh joint outward of the hip joint, m.
        thigh_length: Thigh joint to calf joint, m.
        calf_length: Calf joint to the centre of the foot, m.
        foot_radius: m.
    """

    hip_x: float = 0.1934
    hip_y: float = 0.0465
    thigh_y: float = 0.0955
    thigh_length: float = 0.213
    calf_length: float = 0.213
    foot_radius: float = 0.022


class Actuators(NamedTuple):
    """Limits of the motors, per joint of a leg. Source: go2_description, `effort`, `velocity`.

    Attributes:
        torque: Largest torque of hip, thigh and calf, Nm.
        speed: No-load speed of hip, thigh and calf, rad/s.
        full_torque_share: Share of the no-load speed up to which full torque is there, then it
            falls linearly to none; an assumption, usual for a DC motor behind a current limit.
    """

    torque: tuple[float, float, float] = (23.7, 23.7, 35.55)
    speed: tuple[float, float, float] = (30.1, 30.1, 20.07)
    full_torque_share: float = 0.6


class Gait(NamedTuple):
    """Trot: diagonal pairs in turn. Chosen by experiment around Di Carlo et al. 2018, section V.

    Attributes:
        period: Duration of a full cycle, s.
        duty: Share of the cycle that a foot stands.
        height: Base origin above the ground, m.
        swing_height: Foot clearance at mid-swing, m.
        linear_acceleration: Slew of the commanded velocity, m/s^2.
        yaw_acceleration: Slew of the commanded yaw rate, rad/s^2.
        standing_speed: Commands below this stand (yaw: twice the number in rad/s), m/s.
        settle_time: Steps in place before it stands still, s.
        position_leash: The reference never runs further ahead of the base than this, m.
        yaw_leash: The reference never turns further ahead of the base than this, rad.
        raibert_gain: Foothold shift per velocity error, s (Raibert 1986, eq. 2.4).
        capture_time: sqrt(height / g): how far ahead the body falls (Pratt et al. 2006), s.
        balance_forward: It steps when the capture point leaves the feet's centre by this, m.
        balance_sideways: It steps when the capture point leaves that centre sideways by this, m.
        balance_tilt: It steps when roll or pitch exceed this, rad.
        contact_force: A standing foot has met the ground above this, N.
        early_contact_force: A swinging one above this, N.
        early_contact_share: Share of the swing before which touching is scuffing, not standing.
        ground_time: Time constant of the ground estimate, s.
        longest_wait: Lift-off waits for a late foot of the other pair no longer than this, s.
    """

    period: float = 0.40
    duty: float = 0.55
    height: float = 0.30
    swing_height: float = 0.10
    linear_acceleration: float = 1.6
    yaw_acceleration: float = 4.0
    standing_speed: float = 0.02
    settle_time: float = 0.6
    position_leash: float = 0.08
    yaw_leash: float = 0.2
    raibert_gain: float = 0.05
    capture_time: float = 0.17
    balance_forward: float = 0.07
    balance_sideways: float = 0.05
    balance_tilt: float = 0.25
    contact_force: float = 1.0
    early_contact_force: float = 5.0
    early_contact_share: float = 0.6
    ground_time: float = 0.15
    longest_wait: float = 0.12


class Prediction(NamedTuple):
    """The convex model-predictive controller of Di Carlo et al. 2018, solved by ADMM.

    Attributes:
        steps: Horizon length.
        step_time: s.
        period: Time between solves, s; half as often falls, twice as often gains nothing.
        friction: Friction coefficient that the forces stay within, below the least
            expected of a floor: at 0.6 five of ten runs on floors of 0.4 to 0.55 fell.
        largest_normal_force: Per foot, N.
        weight_angle: Roll, pitch, yaw error, 1/rad^2.
        weight_position: x, y, z error of the centre of mass, 1/m^2.
        weight_angular_velocity: World frame, s^2/rad^2.
        weight_velocity: s^2/m^2.
        weight_force: 1/N^2.
        penalty: rho of ADMM (Boyd et al. 2011, section 3.1), 1/N^2.
        iterations: ADMM iterations; 15 walk as well as 40.
        late_contact: A foot that has not met the ground so long after it was due bears nothing
            now, s.
    """

    steps: int = 10
    step_time: float = 0.03
    period: float = 0.02
    friction: float = 0.35
    largest_normal_force: float = 250.0
    weight_angle: tuple[float, float, float] = (30.0, 30.0, 20.0)
    weight_position: tuple[float, float, float] = (10.0, 10.0, 80.0)
    weight_angular_velocity: tuple[float, float, float] = (0.2, 0.2, 0.5)
    weight_velocity: tuple[float, float, float] = (1.0, 1.0, 0.3)
    weight_force: float = 4e-6
    penalty: float = 2e-5
    iterations: int = 15
    late_contact: float = 0.01


class Legs(NamedTuple):
    """Gains of the legs, chosen by experiment.

    Attributes:
        swing_stiffness: Cartesian, N/m.
        swing_damping: Cartesian, N s/m.
        stance_damping: Joint damping of standing legs, Nm s/rad.
        reach_speed: A foot that should stand but hangs in the air moves down at this, m/s.
        press: Swing ends this far below the ground, so that the foot arrives, m;
            at 0.005 as at 0.12 s of waiting it waits on flat floor, too, and tracks worse.
    """

    swing_stiffness: float = 600.0
    swing_damping: float = 15.0
    stance_damping: float = 0.3
    reach_speed: float = 1.2
    press: float = 0.02


class Tracking(NamedTuple):
    """Setpoint to velocity command, and the command's limits.

    Attributes:
        position_gain: 1/s.
        heading_gain: 1/s.
        forward_low: Fastest walk backwards, m/s.
        forward_high: Fastest walk forwards, m/s.
        lateral: Fastest walk sideways, m/s.
        yaw_rate: Fastest turn, rad/s.
        arrive_distance: A resting setpoint this near is reached: stand, m.
        depart_distance: A reached resting setpoint this far is lost again: walk, m.
        arrive_angle: Error of the heading within which it is reached, rad.
        depart_angle: Error of the heading beyond which it is lost again, rad.
    """

    position_gain: float = 1.0
    heading_gain: float = 2.0
    forward_low: float = -0.5
    forward_high: float = 1.5
    lateral: float = 0.4
    yaw_rate: float = 1.2
    arrive_distance: float = 0.02
    depart_distance: float = 0.06
    arrive_angle: float = 0.04
    depart_angle: float = 0.12


class Parameters(NamedTuple):
    """Everything that the controller is tuned by, one group per part of it."""

    geometry: Geometry = Geometry()
    actuators: Actuators = Actuators()
    gait: Gait = Gait()
    prediction: Prediction = Prediction()
    legs: Legs = Legs()
    tracking: Tracking = Tracking()


FAST = Parameters(
    gait=Gait(linear_acceleration=2.2),
    tracking=Tracking(forward_low=-0.8, forward_high=2.0, yaw_rate=1.8),
)
"""Parameters for navigation at 1.5 m/s, 2 m/s^2 and 1.5 rad/s, with a reserve for feedback.

`wayproof bench robots` measures falls and tracking up to 2 m/s and on floors of friction 0.4.
"""


def standing_joints(geometry: Geometry, height: float) -> tuple[float, float, float]:
    """Return hip, thigh and calf angle, rad, that put the foot under the hip (law of cosines).

    Args:
        geometry: Leg geometry.
        height: Base origin above the ground, m.

    Raises:
        ValueError: The leg does not reach that far.
    """
    thigh, calf = geometry.thigh_length, geometry.calf_length
    reach = height - geometry.foot_radius
    if not abs(thigh - calf) < reach < thigh + calf:
        raise ValueError(f"height: got {height} m, legs reach to {thigh + calf} m above the foot")
    bend = acos((reach**2 - thigh**2 - calf**2) / (2.0 * thigh * calf))
    return 0.0, atan2(calf * sin(bend), thigh + calf * cos(bend)), -bend
