"""From setpoint to footholds: the velocity to walk at, when to trot, and where the feet land."""

from __future__ import annotations

from math import atan2, cos, floor, hypot, isfinite, pi, sin
from typing import Any

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.legs import observe
from wayproof.models.robots.quadruped.parameters import Gait, Geometry, Tracking


@kernel
def begin(parameters: Any, observations: Any, memories: Any) -> None:
    """Start from standing on all feet where they are.

    Args:
        parameters: (1,) record of the controller's parameters.
        observations: (1,) this tick's `OBSERVATION` record.
        memories: (1,) `MEMORY` record, zeroed; filled.
    """
    geometry, observation, memory = parameters[0].geometry, observations[0], memories[0]
    memory.reference[0] = observation.position[0]
    memory.reference[1] = observation.position[1]
    memory.reference[2] = observation.angles[2]
    for leg in range(4):
        memory.touching[leg] = 1
        _stand_here(leg, observation, memory)
    _estimate_ground(geometry, 1.0, memory)


@kernel
def advance(
    parameters: Any, command: Array, touch: Array, observations: Any, memories: Any
) -> None:
    """Advance the `MEMORY` record by one tick.

    Args:
        parameters: (1,) record of the controller's parameters.
        command: (3,) forward m/s, left m/s, yaw rate rad/s, in the base's yaw frame.
        touch: (4,) normal force on each foot, N.
        observations: (1,) this tick's `OBSERVATION` record.
        memories: (1,) record to advance.
    """
    gait, geometry, timestep = parameters[0].gait, parameters[0].geometry, parameters[0].timestep
    observation, memory = observations[0], memories[0]
    _slew(gait, timestep, command, memory)
    _choose_mode(gait, timestep, observation, memory)
    _estimate_ground(geometry, timestep / gait.ground_time, memory)
    _move_reference(gait, timestep, observation, memory)
    for leg in range(4):
        _schedule_foot(gait, leg, touch[leg], observation, memory)
        if memory.swinging[leg]:
            _place_foot(gait, geometry, leg, observation, memory)


@kernel
def _slew(gait: Gait, timestep: float, command: Array, memory: Any) -> None:
    for i in range(3):
        limit = timestep * (gait.linear_acceleration if i < 2 else gait.yaw_acceleration)
        memory.command[i] += min(max(command[i] - memory.command[i], -limit), limit)


@kernel
def _choose_mode(gait: Gait, timestep: float, observation: Any, memory: Any) -> None:
    """Trot on a command or off balance; stand again once calm, when a stride ends."""
    if _commanded(gait, memory.command) or _off_balance(gait, observation):
        memory.calm_time = 0.0
        if not memory.walking:
            memory.walking = True
            memory.phase = 0.0
    else:
        memory.calm_time += timestep
    if memory.walking and not _awaits_touch_down(gait, timestep, memory):
        before = floor(2.0 * memory.phase)
        memory.phase += timestep / gait.period
        stride_ends = floor(2.0 * memory.phase) != before
        if stride_ends and memory.calm_time > gait.settle_time:
            memory.walking = False
        memory.phase -= floor(memory.phase)


@kernel
def _awaits_touch_down(gait: Gait, timestep: float, memory: Any) -> bool:
    """Return whether to hold the phase: one pair is about to lift off and the other hangs.

    The schedule waits for the event (Bledt et al. 2018, "Contact model fusion for event-based
    locomotion in unstructured terrains"), so that a step down does not leave the body on no foot.
    """
    lifting = hanging = swinging = False
    for leg in range(4):
        phase = memory.leg_phase[leg]
        lifting = lifting or phase < gait.duty <= phase + timestep / gait.period
        hanging = hanging or memory.touching[leg] == 0
        swinging = swinging or memory.swinging[leg] == 1
    waits = lifting and hanging and not swinging and memory.waited < gait.longest_wait
    memory.waited = memory.waited + timestep if waits else 0.0
    return waits


@kernel
def _commanded(gait: Gait, command: Array) -> bool:
    slow = gait.standing_speed
    return bool(abs(command[0]) > slow or abs(command[1]) > slow or abs(command[2]) > 2.0 * slow)


@kernel
def _off_balance(gait: Gait, observation: Any) -> bool:
    """Return whether the capture point (Pratt et al. 2006) leaves the middle of the feet."""
    dx, dy = observation.com[0], observation.com[1]
    for leg in range(4):
        dx -= 0.25 * observation.foot[leg, 0]
        dy -= 0.25 * observation.foot[leg, 1]
    dx += gait.capture_time * observation.com_velocity[0]
    dy += gait.capture_time * observation.com_velocity[1]
    c, s = cos(observation.angles[2]), sin(observation.angles[2])
    return bool(
        abs(c * dx + s * dy) > gait.balance_forward
        or abs(c * dy - s * dx) > gait.balance_sideways
        or abs(observation.angles[0]) > gait.balance_tilt
        or abs(observation.angles[1]) > gait.balance_tilt
    )


@kernel
def _estimate_ground(geometry: Geometry, share: float, memory: Any) -> None:
    """Move height and slope by `share` towards the plane through the feet's last contacts."""
    z0, z1, z2, z3 = (
        memory.touch_down[0, 2],
        memory.touch_down[1, 2],
        memory.touch_down[2, 2],
        memory.touch_down[3, 2],
    )
    height = 0.25 * (z0 + z1 + z2 + z3) - geometry.foot_radius
    pitch = atan2(0.5 * (z2 + z3 - z0 - z1), 2.0 * geometry.hip_x)
    roll = atan2(0.5 * (z0 + z2 - z1 - z3), 2.0 * (geometry.hip_y + geometry.thigh_y))
    memory.ground_height += share * (height - memory.ground_height)
    memory.ground_pitch += share * (pitch - memory.ground_pitch)
    memory.ground_roll += share * (roll - memory.ground_roll)


@kernel
def _move_reference(gait: Gait, timestep: float, observation: Any, memory: Any) -> None:
    """Integrate the command to a pose near the body, which removes the steady velocity error."""
    yaw = observation.angles[2]
    reference = memory.reference
    if memory.walking:
        c, s = cos(yaw), sin(yaw)
        reference[0] += timestep * (c * memory.command[0] - s * memory.command[1])
        reference[1] += timestep * (s * memory.command[0] + c * memory.command[1])
        reference[2] += timestep * memory.command[2]
    dx, dy = reference[0] - observation.position[0], reference[1] - observation.position[1]
    distance = hypot(dx, dy)
    if distance > gait.position_leash:
        reference[0] = observation.position[0] + dx * gait.position_leash / distance
        reference[1] = observation.position[1] + dy * gait.position_leash / distance
    turn = reference[2] - yaw
    turn -= 2.0 * pi * floor((turn + pi) / (2.0 * pi))
    reference[2] = yaw + min(max(turn, -gait.yaw_leash), gait.yaw_leash)


@kernel
def _schedule_foot(gait: Gait, leg: int, touch: float, observation: Any, memory: Any) -> None:
    """Swing or stance by phase; diagonal pairs are half a cycle apart."""
    phase = memory.phase + (0.0 if leg == 0 or leg == 3 else 0.5)
    phase -= floor(phase)
    memory.leg_phase[leg] = phase
    swinging = memory.walking and phase >= gait.duty
    if swinging and not memory.swinging[leg]:
        memory.touching[leg] = 0
        for i in range(3):
            memory.lift_off[leg, i] = observation.foot[leg, i]
    memory.swinging[leg] = swinging
    if not swinging:
        if touch > gait.contact_force:
            memory.touching[leg] = 1
            _stand_here(leg, observation, memory)
    elif not memory.touching[leg] and touch > gait.early_contact_force:
        if phase - gait.duty > gait.early_contact_share * (1.0 - gait.duty):
            memory.touching[leg] = 1
            _stand_here(leg, observation, memory)


@kernel
def _stand_here(leg: int, observation: Any, memory: Any) -> None:
    for i in range(3):
        memory.touch_down[leg, i] = observation.foot[leg, i]


@kernel
def _place_foot(gait: Gait, geometry: Geometry, leg: int, observation: Any, memory: Any) -> None:
    """Set a swinging leg's foothold: under the hip, half a stance ahead (Raibert 1986, ch. 2).

    The hip's place at touch-down plus half the way of the coming stance at the commanded velocity
    (the symmetric gait), plus a share of the velocity error, which brakes what is too fast.
    """
    half_stance = 0.5 * gait.duty * gait.period
    remaining = (1.0 - memory.leg_phase[leg]) * gait.period
    yaw = observation.angles[2]
    c, s = cos(yaw), sin(yaw)
    vx = c * memory.command[0] - s * memory.command[1]
    vy = s * memory.command[0] + c * memory.command[1]
    # The yaw in mid-stance, taking half of the remaining turn from the measured rate.
    turn = 0.5 * remaining * (observation.angular_velocity[2] + memory.command[2])
    yaw_stance = yaw + turn + half_stance * memory.command[2]
    hip_x = geometry.hip_x if leg < 2 else -geometry.hip_x
    hip_y = geometry.hip_y + geometry.thigh_y
    hip_y = hip_y if leg % 2 == 0 else -hip_y
    ux, uy = observation.com_velocity[0], observation.com_velocity[1]
    dx = ux * remaining + cos(yaw_stance) * hip_x - sin(yaw_stance) * hip_y
    dy = uy * remaining + sin(yaw_stance) * hip_x + cos(yaw_stance) * hip_y
    dx += half_stance * vx + gait.raibert_gain * (ux - vx)
    dy += half_stance * vy + gait.raibert_gain * (uy - vy)
    memory.foothold[leg, 0] = observation.position[0] + dx
    memory.foothold[leg, 1] = observation.position[1] + dy
    slope = sin(memory.ground_roll) * (c * dy - s * dx) - sin(memory.ground_pitch) * (
        c * dx + s * dy
    )
    memory.foothold[leg, 2] = memory.ground_height + geometry.foot_radius + slope


@allocating
def follow(
    setpoint: Array,
    parameters: Any,
    qpos: Array,
    qvel: Array,
    touch: Array,
    observations: Any,
    memories: Any,
) -> bool:
    """Advance one tick toward a setpoint: observe the body, command a velocity, step the gait.

    One compiled call a tick: to call a kernel after a physics step takes longer than what it
    computes.

    Args:
        setpoint: (8,) row of the setpoint.
        parameters: (1,) record of the controller's parameters.
        qpos: (19,) free joint (position, quaternion wxyz), then 4 x (hip, thigh, calf).
        qvel: (18,) linear velocity in the world, angular velocity in the body, joint rates.
        touch: (4,) normal force on each foot, N.
        observations: (1,) this tick's `OBSERVATION` record; filled.
        memories: (1,) `MEMORY` record; advanced.

    Returns:
        Whether the setpoint was finite; nothing is advanced where it was not.
    """
    command = np.empty(3)
    observe(parameters, qpos, qvel, observations)
    tracking, standing_speed = parameters[0].tracking, parameters[0].gait.standing_speed
    observation, memory = observations[0], memories[0]
    if not velocity_command(tracking, standing_speed, setpoint, observation, memory, command):
        return False
    advance(parameters, command, touch, observations, memories)
    return True


@kernel
def velocity_command(
    tracking: Tracking,
    resting_speed: float,
    setpoint: Array,
    observation: Any,
    memory: Any,
    command: Array,
) -> bool:
    """Compute feed-forward velocity plus proportional feedback, within the gait's limits.

    A setpoint at rest counts as reached inside a small circle and as lost outside a larger one,
    so that the robot stands still there instead of stepping after millimetres.

    Args:
        tracking: Gains and limits.
        resting_speed: Speed below which a setpoint is at rest, m/s and rad/s.
        setpoint: (8,) row of the setpoint.
        observation: `OBSERVATION` record.
        memory: `MEMORY` record, whose `arrived` is updated.
        command: (3,) forward m/s, left m/s and yaw rate rad/s, in the base's yaw frame; written.

    Returns:
        Whether the setpoint is finite.
    """
    yaw = observation.angles[2]
    dx, dy = setpoint[0] - observation.position[0], setpoint[1] - observation.position[1]
    vx, vy, rate = setpoint[3], setpoint[4], setpoint[7]
    if not isfinite(setpoint[0] + setpoint[1] + vx + vy + setpoint[6] + rate):
        return False
    turn = setpoint[6] - yaw
    turn = atan2(sin(turn), cos(turn))
    moving = max(hypot(vx, vy), abs(rate)) > resting_speed
    memory.arrived = not moving and _has_arrived(tracking, memory.arrived, hypot(dx, dy), abs(turn))
    if memory.arrived:
        command[:] = 0.0
        return True
    vx += tracking.position_gain * dx
    vy += tracking.position_gain * dy
    rate += tracking.heading_gain * turn
    c, s = cos(yaw), sin(yaw)
    command[0] = min(max(c * vx + s * vy, tracking.forward_low), tracking.forward_high)
    command[1] = min(max(c * vy - s * vx, -tracking.lateral), tracking.lateral)
    command[2] = min(max(rate, -tracking.yaw_rate), tracking.yaw_rate)
    return True


@kernel
def _has_arrived(tracking: Tracking, arrived: bool, distance: float, angle: float) -> bool:
    if arrived:
        return distance < tracking.depart_distance and angle < tracking.depart_angle
    return distance < tracking.arrive_distance and angle < tracking.arrive_angle
