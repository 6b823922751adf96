"""The stack interface: the task, each observation, and the command that answers it.

A stack is a class with three methods:

    class MyStack:
        def start(self, task: Task) -> None: ...
        def step(self, observation: Observation) -> Command: ...
        def close(self) -> None: ...

An observation holds what a robot would know, never the truth. SI units, world frame z up,
quaternions w x y z, integer nanoseconds of simulated time. In another process the same content goes
over `harness/schema/stack.proto`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Beams, WorldSweep
from wayproof.harness.mission import Mission
from wayproof.harness.prior.cells import PriorCells
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.sweep import Ranges
from wayproof.models.poses import Trail, rotation_matrices
from wayproof.models.sensors.beams import DROPPED, NO_RETURN, directions
from wayproof.planners import Trajectory

Array = NDArray[np.float64]

INTERFACE_VERSION = 1
"""Version of the stack interface; a stack of another version is refused at the start."""

Verdict = Literal["admitted", "stale", "unknown", "blocked"]
"""The referee's verdict on the space that a command can sweep before the body is at rest."""


@dataclass(frozen=True)
class Sensor:
    """One sensor of the robot.

    Attributes:
        info: Its name, kind, range, rate, beam tables and mounting, as they are logged.
    """

    info: pb.SensorInfo

    @cached_property
    def beams(self) -> Beams:
        """Its beam geometry."""
        return beams_from_info(self.info)

    def directions(self, sequence: int = 0) -> Array:
        """Return unit vectors (n, 3) of the beams of one sweep, in the sensor's frame.

        Args:
            sequence: Number of the sweep; of a grid all sweeps have the same.
        """
        return directions(self.beams.table, sequence)

    @property
    def T_base_sensor(self) -> Array:
        """Mounting, (4, 4), m."""
        T = np.eye(4)
        T[:3, :3] = np.array(self.info.rotation_base_sensor).reshape(3, 3)
        T[:3, 3] = self.info.position_base_sensor
        return T


@dataclass(frozen=True)
class Task:
    """All that a stack gets before its first observation.

    Attributes:
        robot: Name of the robot.
        seed: Seed for the stack's own random numbers, which is not that of the world.
        mission: Body, motion limits, operating area, start and goals; `Observation.goal` is the one
            to go to now.
        goal_tolerance: Distance from a goal within which the base has to come to rest, m.
        period_s: Time from one observation to the next, s.
        delay_s: Time from an observation to the effect of its command, s.
        deadline_s: A command with a longer delay is discarded, s.
        sensors: Sensors by name.
        settings: Settings of sensors, map, costmap, planner, motion and latency, JSON: nothing of
            the world.
        prior: A prior map as the settings place it; none without one, and where it is ignored.
    """

    robot: str
    seed: int
    mission: Mission
    goal_tolerance: float
    period_s: float
    delay_s: float
    deadline_s: float
    sensors: Mapping[str, Sensor]
    settings: str
    prior: PriorCells | None = None


@dataclass(frozen=True)
class Sweep:
    """One sweep of a sensor.

    Attributes:
        sensor: Its name.
        ranges_mm: (n,) mm, uint16, or uint32 where one is longer than 65.534 m, as measured: along
            the beam, or of a depth camera along its axis; 0: dropped, 65535: no return within
            range.
        classes: (n,) uint8, of what each beam met, where `sensors.semantics` is set; else none.
        place: Beams in the world frame by the estimated pose, computed when called.
        age_ns: Time since it was taken, by its own stamp, ns; 0 of one of this instant.
        lag: Number of sweeps since it was taken, which the pattern of its beams goes by.
    """

    sensor: str
    ranges_mm: Ranges
    classes: NDArray[np.uint8] | None
    place: Callable[[], WorldSweep]
    age_ns: int = 0
    lag: int = 0

    @property
    def ranges_m(self) -> Array:
        """(n,) ranges as measured, m; NaN where dropped, infinity where nothing returned."""
        ranges: Array = self.ranges_mm.astype(np.float64) * 1e-3
        ranges[self.ranges_mm == DROPPED] = np.nan
        ranges[self.ranges_mm == NO_RETURN] = np.inf
        return ranges

    @cached_property
    def placed(self) -> WorldSweep:
        """Origins, directions and ranges along the beams, world frame."""
        return self.place()

    @cached_property
    def points(self) -> Array:
        """(k, 3) the returns, world frame, m."""
        return self.placed.points


@dataclass(frozen=True)
class Reference:
    """The commanded state of the robot at the time when a command takes effect; world frame.

    Attributes:
        position: (3,) m.
        velocity: (3,) m/s.
        heading: rad, without jumps by full turns.
        yaw_rate: rad/s.
        at_rest: Whether the robot has come to rest by then.
    """

    position: Array
    velocity: Array
    heading: float
    yaw_rate: float
    at_rest: bool


@dataclass(frozen=True)
class Fate:
    """Fate of the previous command.

    Attributes:
        sequence: Number of its observation.
        fate: `followed`; `late`: discarded, as it came past the deadline; or `cut`: the guard
            braked in its place.
        verdict: The referee's.
    """

    sequence: int
    fate: Literal["followed", "late", "cut"]
    verdict: Verdict


@dataclass(frozen=True)
class Observation:
    """Knowledge of the robot at one instant; its arrays are read-only copies.

    Attributes:
        time_ns: Time of the sweeps, ns.
        sequence: Number of the observation, from 0.
        position: (3,) estimated position of the base, m.
        quaternion: (4,) estimated orientation T_world_base.
        position_sigma: Standard deviation of the position along its worst axis, m.
        heading_sigma: Standard deviation of the heading, rad.
        velocity: (3,) estimated from the last two poses, world frame, m/s.
        yaw_rate: Estimated likewise, rad/s.
        sweeps: Sweeps in the order of the sensors; a sensor that was too slow has none.
        effect_ns: Time when the command takes effect, ns.
        reference: Commanded state at that time; a trajectory has to start there.
        goal: (3,) where to go now, base origin, m; of a mission with several goals it changes when
            one was reached.
        last: Fate of the previous command; None at the first.
        trail: Estimated poses while the sweeps were taken, for a rolling shutter; else none.
        covariance: (4, 4) stated covariance of x, y, z, m, and heading, rad, in the world frame;
            none if the estimator states standard deviations alone.
        unheld: (k, 3) unit directions along which the sweeps do not hold the position.
        goals_reached: Number of the mission's goals that were reached before.
        pose_age_ns: Time since the pose was estimated, by its own stamp, ns; 0 of one of now.
    """

    time_ns: int
    sequence: int
    position: Array
    quaternion: Array
    position_sigma: float
    heading_sigma: float
    velocity: Array
    yaw_rate: float
    sweeps: tuple[Sweep, ...]
    effect_ns: int
    reference: Reference
    goal: Array
    last: Fate | None = None
    trail: Trail | None = None
    covariance: Array | None = None
    unheld: Array = field(default_factory=lambda: np.zeros((0, 3)))
    goals_reached: int = 0
    pose_age_ns: int = 0

    @property
    def rotation(self) -> Array:
        """R_world_base, (3, 3)."""
        R_world_base: Array = rotation_matrices(self.quaternion[None])[0]
        return R_world_base


@dataclass(frozen=True)
class Velocity:
    """A velocity in the body's frame, held for a time; then the body brakes to rest.

    Attributes:
        forward: m/s.
        left: m/s.
        up: m/s; ignored by robots that walk.
        yaw_rate: rad/s, counter-clockwise.
        duration_s: Time for which it holds, s, at most 10.
    """

    forward: float
    left: float = 0.0
    up: float = 0.0
    yaw_rate: float = 0.0
    duration_s: float = 0.5


@dataclass(frozen=True)
class Waypoints:
    """Points to pass through in straight lines, coming to rest at the last one.

    Attributes:
        points: (k, 3) world frame, m; the path to them begins at the reference.
        speed: Speed limit, m/s; 0: the body's own.
    """

    points: Array
    speed: float = 0.0


@dataclass(frozen=True)
class Samples:
    """A trajectory sampled from the time of effect on; at rest from its last sample on.

    Attributes:
        period_s: Time between two samples, s.
        positions: (k, 3) world frame, m; the first one is the reference.
        headings: (k,) rad.
    """

    period_s: float
    positions: Array
    headings: Array


Motion = Trajectory | Samples | Velocity | Waypoints


@dataclass(frozen=True)
class Grid:
    """A stack's own costmap, as ROS's OccupancyGrid has it.

    Attributes:
        origin: (2,) corner of cell (0, 0), m, world.
        resolution: Edge of a cell, m.
        cells: (ny, nx) int8 cost of each cell, 0 to 100; -1: unknown.
    """

    origin: Array
    resolution: float
    cells: NDArray[np.int8]


@dataclass(frozen=True)
class Command:
    """The answer of a stack to one observation.

    Attributes:
        motion: Motion that the body is to follow; None: it follows the present one to its rest.
        action: `follow`, `slow`, `stop_and_wait`, `explore`, `recover`, `goal` or `abort`; empty:
            `follow` if the motion leads anywhere, else `stop_and_wait`. `goal` ends the
            episode once the body rests, `abort` at once.
        label: Failure label, as in the decisions of the log; empty: `none`.
        reason: One line for the log.
        planned_path: (k, 3) the stack's own plan, for the log.
        map_version: Version of the stack's own map, for the log.
        scalars: A few named numbers, for the log.
        costmap: The stack's own costmap, for the log.
    """

    motion: Motion | None = None
    action: str = ""
    label: str = ""
    reason: str = ""
    planned_path: Array | None = None
    map_version: str = ""
    scalars: Mapping[str, float] = field(default_factory=dict)
    costmap: Grid | None = None


class Stack(Protocol):
    """A navigation stack on trial."""

    def start(self, task: Task) -> None:
        """Get ready for one mission."""

    def step(self, observation: Observation) -> Command:
        """Answer one observation."""

    def close(self) -> None:
        """End; nothing is called after this."""
