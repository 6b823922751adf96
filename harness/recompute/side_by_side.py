"""The recorded stack and a changed one side by side on the inputs of one log.

The changed stack takes each decision from the state of the recorded one: the trajectory that the
robot really followed, the global path, the frontiers explored. So each difference is made by the
change at that very decision and is not the echo of an earlier one. The map of the changed stack is
its own, built from all the sweeps before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.interface.build import navigator_for
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.state import PlannerState
from wayproof.models.arrays import Vector3
from wayproof.planners import Trajectory
from wayproof.plugin import UserCodeError

T = TypeVar("T")


def recompute(navigator: Navigator, record: Record) -> pb.Decision:
    """Decide on the inputs of one record, with its recorded delay.

    Raises:
        InputError: The user's class failed, or there is too little memory.
    """
    return as_input_error(
        f"decision {record.decision.sequence}",
        lambda: navigator.commit(
            navigator.step(record.inputs, answer=record.answer), record.latency.delay_s
        ),
    )


class SideBySide:
    """A recorded and a changed stack that decide on the same records."""

    def __init__(self, log: Log, recorded: Config, changed: Config) -> None:
        """Build both stacks.

        Args:
            log: Log with the mission and the sensors.
            recorded: Settings that the log was recorded with.
            changed: Settings of the changed stack.

        Raises:
            InputError: A stack cannot be built with these settings.
        """
        mission = changed_mission(log.mission, recorded, changed)
        self._goals = None if mission.goals == log.mission.goals else mission.goals
        self._reached = 0  # goals of the recorded decisions
        self.recorded = as_input_error(
            "the recorded stack", lambda: navigator_for(recorded, log.mission, log.beams)
        )
        self.changed = as_input_error(
            "the changed stack", lambda: navigator_for(changed, mission, log.beams)
        )
        self._delay = _changed_delay(recorded, changed)
        self._height = 0.0  # of the changed layer above the recorded one, m
        if mission.planar:
            self._height = layer_of(self.changed) - layer_of(self.recorded)

    def step(self, record: Record) -> tuple[pb.Decision, pb.Decision]:
        """Decide on one record with each; return the recorded and the changed decision."""
        state, chain = self.recorded.state, self.recorded.chain
        recorded = recompute(self.recorded, record)
        self.changed.load_state(shift_height(state, self._height), chain)
        if self._delay is not None:
            latency = pb.Latency(sequence=record.latency.sequence, delay_s=self._delay)
            record = replace(record, latency=latency)
        if self._goals is not None:
            goal = np.array(self._goals[min(self._reached, len(self._goals) - 1)])
            record = replace(record, inputs=replace(record.inputs, goal=goal))
        self._reached += record.decision.action == "goal"
        return recorded, recompute(self.changed, record)


def shift_height(state: PlannerState, height: float) -> PlannerState:
    """Return the state for a costmap whose single layer is higher by `height`, m."""
    if height == 0.0:
        return state
    offset = np.array([0.0, 0.0, height])

    def shifted(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, path=trajectory.path + offset)

    if state.route is not None:
        state = state.along(state.route.path + offset)
    return replace(
        state,
        committed=tuple(shifted(one) for one in state.committed),
        tries=replace(state.tries, viewpoints=state.tries.viewpoints + offset),
    )


def changed_mission(mission: Mission, recorded: Config, changed: Config) -> Mission:
    """Return the mission with the goals of the changed settings, and a height for one that climbs.

    Raises:
        InputError: A goal is the name of a place that a log does not hold.
    """
    waypoints = mission.waypoints
    if changed.waypoints != recorded.waypoints:
        waypoints = tuple(_place("waypoints", one, mission) for one in changed.waypoints)
    goal = mission.goal
    if changed.goal is not None and changed.goal != recorded.goal:
        goal = _place("goal", changed.goal, mission)
    height = mission.rest_height
    if mission.planar and changed.costmap.max_slope > recorded.costmap.max_slope == 0.0:
        height = mission.start[2]  # its floor was flat, at z = 0
    return replace(mission, goal=goal, waypoints=waypoints, rest_height=height)


def _place(name: str, given: tuple[float, ...] | str, mission: Mission) -> Vector3:
    """Return a goal as a point, without z at the height of the mission's goal."""
    if given == "home":
        return mission.start
    if isinstance(given, str):
        raise InputError(f"--set {name}: got '{given}', expected a point or home")
    x, y, *z = given
    return x, y, z[0] if z else mission.goal[2]


def _changed_delay(recorded: Config, changed: Config) -> float | None:
    """Return the delay of each changed decision, s; None to keep the recorded delays."""
    if changed.latency == recorded.latency or changed.latency.mode == "measured":
        return None
    return changed.latency.expected


def layer_of(navigator: Navigator) -> float:
    """Return the height of the layer that a ground robot plans in, m."""
    costmap = navigator.costmap
    return float(costmap.origin[2] + 0.5 * costmap.resolution)


def as_input_error(what: str, make: Callable[[], T]) -> T:
    """Return `make()`; a failure that the input is to blame for becomes an InputError.

    Such are failures of the user's class, and settings that need more memory. The content of a log
    is checked where it is decoded, so any other exception is a fault of Wayproof: it passes, with
    its traceback and a note.

    Args:
        what: Name of the step for messages, such as `decision 12`.
        make: The step.

    Raises:
        InputError: The user's class failed, or there is too little memory.
    """
    try:
        return make()
    except UserCodeError as error:
        raise InputError(f"{what}: {error}") from error
    except MemoryError:
        raise InputError(f"{what}: out of memory, expected smaller maps, or more memory") from None
    except InputError:
        raise
    except Exception as error:
        error.add_note(f"raised by Wayproof's own code at {what}")
        raise
