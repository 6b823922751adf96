"""Checking a log's decisions by slow code that shares nothing with what made them but the map.

The map is rebuilt sweep by sweep from the log, and its version compared with the one that each
decision names. Against that very map, cell by cell, the committed path is swept by the body; and
the trajectory along it is checked to be one that the body can follow, and that ends at rest.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.config import Config
from harness.errors import InputError
from harness.evidence.relay import Relay, Stretch, stretches
from harness.logs.reader import open_log
from harness.mission import Mission
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import path_of
from maps import FREE, OCCUPIED, UNKNOWN, Representation, UnknownPolicy, states_in

Array = NDArray[np.float64]

SPACING = 0.25  # of the points that a path is checked at, cells
LIMIT_SLACK = 1.05  # on speed and acceleration, read from samples a tenth of a second apart
PARTS = 4  # that the time between two samples is cut into
STILL = 0.02  # rad: a heading that changes by less stays
BESIDE = 0.01  # m: so far a disc may be from where samples, joined by straight lines, put it
REST = 0.02  # m/s: slower is at rest
SAME_PLACE = 0.02  # m
SLIVER = 1e-7  # m, of rounding: a face that lies on a bound is on neither side of it


@dataclass(frozen=True)
class Violation:
    """One rule that one decision broke.

    Attributes:
        sequence: Of the decision.
        rule: `version`, `swept`, `rest`, `limits` or `joined`.
        text: What was found, and what was expected.
    """

    sequence: int
    rule: str
    text: str


@dataclass(frozen=True)
class Audit:
    """What an audit of one log found.

    Attributes:
        log: The log's path.
        policy: That paths were held against.
        decisions: Decisions looked at.
        swept: Of these, with a path that leads somewhere, checked cell by cell.
        stops: Of the others, the ones that brake because what the path before leads through is no
            longer admitted: along that path, or off it where that keeps farther away.
        recoveries: Of the others, the ones that step out of the inflation; their ends are checked.
        violations: In order.
    """

    log: str
    policy: UnknownPolicy
    decisions: int
    swept: int
    stops: int
    recoveries: int
    violations: tuple[Violation, ...]


def audit(path: Path, policy: UnknownPolicy | None = None, allow_plugins: bool = False) -> Audit:
    """Check every decision of a log.

    Args:
        path: The log.
        policy: What to hold paths against in place of the log's own unknown policy.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    relay = Relay(stretches(log))
    held = policy or log.config.map.unknown_policy
    bodies = {run.begin: _body_of(run, policy) for run in stretches(log)}
    violations: list[Violation] = []
    counts = {"swept": 0, "stop": 0, "recovery": 0}
    committed: list[pb.Trajectory] = []
    decisions = 0
    for record in log.records():
        decisions += 1
        version = relay.step(record).map_version
        decision, body = record.decision, bodies[relay.stretch.begin]
        kind, found = _check(decision, version, relay.navigator.map, body, committed)
        violations += [Violation(decision.sequence, rule, text) for rule, text in found]
        if kind:
            counts[kind] += 1
        committed = [*committed[-1:], decision.trajectory]
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    return Audit(
        str(path), held, decisions, counts["swept"], counts["stop"], counts["recovery"],
        tuple(violations),
    )  # fmt: skip


def _body_of(run: Stretch, policy: UnknownPolicy | None) -> _Body:
    return _Body(run.config, run.mission, policy or run.config.map.unknown_policy)


def _check(
    decision: pb.Decision,
    version: str,
    voxel_map: Representation,
    body: _Body,
    committed: list[pb.Trajectory],
) -> tuple[str, list[tuple[str, str]]]:
    """What sort of motion a decision asks for, and the rules that it breaks."""
    found = []
    if decision.map_version != version:
        text = f"names map {decision.map_version[:8]}, the log's sweeps give {version[:8]}"
        found.append(("version", text))
    found += _broken_limits(decision.trajectory, body.mission)
    if committed and not decision.deadline_missed:
        found += _broken_joint(decision.trajectory, committed[-1])
    path = path_of(decision.trajectory.path)
    if decision.deadline_missed or not body.moves(decision.trajectory):
        return "", found
    samples = len(decision.trajectory.arc_length), len(decision.trajectory.heading)
    if body.mission.discs and (0 in samples or samples[0] != samples[1]):
        text = f"{samples[0]} samples of the way, {samples[1]} of the heading"
        return "swept", [*found, ("swept", text)]
    poses, margin = body.poses(decision), decision.localization_margin_m
    if decision.action == "recover":
        # It starts inside the inflation, so its way cannot be free; where it leads to must be.
        if body.first_blocked(voxel_map, poses[-1:], margin):
            found.append(("swept", "action recover: its end is no admitted place"))
        return "recovery", found
    blocked = body.first_blocked(voxel_map, poses, margin)
    if blocked is None:
        return "swept", found
    if decision.action == "stop_and_wait" and _is_last_resort(
        path, poses, committed, voxel_map, body, margin
    ):
        return "stop", found
    place, state = blocked
    at = ", ".join(f"{value:.2f}" for value in place)
    text = f"action {decision.action}: the body at ({at}) would overlap {state} space"
    return "swept", [*found, ("swept", text)]


def _is_last_resort(
    path: Array,
    poses: Array,
    committed: list[pb.Trajectory],
    voxel_map: Representation,
    body: _Body,
    margin: float,
) -> bool:
    """Whether a stop that is not free is all that is left.

    It runs along a path that earlier maps admitted; or it leaves it, because this map does not
    admit as much of that path either, and comes no nearer to what is in the way.
    """
    ways = [path_of(earlier.path) for earlier in committed]
    if any(_runs_along(path, way) for way in ways):
        return True
    ahead = _rest_of(ways[-1], path[0], _length(path)) if ways else path[:0]
    if len(ahead) < 2:
        return False
    steps = np.vstack((np.diff(ahead, axis=0), ahead[-1:] - ahead[-2:-1]))
    straight_on = np.column_stack((ahead, np.arctan2(steps[:, 1], steps[:, 0])))
    if body.first_blocked(voxel_map, straight_on, margin) is None:
        return False
    for nearer in np.arange(0.0, margin + body.mission.radius, 0.5 * voxel_map.resolution):
        if body.first_blocked(voxel_map, poses, margin - nearer) is None:
            return True
        if body.first_blocked(voxel_map, straight_on, margin - nearer) is None:
            return False
    return False  # its very middle goes where it may not: that is no stop to excuse


class _Body:
    """Where a body may be, worked out from the states of single cells."""

    def __init__(self, config: Config, mission: Mission, policy: UnknownPolicy) -> None:
        self.mission = mission
        self._policy = policy
        self._altitudes = config.motion.altitude_low, config.motion.altitude_high
        self._flat = mission.motion == "ground"

    def moves(self, trajectory: pb.Trajectory) -> bool:
        """Whether the body leaves its place, or one that is checked at its heading turns there."""
        headings = trajectory.heading if self.mission.discs else ()
        turns = len(headings) > 0 and np.ptp(headings) > STILL
        return bool(_length(path_of(trajectory.path)) >= SAME_PLACE or turns)

    def poses(self, decision: pb.Decision) -> Array:
        """Where a trajectory leads: x, y, z and heading, (n, 4).

        A body of discs is followed from the decision on, at the samples as they are logged and at
        the corners of the path. A round one is held against all of the path.
        """
        trajectory = decision.trajectory
        path = path_of(trajectory.path)
        if not self.mission.discs:
            return np.column_stack((path, np.zeros(len(path))))
        arcs, headings = np.array(trajectory.arc_length), np.array(trajectory.heading)
        late = decision.timestamp.ToNanoseconds() - trajectory.start.ToNanoseconds()
        first = max(math.floor(late * 1e-9 / trajectory.sample_period_s), 0)
        first = min(first, len(arcs) - 1)
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        times = np.arange(float(first), len(arcs) - 1 + 1e-9, 1.0 / PARTS)
        corners = lengths[(lengths > arcs[first]) & (lengths < arcs[-1])]
        times = np.sort(np.append(times, np.interp(corners, arcs, np.arange(len(arcs)))))
        along = np.interp(times, np.arange(len(arcs)), arcs)
        places = [np.interp(along, lengths, path[:, axis]) for axis in range(3)]
        facing = np.interp(times, np.arange(len(arcs)), headings)
        poses = np.column_stack((*places, facing))
        beyond = path[lengths > arcs[-1] + SAME_PLACE]  # no sample tells that it is not driven
        return np.vstack((poses, np.column_stack((beyond, np.full(len(beyond), headings[-1])))))

    def first_blocked(
        self, voxel_map: Representation, poses: Array, margin: float
    ) -> tuple[Array, str] | None:
        """The first place of the body, or of one of its discs, that overlaps what it may not.

        Where the disc about all of it has room it may lie as it likes.

        Args:
            voxel_map: Of the decision.
            poses: (n, 4) x, y, z, m, and heading, rad.
            margin: Kept about the body, m.

        Returns:
            The place, and what it overlaps; None where there is none.
        """
        if self.mission.discs:
            about = max(abs(offset) + radius for offset, radius in self.mission.discs)
            if self._first_overlap(voxel_map, poses[:, :3], about + margin) is None:
                return None
        for offset, radius in self.mission.discs or ((0.0, self.mission.radius),):
            ahead = np.column_stack((np.cos(poses[:, 3]), np.sin(poses[:, 3])))
            track = poses[:, :3].copy()
            track[:, :2] += offset * ahead
            slack = BESIDE if self.mission.discs else 0.0
            found = self._first_overlap(voxel_map, track, radius + margin, slack)
            if found is not None:
                return found
        return None

    def _first_overlap(
        self, voxel_map: Representation, path: Array, radius: float, slack: float = 0.0
    ) -> tuple[Array, str] | None:
        """The first place of a path at which a disc or ball overlaps what it may not, and why.

        With a slack [m] it does so only if it would that far beside as well.
        """
        size = voxel_map.resolution
        axes = 2 if self._flat else 3
        # A surface lies anywhere in its cell: half a diagonal more.
        reach = radius / size + 0.5 * math.sqrt(axes)  # cells
        states, corner = self._states(voxel_map, path, reach * size)
        places = densely(path, SPACING * size)[:, :axes]
        steps = np.arange(-math.floor(reach) - 1, math.floor(reach) + 2)
        ball = np.stack(np.meshgrid(*(axes * [steps])), axis=-1).reshape(-1, axes)
        ball = ball[(ball**2).sum(axis=1) <= reach * reach]

        def cells_of(points: Array) -> NDArray[np.int64]:
            return np.floor((points - corner[:axes]) / size).astype(np.int64)

        def met(cell: NDArray[np.int64]) -> str:
            here = states[tuple((cell + ball).T)]
            if (here == OCCUPIED).any():
                return "occupied"
            return "unknown" if self._policy == "forbid" and (here == UNKNOWN).any() else ""

        wrong = {tuple(cell): met(cell) for cell in np.unique(cells_of(places), axis=0)}
        sides = np.array(list(itertools.product((-slack, slack), repeat=axes)))
        for place in places:
            state = wrong[tuple(cells_of(place))]
            if state and all(met(cells_of(place + side)) for side in sides):
                return place, state
        return None

    def _states(
        self, voxel_map: Representation, path: Array, reach: float
    ) -> tuple[NDArray[np.uint8], Array]:
        """States around a path, a column as one cell for a walking body, and the first corner."""
        size = voxel_map.resolution
        pad = reach + 3.0 * size
        low, high = path.min(axis=0) - pad, path.max(axis=0) + pad
        if self._flat:
            low[2], high[2] = self.mission.low[2] - size, self.mission.height + 2.0 * size
        first = np.floor(low / size + (0.0, 0.0, 0.75))
        end = np.ceil(high / size + (0.0, 0.0, 0.75))
        corner = (first - (0.0, 0.0, 0.75)) * size
        # Its corners are those of cells, so a quarter of a cell inwards the same cells are meant.
        states = states_in(
            voxel_map, corner + 0.25 * size, (end - (0.0, 0.0, 0.75)) * size - 0.25 * size
        )
        self._fence(states, corner, size)
        return (self._columns(states, corner[2], size) if self._flat else states), corner

    def _fence(self, states: NDArray[np.uint8], corner: Array, size: float) -> None:
        """What does not lie wholly or partly inside the operating area is as good as occupied."""
        low, high = np.array(self.mission.low), np.array(self.mission.high)
        for axis in range(2 if self._flat else 3):
            edges = corner[axis] + np.arange(states.shape[axis]) * size
            outside = (edges + size <= low[axis] + SLIVER) | (edges >= high[axis] - SLIVER)
            if axis == 2:
                bottom, top = self._altitudes
                outside |= (edges < bottom - SLIVER) | (edges + size > top + SLIVER)
            states[(slice(None),) * axis + (outside,)] = OCCUPIED

    def _columns(self, states: NDArray[np.uint8], bottom: float, size: float) -> NDArray[np.uint8]:
        """What a walking body meets in each column (nx, ny)."""
        lower = bottom + np.arange(states.shape[2]) * size  # edge of each layer
        fence = lower + size > self.mission.low[2] + SLIVER
        below = fence & (lower + size <= SLIVER)
        floor = (lower + size > SLIVER) & (lower + size <= self.mission.step_height + SLIVER)
        band = (lower + size > self.mission.step_height + SLIVER) & (
            lower < self.mission.height - SLIVER
        )
        occupied, free = states == OCCUPIED, states == FREE
        blocked = occupied[:, :, band].any(axis=2) | free[:, :, below].any(axis=2)
        standing = occupied[:, :, floor].any(axis=2) & free[:, :, band].all(axis=2)
        return np.where(blocked, OCCUPIED, np.where(standing, FREE, UNKNOWN)).astype(np.uint8)


def _broken_limits(trajectory: pb.Trajectory, mission: Mission) -> list[tuple[str, str]]:
    """Whether the body can follow the samples of a trajectory, and is at rest after them."""
    arcs, period = np.array(trajectory.arc_length), trajectory.sample_period_s
    found: list[tuple[str, str]] = []
    if len(arcs) < 2:
        return found
    speeds = np.diff(arcs) / period
    accelerations = np.diff(speeds) / period
    # The last sample lies at or after the end, so the step to the one before holds the last motion.
    remaining = arcs[-1] - arcs[-2]
    stop = math.sqrt(2.0 * max(remaining, 0.0) * mission.max_acceleration)
    if speeds[-1] > max(REST, stop * LIMIT_SLACK):
        found.append(("rest", f"moves at {speeds[-1]:.2f} m/s when it ends"))
    if arcs[-1] > _length(path_of(trajectory.path)) + SAME_PLACE:
        found.append(("rest", "runs on beyond the end of its path"))
    if speeds.max() > mission.max_speed * LIMIT_SLACK:
        found.append(("limits", f"{speeds.max():.2f} m/s, {mission.max_speed:g} allowed"))
    hardest = np.abs(accelerations).max() if len(accelerations) else 0.0
    if hardest > mission.max_acceleration * LIMIT_SLACK:
        found.append(("limits", f"{hardest:.2f} m/s^2, {mission.max_acceleration:g} allowed"))
    return found


def _broken_joint(trajectory: pb.Trajectory, before: pb.Trajectory) -> list[tuple[str, str]]:
    """Whether a trajectory starts where the one before it is at that time."""
    start = path_of(trajectory.path)[0]
    late = (trajectory.start.ToNanoseconds() - before.start.ToNanoseconds()) * 1e-9
    arcs = np.array(before.arc_length)
    if len(arcs) == 0 or late < 0.0:
        return []
    times = np.arange(len(arcs)) * before.sample_period_s
    along = float(np.interp(late, times, arcs))
    path = path_of(before.path)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    expected = np.array([np.interp(along, lengths, path[:, axis]) for axis in range(3)])
    off = float(np.linalg.norm(start - expected))
    # Between samples of a tenth of a second the body is off the chord by a t^2 / 8 at most.
    if off > 2.0 * SAME_PLACE:
        return [("joined", f"starts {off:.2f} m from where the trajectory before it is then")]
    return []


def densely(path: Array, spacing: float) -> Array:
    """Points of a path, (m, 3), at most so far apart, its own among them."""
    pieces = [path[:1]]
    for a, b in itertools.pairwise(path):
        count = max(math.ceil(float(np.linalg.norm(b - a)) / spacing), 1)
        pieces.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(pieces)


def _length(path: Array) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _rest_of(path: Array, start: Array, reach: float) -> Array:
    """Of a path (n, 3) what follows the point nearest to a start, so far, m."""
    points = densely(path, SAME_PLACE)
    first = int(np.linalg.norm(points - start, axis=1).argmin())
    lengths = np.cumsum(np.linalg.norm(np.diff(points[first:], axis=0), axis=1))
    return points[first : first + 1 + int(np.searchsorted(lengths, reach)) + 1]


def _runs_along(path: Array, earlier: Array) -> bool:
    """Whether every point of a path lies on an earlier one."""
    if len(earlier) == 0:
        return False
    trodden = densely(earlier, SAME_PLACE)
    gaps = np.linalg.norm(path[:, None] - trodden[None], axis=2).min(axis=1)
    return bool(gaps.max() <= SAME_PLACE)
