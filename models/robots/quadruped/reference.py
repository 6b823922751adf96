"""Prediction horizon: reference states, contacts and lever arms."""

from __future__ import annotations

from math import cos, floor, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import Gait, Geometry


class Horizon(NamedTuple):
    """Inputs of the predictive controller over n steps.

    Attributes:
        state: (12,) now: roll, pitch, yaw, centre of mass, angular velocity, velocity; world, SI.
        reference: (n, 12) the same at the end of each step.
        contact: (n, 4) whether the foot stands during the step.
        lever: (n, 4, 3) from the centre of mass to the foot at the start of the step, world, m.
    """

    state: Array
    reference: Array
    contact: NDArray[np.bool_]
    lever: Array

    @classmethod
    def zeros(cls, steps: int) -> Horizon:
        """Return a horizon of `steps` steps, to be filled."""
        contact = np.zeros((steps, 4), np.bool_)
        return cls(np.zeros(12), np.zeros((steps, 12)), contact, np.zeros((steps, 4, 3)))


@kernel
def predict_horizon(parameters: Any, observations: Any, memories: Any, horizon: Horizon) -> None:
    """Fill the inputs of the predictive controller.

    Args:
        parameters: (1,) record of the controller's parameters.
        observations: (1,) this tick's `OBSERVATION` record.
        memories: (1,) `MEMORY` record.
        horizon: Is written.
    """
    gait, geometry = parameters[0].gait, parameters[0].geometry
    prediction = parameters[0].prediction
    observation, memory = observations[0], memories[0]
    state, reference, contact, lever = horizon
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
            _predict_foot(gait, geometry, leg, time, observation, memory, lever[step, leg])
            for i in range(2):
                lever[step, leg, i] -= observation.com[i] + time * observation.com_velocity[i]
            lever[step, leg, 2] -= observation.com[2]


@kernel
def _reference(
    gait: Gait, step_time: float, observation: Any, memory: Any, reference: Array
) -> None:
    """Extend the reference pose along the commanded arc, level with the ground."""
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


@allocating
def _predict_foot(
    gait: Gait,
    geometry: Geometry,
    leg: int,
    time: float,
    observation: Any,
    memory: Any,
    foot: Array,
) -> None:
    """Write where the foot stands in `time` s: here, on its foothold, or under the hip by then."""
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
