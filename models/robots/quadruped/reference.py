"""What the prediction needs to know of the future: reference, contacts and lever arms."""

from __future__ import annotations

from math import cos, floor, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import Gait, Geometry, Prediction


@kernel
def look_ahead(
    gaits: Any,
    prediction: Prediction,
    geometries: Any,
    observations: Any,
    memories: Any,
    state: Array,
    reference: Array,
    contact: NDArray[np.bool_],
    lever: Array,
) -> None:
    """Fill the inputs of the predictive controller over its horizon of n steps.

    Args:
        gaits: (1,) trot parameters, packed.
        prediction: Horizon.
        geometries: (1,) leg geometry, packed.
        observations: (1,) this tick's `OBSERVATION` record.
        memories: (1,) `MEMORY` record.
        state: (12,) now: roll, pitch, yaw, centre of mass, angular velocity, velocity.
        reference: (n, 12) the same at the end of each step.
        contact: (n, 4) whether the foot stands during the step.
        lever: (n, 4, 3) from the centre of mass to the foot at the start of the step, world, m.
    """
    gait, geometry, observation, memory = gaits[0], geometries[0], observations[0], memories[0]
    for i in range(3):
        state[i] = observation.angles[i]
        state[3 + i] = observation.com[i]
        state[6 + i] = observation.angular_velocity[i]
        state[9 + i] = observation.com_velocity[i]
    _reference(gait, prediction.step_time, observation, memory, reference)
    for step in range(prediction.steps):
        time = step * prediction.step_time
        for leg in range(4):
            phase = memory.leg_phase[leg] + time / gait.period
            stands = phase - floor(phase) < gait.duty or not memory.walking
            contact[step, leg] = stands
            if memory.touching[leg] == 1:
                contact[step, leg] |= step == 0
            elif memory.leg_phase[leg] * gait.period > prediction.late_contact:
                contact[step, leg] &= step > 0 or memory.swinging[leg] == 1
            _foot_then(gait, geometry, leg, time, observation, memory, lever[step, leg])
            for i in range(2):
                lever[step, leg, i] -= observation.com[i] + time * observation.com_velocity[i]
            lever[step, leg, 2] -= observation.com[2]


@kernel
def _reference(
    gait: Gait, step_time: float, observation: Any, memory: Any, reference: Array
) -> None:
    """Carry the reference pose on along the commanded arc, level with the ground."""
    forward, left, rate = memory.command[0], memory.command[1], memory.command[2]
    x = memory.reference[0] + observation.lever[0]
    y = memory.reference[1] + observation.lever[1]
    reference[:] = 0.0
    for step in range(len(reference)):
        middle = memory.reference[2] + (step + 0.5) * step_time * rate
        end = memory.reference[2] + (step + 1.0) * step_time * rate
        x += step_time * (cos(middle) * forward - sin(middle) * left)
        y += step_time * (sin(middle) * forward + cos(middle) * left)
        reference[step, 0] = memory.ground_roll
        reference[step, 1] = memory.ground_pitch
        reference[step, 2] = end
        reference[step, 3] = x
        reference[step, 4] = y
        reference[step, 5] = memory.ground_height + gait.height + observation.lever[2]
        reference[step, 8] = rate
        reference[step, 9] = cos(end) * forward - sin(end) * left
        reference[step, 10] = sin(end) * forward + cos(end) * left


@kernel
def _foot_then(
    gait: Gait,
    geometry: Geometry,
    leg: int,
    time: float,
    observation: Any,
    memory: Any,
    foot: Array,
) -> None:
    """Where the foot stands `time` from now: here, on its foothold, or under the hip by then."""
    phase = memory.leg_phase[leg] + time / gait.period
    stance_over = 2.0 if memory.swinging[leg] else 1.0
    if memory.walking and phase >= stance_over:
        middle = time + (0.5 * gait.duty - (phase - floor(phase))) * gait.period
        _foot_under_hip(geometry, leg, middle, observation, memory, foot)
    elif memory.swinging[leg] and not memory.touching[leg]:
        foot[:] = memory.foothold[leg]
    else:
        foot[:] = observation.foot[leg]


@kernel
def _foot_under_hip(
    geometry: Geometry, leg: int, time: float, observation: Any, memory: Any, foot: Array
) -> None:
    yaw = observation.angles[2] + time * memory.command[2]
    x = geometry.hip_x if leg < 2 else -geometry.hip_x
    y = geometry.hip_y + geometry.thigh_y
    y = y if leg % 2 == 0 else -y
    vx, vy = observation.com_velocity[0], observation.com_velocity[1]
    foot[0] = observation.position[0] + time * vx + cos(yaw) * x - sin(yaw) * y
    foot[1] = observation.position[1] + time * vy + sin(yaw) * x + cos(yaw) * y
    foot[2] = memory.ground_height + geometry.foot_radius
