"""The recorded stack and a changed one side by side on the inputs of one log.

The changed stack takes each decision from the state of the recorded one: the trajectory that the
robot really followed, the global path, the frontiers explored. So each difference is made by the
change at that very decision and is not the echo of an earlier one. The map of the changed stack is
its own, built from all the sweeps before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.types import PlannerState
from wayproof.harness.user_code import USER_CODE_ERRORS
from wayproof.planners import Trajectory

T = TypeVar("T")


def recompute(navigator: Navigator, record: Record) -> pb.Decision:
    """Decide on one record's inputs, with the delay that it had.

    Raises:
        InputError: The inputs are none that a decision can be made on.
    """
    return guarded(
        f"decision {record.decision.sequence}",
        lambda: navigator.commit(navigator.step(record.inputs), record.latency.delay_s),
    )


class SideBySide:
    """Both stacks; one `step` for each record, then `part` to go on with the changed one."""

    def __init__(
        self, log: Log, recorded: Config, changed: Config, beams: Mapping[str, Beams] | None = None
    ) -> None:
        """Start both.

        Args:
            log: Its mission, and its sensors.
            recorded: Settings that the decisions were made with.
            changed: Settings in question.
            beams: Sensors of the inputs, where they are not the log's last ones.

        Raises:
            InputError: There is no such stack.
        """
        self._beams = log.beams if beams is None else beams
        mission = log.mission
        self.recorded = guarded(
            "the recorded stack", lambda: build_navigator(recorded, mission, self._beams)
        )
        mission = changed_mission(log.mission, recorded, changed)
        self.changed = guarded(
            "the changed stack", lambda: build_navigator(changed, mission, self._beams)
        )
        self._delay = _changed_delay(recorded, changed)
        self._layer = 0.0  # of the changed costmap above the recorded one, m
        if mission.motion == "ground":
            self._layer = layer_of(self.changed) - layer_of(self.recorded)

    def step(self, record: Record) -> tuple[pb.Decision, pb.Decision]:
        """What each decides on one record: recorded, changed."""
        state, chain = self.recorded.state, self.recorded.chain
        recorded = recompute(self.recorded, record)
        self.changed.load_state(shift_height(state, self._layer), chain)
        if self._delay is not None:
            latency = pb.Latency(sequence=record.latency.sequence, delay_s=self._delay)
            record = replace(record, latency=latency)
        return recorded, recompute(self.changed, record)

    def part(self, beams: Mapping[str, Beams]) -> Navigator:
        """The changed stack, with the recorded one's past and these sensors, to go on by itself."""
        self.changed.load_state(shift_height(self.recorded.state, self._layer), self.recorded.chain)
        self.changed.mapper.set_sensors(beams)
        return self.changed


def shift_height(state: PlannerState, height: float) -> PlannerState:
    """The planner state in a costmap whose one layer lies this much higher, m."""
    if height == 0.0:
        return state
    offset = np.array([0.0, 0.0, height])

    def moved(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, path=trajectory.path + offset)

    return replace(
        state,
        trajectory=moved(state.trajectory),
        earlier=tuple(moved(one) for one in state.earlier),
        global_path=None if state.global_path is None else state.global_path + offset,
        viewpoints=state.viewpoints + offset,
    )


def changed_mission(mission: Mission, recorded: Config, changed: Config) -> Mission:
    """The mission, with the changed settings' goal."""
    if changed.goal is None or changed.goal == recorded.goal:
        return mission
    x, y, *z = changed.goal
    return replace(mission, goal=(x, y, z[0] if z else mission.goal[2]))


def _changed_delay(recorded: Config, changed: Config) -> float | None:
    """The delay of every changed decision, s; none if it is the recorded one."""
    if changed.latency == recorded.latency or changed.latency.mode == "measured":
        return None
    return changed.latency.expected


def layer_of(navigator: Navigator) -> float:
    """Height of the layer that a ground robot plans in, m."""
    costmap = navigator.costmap
    return float(costmap.origin[2] + 0.5 * costmap.resolution)


def guarded(what: str, make: Callable[[], T]) -> T:
    """Say in one line that a log's settings need more memory, or that the user's class failed.

    Nothing else: what a log holds is checked where it is read, so any other exception is a fault of
    Wayproof's own, and its traceback is needed.

    Raises:
        InputError: One of these two.
    """
    try:
        return make()
    except USER_CODE_ERRORS as error:
        raise InputError(f"{what}: {error}") from error
    except MemoryError:
        raise InputError(f"{what}: out of memory, expected smaller maps, or more memory") from None
