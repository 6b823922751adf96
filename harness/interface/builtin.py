"""The built-in stack behind the stack interface, with no way in that others lack."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.interface.local_costmap import config_of, inputs_of
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.types import Command, Observation, Task, Velocity
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.planner_input import motion_limits


class BuiltinStack:
    """Maps, plans and decides by the settings of the task."""

    def start(self, task: Task) -> None:
        """Build the navigator of this mission."""
        config = config_of(task)
        self._deadline_s, self._planar = task.deadline_s, task.mission.planar
        self._limits = motion_limits(config, task.mission)
        beams = {name: sensor.beams for name, sensor in task.sensors.items()}
        self._navigator = build_navigator(config, task.mission, beams)

    def step(self, observation: Observation) -> Command:
        """Return the decision of the navigator as a command."""
        navigator = self._navigator
        if observation.last is not None:
            self._commit_last(observation)
        self._decision = navigator.step(inputs_of(observation))
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
