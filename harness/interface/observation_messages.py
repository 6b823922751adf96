"""Task and observations of the stack interface, to and from protobuf."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import SweepInput
from wayproof.harness.interface.message_values import (
    triple,
    values_for,
    values_of,
    vector_message,
)
from wayproof.harness.interface.types import (
    INTERFACE_VERSION,
    Fate,
    Observation,
    Reference,
    Sensor,
    Task,
)
from wayproof.harness.mission import Mission
from wayproof.harness.prior.cells import PriorCells
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.columns import Window
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL
from wayproof.maps.sweep import Ranges
from wayproof.models.poses import Trail
from wayproof.models.sensors.beams import DROPPED, NO_RETURN


def hello(name: str, *, announced: bool = False, role: str = "") -> sb.Hello:
    """Return the first message of each side.

    Args:
        name: Name of who says it.
        announced: Whether a stack wishes an empty message before each observation.
        role: `predictor` between the harness and one; empty of a stack.
    """
    return sb.Hello(version=INTERFACE_VERSION, name=name, announced=announced, role=role)


def task_message(task: Task) -> sb.Task:
    """Encode the task for another process."""
    discs = [sb.Disc(offset=offset, radius=radius) for offset, radius in task.mission.discs]
    values = values_for(sb.Task, task.mission) | values_for(sb.Task, task)
    message = sb.Task(**values, discs=discs)
    for sensor in task.sensors.values():
        message.sensors.add(
            **values_for(sb.Sensor, sensor.info),
            directions=b"" if _varies(sensor) else _directions(sensor, 0),
            info=sensor.info.SerializeToString(deterministic=True),
        )
    if task.prior is not None:
        message.prior.CopyFrom(_prior_message(task.prior))
    return message


def _prior_message(cells: PriorCells) -> sb.PriorMap:
    return sb.PriorMap(
        resolution=cells.resolution,
        origin=vector_message(cells.window.origin),
        shape=cells.states.shape,
        states=cells.states.tobytes(),
    )


def task_from(message: sb.Task) -> Task:
    """Decode the task, in another process."""
    discs = tuple((disc.offset, disc.radius) for disc in message.discs)
    sensors = [Sensor(pb.SensorInfo.FromString(sensor.info)) for sensor in message.sensors]
    return Task(
        **values_of(message, Task),
        mission=Mission(**values_of(message, Mission), discs=discs),
        sensors={sensor.info.name: sensor for sensor in sensors},
        prior=_prior_from(message.prior) if message.HasField("prior") else None,
    )


def _prior_from(message: sb.PriorMap) -> PriorCells:
    window = window_at(message.resolution, message.origin, message.shape)
    states = np.frombuffer(message.states, np.uint8).reshape(window.shape)
    return PriorCells(window.resolution, window.first, states)


def window_at(resolution: float, origin: sb.Vector, shape: Sequence[int]) -> Window:
    """Return the cells of a box by its least corner, m, and its size."""
    shift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])
    corner = np.rint(np.array([origin.x, origin.y, origin.z]) / resolution + shift)
    x, y, z = corner.astype(np.int64).tolist()
    nx, ny, nz = shape
    return Window(resolution, (x, y, z), (nx, ny, nz))


def observation_message(observation: Observation, task: Task) -> sb.Observation:
    """Encode an observation for another process."""
    reference, last, trail = observation.reference, observation.last, observation.trail
    message = sb.Observation(
        **values_for(sb.Observation, observation),
        reference_position=vector_message(reference.position),
        reference_velocity=vector_message(reference.velocity),
        reference_heading=reference.heading,
        reference_yaw_rate=reference.yaw_rate,
        at_rest=reference.at_rest,
    )
    if last is not None:
        message.last.CopyFrom(sb.Fate(**values_for(sb.Fate, last)))
    if trail is not None:
        message.trail_positions.extend(trail.positions.ravel().tolist())
        message.trail_quaternions.extend(trail.quaternions.ravel().tolist())
        message.trail_period_s = trail.period
    for sweep in observation.sweeps:
        sensor = task.sensors[sweep.sensor]
        message.sweeps.add(
            sensor=sweep.sensor,
            ranges_mm=_in_16_bits(sweep.ranges_mm).tobytes(),
            classes=b"" if sweep.classes is None else sweep.classes.tobytes(),
            directions=(
                _directions(sensor, observation.sequence - sweep.lag) if _varies(sensor) else b""
            ),
            age_ns=sweep.age_ns,
            lag=sweep.lag,
        )
    return message


def _in_16_bits(ranges_mm: Ranges) -> NDArray[np.uint16]:  # (n,)
    """Return ranges (n,) as the interface has them; a longer one carries no information."""
    if ranges_mm.dtype == np.uint16:
        return ranges_mm.astype("<u2", copy=False)
    return np.where(ranges_mm > NO_RETURN, DROPPED, ranges_mm).astype("<u2")


def sweep_inputs(message: sb.Observation) -> list[SweepInput]:
    """Decode the sweeps of an observation, in another process."""
    return [
        SweepInput(
            sweep.sensor,
            np.frombuffer(sweep.ranges_mm, "<u2").astype(np.uint16, copy=False),
            np.frombuffer(sweep.classes, np.uint8) if sweep.classes else None,
            age_ns=sweep.age_ns,
            lag=sweep.lag,
        )
        for sweep in message.sweeps
    ]


def trail_from(message: sb.Observation) -> Trail | None:
    """Return estimated poses while the sweeps were taken, in another process."""
    if not message.trail_period_s:
        return None
    return Trail(
        np.array(message.trail_positions).reshape(-1, 3),
        np.array(message.trail_quaternions).reshape(-1, 4),
        message.trail_period_s,
    )


def reference_from(message: sb.Observation) -> Reference:
    """Decode the commanded state at the time of effect, in another process."""
    return Reference(
        np.array(triple(message.reference_position)),
        velocity=np.array(triple(message.reference_velocity)),
        heading=message.reference_heading,
        yaw_rate=message.reference_yaw_rate,
        at_rest=message.at_rest,
    )


def fate_from(message: sb.Observation) -> Fate | None:
    """Decode the fate of the previous command, in another process."""
    if not message.HasField("last"):
        return None
    return Fate(**values_of(message.last, Fate))


def _varies(sensor: Sensor) -> bool:
    """Return whether the beams differ from sweep to sweep."""
    return sensor.beams.table.order == "pairs"


def _directions(sensor: Sensor, sequence: int) -> bytes:
    return sensor.directions(sequence).astype("<f4").tobytes()
