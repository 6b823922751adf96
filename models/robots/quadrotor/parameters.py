"""Parameters of the quadrotor, each with its source.

NamedTuples of floats rather than dataclasses, because numba kernels take them as they are.
"""

from __future__ import annotations

from typing import NamedTuple

GRAVITY = 9.81


class Airframe(NamedTuple):
    """Body and rotors.

    Source: Skydio X2's public MuJoCo model, for mass, arms, rotor thrust and yaw ratio. Inertia,
    motor lag and drag are assumptions of plausible size, not identified from any craft.

    Attributes:
        mass: kg.
        inertia: About the body axes x forward, y left, z up, kg m^2.
        arm_x: Rotor ahead of (behind) the centre of mass, m.
        arm_y: Rotor beside the centre of mass, m.
        rotor_radius: m.
        thrust_max: Largest thrust of a rotor, N; the least is 0.
        yaw_ratio: Reaction torque by thrust, m.
        rotor_lag: Time constant of thrust, s.
        drag: Linear rotor drag along the body axes, N s/m (Kai et al. 2017, Faessler et al. 2018).
        body_drag: Quadratic drag of the hull in any direction, N s^2/m^2: half the air's density
            times a drag area of 0.033 m^2.
    """

    mass: float = 1.325
    inertia: tuple[float, float, float] = (0.0366, 0.0254, 0.0546)
    arm_x: float = 0.14
    arm_y: float = 0.18
    rotor_radius: float = 0.13
    thrust_max: float = 13.0
    yaw_ratio: float = 0.0201
    rotor_lag: float = 0.035
    drag: tuple[float, float, float] = (0.25, 0.25, 0.15)
    body_drag: float = 0.02


class Gains(NamedTuple):
    """Gains of the geometric controller, by experiment; horizontal ones from poles near 4 rad/s.

    Attributes:
        position: Position gain per axis, 1/s^2.
        velocity: Velocity gain per axis, 1/s.
        integral: Gain of the integrated position error, 1/s^3.
        integral_limit: Largest acceleration of the integral on an axis, m/s^2.
        position_limit: Position error beyond this on an axis counts as this, m.
        attitude: Per body axis, 1/s^2; yaw is soft because its torque is scarce.
        rate: Per body axis, 1/s.
        least_lift: The demanded vertical thrust is never below this share of the weight, so that
            the demanded attitude stays upright.
        lag_lead: Share of the motor lag that is inverted.
        lag_filter: Time constant of the differentiated thrust demand, s.
        idle: Least thrust demanded of a rotor, as a share of the largest.
        tilt_share: Largest thrust that roll and pitch together add to or take from a rotor, as a
            share of the largest: the hover thrust, so that violent turns do not lift the craft.
        tilt_floor: Share of the largest thrust that they have however little thrust is demanded;
            beyond it they have what lies between demand and idle. As large as `tilt_share`: they
            always have that, and lift a craft that is to sink.
        tilt_first: Whether roll and pitch ignore an error of heading. Yaw gets the torque that
            they leave, so that error can grow; it would then turn their torque aside.
        yaw_share: Largest yaw torque as a share of what all rotors could give.
    """

    position: tuple[float, float, float] = (16.0, 16.0, 19.2)
    velocity: tuple[float, float, float] = (7.0, 7.0, 8.4)
    integral: float = 6.0
    integral_limit: float = 4.0
    position_limit: float = 1.0
    attitude: tuple[float, float, float] = (324.0, 324.0, 36.0)
    rate: tuple[float, float, float] = (28.8, 28.8, 12.0)
    least_lift: float = 0.5
    lag_lead: float = 0.6
    lag_filter: float = 0.02
    idle: float = 0.01
    tilt_share: float = 0.25
    tilt_floor: float = 0.25
    tilt_first: bool = False
    yaw_share: float = 0.15


class Smoothing(NamedTuple):
    """The critically damped filter of fourth order between setpoints and tracking.

    Setpoints are smooth to their first derivative only, while the feed-forward needs four: taken
    raw, their steps in jerk drive the rotors into their limits.

    Attributes:
        bandwidth: Bandwidth of the four equal poles, rad/s.
        limits: Greatest speed, acceleration, jerk and snap of the reference, m/s .. m/s^4; a
            setpoint within the robot's spec stays far below them, one that jumps does not.
        heading_limits: Greatest first to fourth derivative of the heading, rad/s .. rad/s^4.
    """

    bandwidth: float = 20.0
    limits: tuple[float, float, float, float] = (3.0, 8.0, 100.0, 2000.0)
    heading_limits: tuple[float, float, float, float] = (3.0, 10.0, 200.0, 4000.0)

    @property
    def lag(self) -> float:
        """Lag of the tracked reference behind the setpoints, s."""
        return 4.0 / self.bandwidth


class Parameters(NamedTuple):
    """All parameters of a quadrotor."""

    airframe: Airframe = Airframe()
    gains: Gains = Gains()
    smoothing: Smoothing = Smoothing()


def room_at_least_lift(airframe: Airframe, gains: Gains) -> float:
    """Return the `tilt_floor` beside the least lift ever demanded of an upright craft.

    A craft far from the attitude that it needs has less thrust along it, and turns to it by this.
    """
    hover = 0.25 * airframe.mass * GRAVITY / airframe.thrust_max
    return gains.least_lift * hover - gains.idle


FAST = Parameters(
    gains=Gains(tilt_floor=room_at_least_lift(Airframe(), Gains()), tilt_first=True),
    smoothing=Smoothing(bandwidth=25.0, limits=(6.0, 12.0, 150.0, 4000.0)),
)
"""Parameters for navigation at 4 m/s and 4 m/s^2.

`wayproof bench robots` flies between points at up to 5 m/s with these, in gusts too.
"""
