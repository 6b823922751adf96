"""Episode for training: body, sensors and pose as in any other, without map, referee and log.

The body moves, and its pose is estimated, bit by bit as in `AgentEpisode` for the same actions. A
scan is of fewer beams: those of every column that it takes to meet each bearing twice.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.goals import distance, goal_message
from wayproof.harness.input_messages import beams_from_info, inputs_from_messages
from wayproof.harness.inputs import Beams, Inputs, SweepInput
from wayproof.harness.interface.motion import commanded
from wayproof.harness.interface.motion_checks import MotionError
from wayproof.harness.interface.observations import ObservationBuilder, task_of
from wayproof.harness.interface.policy_tensors import BEARINGS
from wayproof.harness.interface.trial import action_after
from wayproof.harness.interface.types import Motion, Observation, Task
from wayproof.harness.result import Outcome
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.termination import TerminationMonitor
from wayproof.harness.stack.gait import is_omnidirectional
from wayproof.harness.stack.gaits import gait_of
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.caster import Caster, make_caster
from wayproof.planners import Trajectory, hold

COLUMNS = 2
"""Least number of a grid's columns in each bearing of the scan."""

STEEP = 0.9
"""Vertical component of a beam that meets nothing beside the body, as an altimeter's."""

Array = NDArray[np.float64]


def suits(config: Config) -> bool:
    """Return whether nothing in a config needs what this episode leaves out.

    That are sweeps for the pose estimate, delays that are measured, and messages that come late.
    """
    changes = "nothing" if config.perturbation is None else config.perturbation.changes
    late = changes not in ("nothing", "ranges", "pose", "world")
    modelled = (
        config.latency.mode == "modelled" and config.latency.expected <= config.latency.deadline
    )
    return modelled and not late and config.estimate.kind != "lidar" and not config.stack.guard


class TrainingEpisode:
    """One episode, advanced by a command at a time.

    Attributes:
        task: Task that a stack on trial gets before its first observation.
        seen: Newest observation, as a stack on trial gets it.
        model: World and robot.
        data: State of the simulation.
        ended: Outcome and reason, once the episode has ended.
    """

    def __init__(self, scenario: Scenario, *, whole_sweeps: bool) -> None:
        """Begin an episode.

        Args:
            scenario: Scenario of the episode.
            whole_sweeps: Whether every beam is cast, not those of a scan alone.
        """
        redirect_mujoco_warnings()
        config, mission = scenario.config, scenario.mission
        self._scenario, self._config, self._mission = scenario, config, mission
        self._casters = scenario.scene.casters
        beams = {one.mount.name: beams_from_info(sensor_info(one)) for one in self._casters}
        around = is_omnidirectional(beams.values())
        self._gait = gait_of(mission, motion_limits(config, mission), around)
        if not whole_sweeps:
            level = [one for one in self._casters if _sees_ahead(beams[one.mount.name])]
            self._casters = tuple(_thinned(one, scenario) for one in level)
        infos = {one.mount.name: sensor_info(one) for one in self._casters}
        self.task: Task = task_of(config, mission, infos)
        beams = {name: beams_from_info(info) for name, info in infos.items()}
        self._builder = ObservationBuilder(config, mission, beams)
        self._committed: tuple[Trajectory, ...] = (
            hold(np.array(mission.start), 0, mission.start_heading),
        )
        self._simulation = Simulation(scenario, self._committed[0])
        self.model, self.data = scenario.scene.model, self._simulation.data
        self._termination = TerminationMonitor(scenario, self.data, self._simulation.truth)
        self._injector = PerturbationInjector(config, scenario.scene)
        self._positions: list[Array] = []
        self._reached = 0
        self.ended: tuple[Outcome, str] | None = None
        self.seen: Observation
        self._sense()

    def command(self, motion: Motion) -> None:
        """Command a motion, and simulate up to the next observation or the end of the episode."""
        try:
            action = self._commit(motion)
        except MotionError as error:
            self.ended = "error", f"the action gives a command with {error}"
            return
        self._positions.append(self._simulation.position.copy())
        decision = pb.Decision(sequence=self.seen.sequence, action=action)
        decision.timestamp.FromNanoseconds(self.seen.time_ns)
        self.ended = self._termination.check_decision(decision, self._positions, self._reached)
        if self.ended is None:
            self.ended = self._follow()
        if self.ended is None:
            self._reached += action == "goal"
            self._sense()

    def leave(self, why: str) -> None:
        """End an episode that is under way as `error`."""
        self.ended = self.ended or ("error", why)

    def truth(self) -> dict[str, Any]:
        """Return the simulator's truth of this instant, without what takes a search."""
        simulation = self._simulation
        return {
            "time_s": simulation.now_ns * 1e-9,
            "position": simulation.position.copy(),
            "quaternion": simulation.quaternion.copy(),
            "goal_distance_m": self.goal_distance(),
            "collisions": simulation.truth.collisions,
        }

    def verdict(self) -> dict[str, Any]:
        """Return nothing: there is no referee."""
        return {}

    def summary(self) -> dict[str, Any]:
        """Return how the episode ended."""
        assert self.ended is not None
        return {"outcome": self.ended[0], "reason": self.ended[1]}

    def goal_distance(self) -> float:
        """Return the true distance from the goal, m; in the plane for a ground robot."""
        return self._termination.distance_left(self._reached)

    def _commit(self, motion: Motion) -> str:
        """Have the body follow a motion from its time of effect on; return the action.

        Raises:
            MotionError: It is none that a body can follow.
        """
        seen, planar = self.seen, self._mission.planar
        newest = self._committed[-1]
        trajectory = commanded(
            motion, newest, seen.position, seen.effect_ns, self._gait, planar
        ).trajectory
        begun = [k for k, one in enumerate(self._committed) if one.start_ns <= seen.time_ns]
        left = self._committed[begun[-1] if begun else 0 :]
        axes = self._mission.axes
        arrived = distance(seen.position[:axes], seen.goal[:axes]) <= self.task.goal_tolerance
        self._committed = (*left, trajectory)
        self._simulation.enqueue([(max(trajectory.start_ns, seen.effect_ns), trajectory)])
        return action_after(trajectory, left[0], seen.time_ns, seen.effect_ns, arrived)

    def _follow(self) -> tuple[Outcome, str] | None:
        for _ in range(self._simulation.steps_per_decision):
            if self._simulation.step(save=False) and (verdict := self._termination.check_physics()):
                return verdict
        return None

    def _sense(self) -> None:
        simulation, injector = self._simulation, self._injector
        sequence, time_ns = len(self._positions), simulation.now_ns
        simulation.drain_setpoints()
        simulation.place_geometry()
        trail, estimate = simulation.trail(), simulation.estimate
        injector.begin_decision(sequence)
        cast = [injector.cast(one, self.data, trail, sequence) for one in self._casters]
        estimate.advance(time_ns, trail.positions[-1], trail.quaternions[-1])
        pose = estimate.pose(trail, simulation.rolling)
        pose.sequence = sequence
        pose.timestamp.FromNanoseconds(time_ns)
        goal = goal_message(self._mission, self._reached, sequence, time_ns)
        sweeps = tuple(
            SweepInput(caster.mount.name, ranges, classes if len(classes) else None)
            for caster, (ranges, classes) in zip(self._casters, cast, strict=True)
        )
        inputs: Inputs = replace(inputs_from_messages(pose, (), (), goal), sweeps=sweeps)
        self.seen = self._builder.build(inputs, self._committed[-1], None)


def _sees_ahead(beams: Beams) -> bool:
    """Return whether a beam leaves the cone of `STEEP` about the vertical, as a scan needs."""
    return bool((np.abs(beams.directions_in_base()[:, 2]) < STEEP).any())


def _thinned(caster: Caster, scenario: Scenario) -> Caster:
    """Return the caster of the beams that a scan needs."""
    mount, scene = caster.mount, scenario.scene
    stride = _stride(caster.table)
    return make_caster(
        scene.model, mount, scene.base, ROBOT_PREFIX, scenario.config.sensors, stride
    )


def _stride(table: BeamTable) -> int:
    """Return the distance of columns; each bearing of a scan has `COLUMNS` or more."""
    if table.order != "grid" or len(table.columns) < COLUMNS:
        return 1
    step = float(np.sqrt(np.square(table.columns[1] - table.columns[0]).sum()))  # about, rad
    return max(1, int(2.0 * np.pi / (BEARINGS * COLUMNS * step)))
