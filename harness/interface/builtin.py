"""The built-in stack behind the stack interface, with no way in that others lack."""

from __future__ import annotations

import json
from dataclasses import replace

from wayproof.harness.config_document import from_document
from wayproof.harness.inputs import Inputs, Pose, SweepInput
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.types import Command, Observation, Sweep, Task, Velocity
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.models.poses import Trail


class BuiltinStack:
    """Maps, plans and decides by the settings of the task."""

    def start(self, task: Task) -> None:
        """Build the navigator of this mission."""
        named = {"world": "", "robot": task.robot, "seed": task.seed}
        config = from_document({**named, **json.loads(task.settings)})
        self._deadline_s, self._planar = task.deadline_s, task.mission.planar
        self._limits = motion_limits(config, task.mission)
        beams = {name: sensor.beams for name, sensor in task.sensors.items()}
        self._navigator = build_navigator(config, task.mission, beams)

    def step(self, observation: Observation) -> Command:
        """Return the decision of the navigator as a command."""
        navigator = self._navigator
        if observation.last is not None:
            self._commit_last(observation)
        self._decision = navigator.step(_inputs(observation))
        trajectory = navigator.draft.trajectory
        path = navigator.draft.global_path
        return Command(
            trajectory,
            self._decision.action,
            self._decision.label,
            self._decision.reason,
            path,
            self._decision.map_version,
        )

    def close(self) -> None:
        """Do nothing: there is nothing to end."""

    def _commit_last(self, observation: Observation) -> None:
        """Commit the decision before, or take over the fate of its command."""
        navigator, last = self._navigator, observation.last
        assert last is not None
        late = last.fate == "late"
        navigator.commit(self._decision, 2.0 * self._deadline_s if late else 0.0)
        if last.fate == "cut":  # the body brakes to rest, from where it is commanded to be
            reference = observation.reference
            position = navigator.mapper.planning_point(reference.position)
            reference = replace(reference, position=position)
            brake = trajectory_of(
                Velocity(0.0, duration_s=0.0),
                (reference, reference),
                observation.effect_ns,
                self._limits,
                planar=self._planar,
            ).trajectory
            state = replace(navigator.state, committed=(brake,), route=None)
            navigator.load_state(state, navigator.chain)


def _inputs(observation: Observation) -> Inputs:
    """Return the navigator's inputs in own arrays: kernels compile anew for read-only ones."""
    trail = observation.trail
    if trail is not None:
        trail = Trail(trail.positions.copy(), trail.quaternions.copy(), trail.period)
    pose = Pose(
        position=observation.position.copy(),
        quaternion=observation.quaternion.copy(),
        position_sigma=observation.position_sigma,
        trail=trail,
        heading_sigma=observation.heading_sigma,
        covariance=None if observation.covariance is None else observation.covariance.copy(),
        unheld=observation.unheld.copy(),
        age_ns=observation.pose_age_ns,
    )
    sweeps = tuple(_sweep_input(sweep) for sweep in observation.sweeps)
    return Inputs(observation.time_ns, observation.sequence, pose, sweeps, digest="")


def _sweep_input(sweep: Sweep) -> SweepInput:
    classes = None if sweep.classes is None else sweep.classes.copy()
    return SweepInput(
        sweep.sensor, sweep.ranges_mm.copy(), classes, age_ns=sweep.age_ns, lag=sweep.lag
    )
