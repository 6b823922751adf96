"""A stack in a process of its own that needs no Wayproof: numpy, protobuf and one generated file.

Generate `stack_pb2.py` beside this file from the schema, with grpcio-tools or protoc:

    python -m grpc_tools.protoc -Iharness/schema --python_out=examples/python stack.proto

Then put it on trial:

    wayproof run empty --robot drone --seed 1 --stack 'exec:python examples/python/client.py'

`serve` answers the harness in lockstep. Start from `Careful`: replace its `step`.
"""

import math
import os
import struct
import sys
import traceback

import numpy as np
import stack_pb2 as sb

VERSION = 1
"""Version of the stack interface."""

DROPPED, NO_RETURN = 0, 65535
"""Ranges of a beam that was lost, and of one that met nothing within range."""

AHEAD_S = 2.0
"""Time in which the room ahead would be driven; it sets the speed, s."""

MARGIN_M = 0.2
"""Distance kept to returns beyond the body's radius, m."""


class Careful:
    """Drives straight at the goal, slowly where something is near ahead, and stops before it."""

    def start(self, task):
        """Keep the task."""
        self.task = task

    def step(self, observation):
        """Answer an observation (`sb.Observation`) with a command (`sb.Command`)."""
        task, at, goal = self.task, observation.reference_position, observation.goal
        dx, dy, dz = goal.x - at.x, goal.y - at.y, goal.z - at.z
        away = math.hypot(dx, dy)
        error = math.remainder(math.atan2(dy, dx) - observation.reference_heading, 2.0 * math.pi)
        room = self.room(observation)
        speed = max(0.0, min(task.max_speed, away, room / AHEAD_S))
        if abs(error) > 0.5 or away < 0.5 * task.goal_tolerance:
            speed = 0.0
        command = sb.Command(reason="drive at the goal" if speed > 0.0 else "stand")
        command.velocity.forward = speed
        command.velocity.up = max(-0.5, min(0.5, dz)) if task.motion == "air" else 0.0
        if away >= 0.5 * task.goal_tolerance:
            command.velocity.yaw_rate = max(-task.max_yaw_rate, min(task.max_yaw_rate, 2.0 * error))
        command.velocity.duration_s = 0.5
        command.scalars["room_m"] = room
        return command

    def close(self):
        """Nothing to end."""

    def room(self, observation):
        """Distance that the body's disc can move straight ahead before it touches a return, m."""
        task, at = self.task, observation.reference_position
        cosine = math.cos(observation.reference_heading)
        sine = math.sin(observation.reference_heading)
        points = returns(task, observation)
        low, high = observation.position.z - 0.5 * task.height, observation.position.z + 0.3
        if task.motion == "ground":
            low = task.step_height
        points = points[(points[:, 2] > low) & (points[:, 2] < high)]
        x, y = points[:, 0] - at.x, points[:, 1] - at.y
        along, across = cosine * x + sine * y, cosine * y - sine * x
        width = task.radius + MARGIN_M
        ahead = (along > 0.0) & (np.abs(across) < width)
        touch = along[ahead] - np.sqrt(width**2 - across[ahead] ** 2)
        return float(max(touch.min(initial=10.0), 0.0))


def returns(task, observation):
    """The returns of all sweeps, (n, 3) world frame, m, as if each sweep were of one instant."""
    position = np.array([observation.position.x, observation.position.y, observation.position.z])
    R_world_base = rotation(observation.quaternion)
    points = [np.zeros((0, 3))]
    for sweep in observation.sweeps:
        sensor = next(one for one in task.sensors if one.name == sweep.sensor)
        beams = np.frombuffer(sweep.directions or sensor.directions, "<f4").reshape(-1, 3)
        ranges = np.frombuffer(sweep.ranges_mm, "<u2")
        returned = (ranges != DROPPED) & (ranges != NO_RETURN)
        beams, ranges_m = beams[returned].astype(float), 1e-3 * ranges[returned]
        if sensor.measures == "depth":
            ranges_m = ranges_m / beams[:, 0]
        R_base_sensor = np.array(sensor.rotation_base_sensor).reshape(3, 3)
        in_base = turned(R_base_sensor, ranges_m[:, None] * beams) + sensor.position_base_sensor
        points.append(turned(R_world_base, in_base) + position)
    return np.vstack(points)


def turned(R, vectors):
    """Vectors (n, 3) turned by a rotation, summed in one order: a repeat has the same bits."""
    return vectors[:, :1] * R[:, 0] + vectors[:, 1:2] * R[:, 1] + vectors[:, 2:] * R[:, 2]


def rotation(quaternion):
    """Rotation matrix (3, 3) of a unit quaternion w x y z."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def serve(stack, name):
    """Answer the harness on standard input and output until it closes them; return an exit code.

    What the stack itself prints goes to standard error. What it raises ends the episode.
    """
    read, write = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    try:
        while (message := receive(read)) is not None:
            kind = message.WhichOneof("kind")
            if kind == "hello":
                send(write, sb.FromStack(hello=sb.Hello(version=VERSION, name=name)))
            elif kind == "task":
                stack.start(message.task)
            elif kind == "observation":
                command = stack.step(message.observation)
                command.sequence = message.observation.sequence
                send(write, sb.FromStack(command=command))
            elif kind == "close":
                break
    except BrokenPipeError:
        os._exit(0)  # the harness is gone: nothing is left to flush
    except Exception as error:
        traceback.print_exc()
        text = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        failure = sb.Failure(text=text, traceback=traceback.format_exc()[-16_000:])
        send(write, sb.FromStack(failure=failure))
        return 1
    stack.close()
    return 0


def receive(read):
    """The next message; None at the end."""
    head = read.read(4)
    if len(head) < 4:
        return None
    (length,) = struct.unpack("<I", head)
    data = read.read(length)
    return sb.ToStack.FromString(data) if len(data) == length else None


def send(write, message):
    """Send one message."""
    data = message.SerializeToString()
    write.write(struct.pack("<I", len(data)) + data)
    write.flush()


if __name__ == "__main__":
    sys.exit(serve(Careful(), "careful 1.0"))
