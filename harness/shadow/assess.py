"""Assessment of the log of a recording: was the way really driven proven free?

A pure function of the log: the maps are made again from its sweeps, the referee judges each piece
of the recorded way on the map of the moment at which it was entered, and the decisions say what the
stack would have done.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs, WorldSweep
from wayproof.harness.interface.referee import is_free
from wayproof.harness.judge.body import Body
from wayproof.harness.log.paths import Array
from wayproof.harness.log.reader import Log, Record, open_log
from wayproof.harness.recompute.moments import SegmentedStack, segments_of
from wayproof.harness.recompute.side_by_side import as_input_error
from wayproof.harness.result import way_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.legs import Leg, Piece, legs_of
from wayproof.harness.shadow.overlap import Found, clearance, find_cause, overlaps_occupied
from wayproof.harness.shadow.own_maps import OwnMaps, lay_beside
from wayproof.harness.shadow.way import LEAST_STEP
from wayproof.harness.stack.footprint import clear_footprint
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.types import PlannerInput
from wayproof.maps import MAPS, Representation, UnknownPolicy

MEMORY_PERIOD = 50
"""Number of decisions between two looks at the memory of the map."""


@dataclass(frozen=True)
class Passed:
    """One decision of a recording, judged.

    Attributes:
        decision: As logged.
        pose: (4,) believed: x, y, z, m, and heading, rad.
        clearance_m: Clearance of the bare body from the map's occupied cells, m.
        ahead_admitted: Whether the way of the next `recording.horizon` was admitted; None where
            the robot hardly moves in it, the recording ends before, or has no poses in between.
    """

    decision: pb.Decision
    pose: Array
    clearance_m: float
    ahead_admitted: bool | None


@dataclass(frozen=True)
class Assessed:
    """All that follows from the log of a recording.

    Attributes:
        log: Head of the log.
        passed: Its decisions.
        legs: The way really driven, in legs.
        unrecorded_m: Straight distance between decisions whose way was not recorded, m.
        map: The map at the end.
        memory: The map at the end without decay.
        greatest_bytes: Greatest memory of the map, bytes.
        own_maps: The robot's own maps beside ours, by topic.
    """

    log: Log
    passed: tuple[Passed, ...]
    legs: tuple[Leg, ...]
    unrecorded_m: float
    map: Representation
    memory: Representation
    greatest_bytes: int
    own_maps: dict[str, OwnMaps]


def assess(
    path: Path, allow_plugins: bool = False, unknown_policy: UnknownPolicy | None = None
) -> Assessed:
    """Judge the way of a recording from its log.

    Args:
        path: Path of the log.
        allow_plugins: Whether code that it names may be imported.
        unknown_policy: Policy in place of the log's own `costmap.unknown_policy`.

    Raises:
        InputError: It is no log of a recording, or is damaged.
    """
    log = open_log(path, allow_plugins)
    if log.config.recording is None:
        raise InputError(f"log '{path}': of a simulated episode, expected one of a recording")
    if unknown_policy is not None:
        costmap = replace(log.config.costmap, unknown_policy=unknown_policy)
        log = replace(log, config=replace(log.config, costmap=costmap))
    motions = list(log.motions())
    judging = _Judging(log, motions)
    passed, pieces = [], []
    for record in log.records():
        one, piece = judging.step(record)
        passed.append(one)
        if piece is not None:
            pieces.append(piece)
    if not passed:
        raise InputError(f"log '{path}': no decisions in it")
    offsets = [offset for offset, _ in log.mission.discs]
    legs = tuple(_with_hindsight(leg, judging) for leg in legs_of(pieces, offsets))
    return Assessed(
        log=log,
        passed=tuple(passed),
        legs=legs,
        unrecorded_m=judging.unrecorded_m,
        map=judging.map,
        memory=judging.memory,
        greatest_bytes=judging.greatest_bytes,
        own_maps=judging.own_maps,
    )


def _with_hindsight(leg: Leg, judging: _Judging) -> Leg:
    cells = overlaps_occupied(judging.body, leg.poses, judging.memory)
    return replace(leg, hindsight_cells=cells)


class _Judging:
    """One pass over the records of a log."""

    def __init__(self, log: Log, motions: list[pb.RecordedMotion]) -> None:
        self._stack = SegmentedStack(segments_of(log))
        self._motions = motions
        self._ways = [way_of(motion) for motion in motions]
        self._times = [motion.timestamp.ToNanoseconds() for motion in motions]
        assert log.config.recording is not None
        self._horizon_ns = round(log.config.recording.horizon * 1e9)
        self.body = Body(log.config, log.mission, log.config.costmap.unknown_policy)
        self.map = self.memory = self._stack.navigator.map
        if log.config.map.half_life > 0.0:
            settings = replace(log.config.map, half_life=0.0)
            low, high = log.mission.low, log.mission.high
            self.memory = MAPS[settings.kind](settings, low, high)
            self._stack.navigator.mapper.on_placed = self._remember
            if log.config.recording.footprint_clearing:
                self._stack.navigator.mapper.on_integrated = self._clear_footprint
        self.greatest_bytes = 0
        self.own_maps: dict[str, OwnMaps] = {}

    @property
    def unrecorded_m(self) -> float:
        """Straight distance between decisions whose way was not recorded, m."""
        ends = np.array([way[-1, :3] for way in self._ways])
        steps = np.sqrt(np.square(np.diff(ends, axis=0)).sum(axis=1))
        lost = [self._is_lost(number) for number in range(1, len(ends))]
        return float(steps[np.array(lost, bool)].sum())

    def step(self, record: Record) -> tuple[Passed, Piece | None]:
        """Judge the next decision, and the way to the one after it."""
        inputs, number = record.inputs, record.decision.sequence
        navigator = self._stack.watch(inputs)
        what = f"decision {number}"
        as_input_error(what, lambda: navigator.mapper.update_costmap(inputs))
        self.map = navigator.map
        if number % MEMORY_PERIOD == 0 or number == len(self._ways) - 1:
            self.greatest_bytes = max(self.greatest_bytes, self.map.memory_bytes())
        pose = np.append(inputs.pose.position, inputs.pose.heading)
        shift = pose[:3] - self._ways[number][-1, :3]
        near = clearance(self.body.standing_at(inputs.pose), pose, self.map)
        planned = navigator.planner_inputs(inputs)
        lay_beside(self._motions[number], navigator, planned[1], self.own_maps)
        ahead = self._next_second_admitted(navigator, planned, number, shift)
        piece = None
        if number + 1 < len(self._ways) and not self._is_lost(number + 1):
            piece = self._piece(navigator, planned, inputs, number, shift)
        return Passed(record.decision, pose, near, ahead), piece

    def _is_lost(self, number: int) -> bool:
        """Return whether the way to a decision after the first was not recorded."""
        return len(self._ways[number]) == 1

    def _remember(self, placed: WorldSweep, range_m: float, time_ns: int) -> None:
        self.memory.integrate(
            placed.origins, placed.directions, placed.ranges_mm, range_m, time_ns, placed.moments
        )

    def _clear_footprint(self, inputs: Inputs) -> None:
        clear_footprint(self.memory, self.body.mission, inputs.pose, inputs.time_ns)

    def _piece(
        self,
        navigator: Navigator,
        planned: tuple[PlannerInput, PlannerInput],
        inputs: Inputs,
        number: int,
        shift: Array,
    ) -> Piece:
        """Return the way to the next decision, judged on the map of this one."""
        poses = self._ways[number + 1] + np.append(shift, 0.0)
        admitted, found = self._admits(navigator, planned, poses), Found("margin", ())
        if not admitted:
            margin = navigator.costmap.margin
            found = find_cause(
                self.body.standing_at(inputs.pose), poses, margin, navigator.map, self.memory
            )
        return Piece(
            sequence=number,
            begin_ns=inputs.time_ns,
            end_ns=self._times[number + 1],
            poses=poses,
            admitted=admitted,
            why="" if admitted else found.why,
            cells=() if admitted else found.cells,
        )

    def _next_second_admitted(
        self,
        navigator: Navigator,
        planned: tuple[PlannerInput, PlannerInput],
        number: int,
        shift: Array,
    ) -> bool | None:
        """Return whether the way of the next second is admitted by the map of now."""
        last = number + 1
        while last < len(self._ways) and self._times[last] < self._times[number] + self._horizon_ns:
            last += 1
        if last >= len(self._ways) or any(map(self._is_lost, range(number + 1, last + 1))):
            return None
        poses = np.concatenate(self._ways[number + 1 : last + 1]) + np.append(shift, 0.0)
        if not is_moving(poses):
            return None
        return self._admits(navigator, planned, poses)

    def _admits(
        self, navigator: Navigator, planned: tuple[PlannerInput, PlannerInput], poses: Array
    ) -> bool:
        circumscribed, oriented = planned
        placed = poses.copy()
        if circumscribed.gait.in_plane:
            placed[:, 2] = circumscribed.position[2]
        return is_free(circumscribed.traversable, oriented.traversable, placed)


def is_moving(poses: Array) -> bool:
    """Return whether poses (n, 4) leave the place of the first by at least a step of way."""
    away = np.square(poses[:, :3] - poses[0, :3]).sum(axis=1)
    return bool(away.max() >= LEAST_STEP * LEAST_STEP)


def refused(legs: tuple[Leg, ...]) -> Iterator[Leg]:
    """Yield the legs that were not admitted when they were entered."""
    return (leg for leg in legs if not leg.admitted)
