"""Base of all perturbations: one geometric assumption of the stack made wrong by a stated amount.

A perturbation acts between the simulator and the stack: on the error of the pose, on what a sensor
reports or where it truly sits, on whether a sweep arrives, or on a decision's delay; `motion` and
`slip` act on the world, `stale_prior` on the prior map. Its random numbers have streams of their
own, so that no sensor's noise is shifted by it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import unknown_name
from wayproof.harness.perturbations.displacement import Displacement
from wayproof.harness.perturbations.inertial_bias import InertialBias
from wayproof.models.pose_model import PoseError
from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import DROPPED, NO_RETURN, BeamTable, directions

if TYPE_CHECKING:
    from wayproof.models.worlds import World  # it loads the simulator

Array = NDArray[np.float64]
Ranges = NDArray[np.uint16] | NDArray[np.uint32]
Severity = Annotated[float, msgspec.Meta(gt=0.0, le=5.0)]

MAX_SEVERITY = 5.0
"""Severity at which the scale ends."""

MOST_LAG = 20
"""Greatest number of messages by which one is late."""

Lag = int | Literal["none", "last"]
"""Message that comes in place of one that was sent: the one so many before it, up to `MOST_LAG`,
none, or again the last one that came."""

Changes = Literal[
    "nothing",
    "pose",
    "motion_sensors",
    "ranges",
    "arrivals",
    "pose_arrivals",
    "delay",
    "world",
    "prior",
]
"""Input that a perturbation changes: the estimated pose, the sensors of motion that a pose is
estimated by, the ranges of sweeps, which sweeps or poses arrive, the delay of decisions, the
simulated world, or the prior map."""

LATE: tuple[Changes, ...] = ("arrivals", "pose_arrivals")
"""What perturbations change whose messages come late, again or never."""

UNCHANGED = PoseError()


class Misplacement(NamedTuple):
    """Error of the place of a prior map.

    Attributes:
        x: m.
        y: m.
        turn: About the start, rad.
    """

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0


class Arrival(NamedTuple):
    """One message that is sent to the stack.

    Attributes:
        stream: Name of its sensor, or `pose`.
        number: Number of the decision.
        time_ns: Simulated time, ns.
        period_ns: Time between two messages of the stream, ns.
        seed: Seed of the episode.
    """

    stream: str
    number: int
    time_ns: int
    period_ns: int
    seed: int


class RangeLimits(Protocol):
    """Range limits of a device or of a recorded sensor."""

    @property
    def range(self) -> float:
        """Longest measured distance, m."""

    @property
    def minimum_range(self) -> float:
        """Distance below which a surface gives no information, m."""

    @property
    def no_return_is_free(self) -> bool:
        """Whether a beam without echo is evidence of free space up to the range."""


class ListedDirections(NamedTuple):
    """Directions of a sweep that lists its beams.

    Attributes:
        of_sweep: (n, 3) unit, sensor frame.
        of_first: (m, 3) those of the sensor's first sweep.
    """

    of_sweep: Array
    of_first: Array


@dataclass(frozen=True)
class Report:
    """One sweep as its device reports it, before the stack sees it.

    Attributes:
        sensor: Name of the sensor.
        device: Its device.
        table: Directions of its beams.
        ranges_mm: (n,) as reported, mm.
        seed: Seed of the episode.
        sequence: Number of the sweep.
        listed: Directions of a sweep that lists them; else those of the table.
    """

    sensor: str
    device: RangeLimits
    table: BeamTable
    ranges_mm: Ranges
    seed: int
    sequence: int
    listed: ListedDirections | None = None

    @property
    def image_shape(self) -> tuple[int, int]:
        """Rows and columns of the sweep as an image; one row where it has none."""
        rows = 1 if self.listed is not None else self.table.image_rows
        return rows, len(self.ranges_mm) // rows

    @property
    def directions(self) -> Array:  # (n, 3)
        """Unit directions of the beams, sensor frame."""
        if self.listed is not None:
            return self.listed.of_sweep
        return directions(self.table, self.sequence)

    @property
    def first_directions(self) -> Array:  # (m, 3)
        """Those of the sensor's first sweep."""
        return self.listed.of_first if self.listed is not None else directions(self.table, 0)

    @property
    def echoes(self) -> NDArray[np.bool_]:  # (n,)
        """Mask of the beams that report a distance."""
        heard: NDArray[np.bool_] = (self.ranges_mm != DROPPED) & (self.ranges_mm != NO_RETURN)
        return heard

    @property
    def silence(self) -> np.uint16:
        """Range of a lost echo: no return where the device reads that as free, else dropped."""
        return NO_RETURN if self.device.no_return_is_free else DROPPED

    def rng(self) -> np.random.Generator:
        """Return a generator for this sweep, of a stream of its own."""
        return stream(self.seed, f"perturbation/{self.sensor}", self.sequence)


class Perturbation(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind"):
    """One assumption off, or, as this base class, none.

    Attributes:
        severity: Above 0, up to 5; the amount is interpolated between whole severities.
        window: Active from the first of these times until before the second, s; always if none.
        changes: Input that it changes.
        measured_in: Unit of the values.
        values: Amounts at severities 1 to 5, with their sources in docs/perturbations.md.
        nothing: Amount at severity 0, which changes nothing.
        windowed: Whether it can act for a part of an episode.
        restamps: Whether a message that comes late or again has the stamp of a new one.
    """

    severity: Severity = 3
    window: tuple[float, float] | None = None
    changes: ClassVar[Changes] = "nothing"
    measured_in: ClassVar[str] = ""
    values: ClassVar[tuple[float, float, float, float, float]] = (0.0, 0.0, 0.0, 0.0, 0.0)
    nothing: ClassVar[float] = 0.0
    windowed: ClassVar[bool] = True
    restamps: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Write a whole severity as one number alone, and check the window."""
        if float(self.severity).is_integer():
            msgspec.structs.force_setattr(self, "severity", int(self.severity))
        if self.window is not None and not 0.0 <= self.window[0] < self.window[1] < math.inf:
            raise ValueError(f"window: got {self.window}, expected 0 <= begin < end, in s")
        if self.window is not None and not self.windowed:
            raise ValueError(f"window: got {self.window}, expected none for '{self.kind}'")

    @property
    def kind(self) -> str:
        """Its name in the registry."""
        return str(self.__struct_config__.tag)

    @property
    def unit(self) -> str:
        """Unit of the amount."""
        return self.measured_in

    @property
    def amount(self) -> float:
        """Size of the perturbation, in `unit`: linear from one whole severity to the next."""
        scale = (self.nothing, *self.values)
        below = math.floor(self.severity)
        share = self.severity - below
        if share == 0.0:
            return scale[below]
        return scale[below] + share * (scale[below + 1] - scale[below])

    def is_active(self, time_ns: int) -> bool:
        """Return whether it acts at a simulated time."""
        if self.window is None:
            return True
        return self.window[0] <= time_ns * 1e-9 < self.window[1]

    def change_world(self, world: World, seed: int) -> World:
        """Return the perturbed world of the episode.

        Raises:
            ValueError: The world cannot be changed so.
        """
        del seed
        return world

    def change_prior(self, world: World, seed: int) -> World:
        """Return the world as a prior map of it shows it.

        Raises:
            ValueError: The world cannot be changed so.
        """
        del seed
        return world

    def misplacement(self, seed: int) -> Misplacement:
        """Return the error of the place of the prior map."""
        del seed
        return Misplacement()

    def affected(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the sensors whose sweeps it changes, in the order given: all, or none.

        Raises:
            InputError: It names a sensor that there is not.
        """
        if self.changes not in ("ranges", "arrivals"):
            return ()
        return self.named(getattr(self, "sensor", ""), sensors)

    def named(self, sensor: str, sensors: Sequence[str], *others: str) -> tuple[str, ...]:
        """Return the one named of some sensors, all if the name is empty.

        Raises:
            InputError: It is none of them, nor of the other names that it may have.
        """
        if sensor and sensor not in sensors:
            raise unknown_name(f"sensor of --perturb {self.kind}", sensor, [*sensors, *others])
        return (sensor,) if sensor else tuple(sensors)

    @property
    def delays_pose(self) -> bool:
        """Whether it changes which poses arrive."""
        return self.changes == "pose_arrivals"

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return names of the input streams that it changes; see `harness.log.streams`."""
        if self.changes in ("pose", "motion_sensors") or self.delays_pose:
            return ("pose",)
        if self.changes == "delay":
            return ("latency",)
        if self.changes == "world":
            return ("world", *(f"sensor/{name}" for name in sensors))
        return tuple(f"sensor/{name}" for name in self.affected(sensors))

    def pose_error(self, seed: int, time_ns: int, travelled: float) -> PoseError:
        """Return the error added to the pose, `travelled` metres after the start.

        The stated standard deviations leave it out: that is the assumption made wrong.
        """
        if not self.is_active(time_ns):
            return UNCHANGED
        return self.active_pose_error(seed, time_ns, travelled)

    def active_pose_error(self, seed: int, time_ns: int, travelled: float) -> PoseError:
        """Return the error added to the pose while it acts."""
        del seed, time_ns, travelled
        return UNCHANGED

    def lag_at(self, arrival: Arrival) -> Lag:
        """Return which message comes in place of one that is sent: that one while it rests."""
        return self.lag(arrival) if self.is_active(arrival.time_ns) else 0

    def lag(self, arrival: Arrival) -> Lag:
        """Return which message comes in place of one that is sent, while it acts."""
        del arrival
        return 0

    def report(self, report: Report) -> Ranges:  # (n,)
        """Return the ranges (n,) that the stack gets in place of those reported, mm."""
        return report.ranges_mm

    def displacement(self, seed: int) -> Displacement | None:
        """Return the displacement of an affected sensor from its stated mounting, if any."""
        del seed
        return None

    def inertial_bias(self, seed: int) -> InertialBias | None:
        """Return the bias of the inertial sensors that the estimator does not expect, if any."""
        del seed
        return None

    def delay_at(self, seed: int, time_ns: int) -> float:
        """Return the delay added to a decision while it acts, s."""
        del seed, time_ns
        return 0.0


UNPERTURBED = Perturbation()
