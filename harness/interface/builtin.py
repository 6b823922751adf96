"""The built-in stack behind the stack interface, with no way in that others lack."""

from __future__ import annotations

import json

from wayproof.harness.config import from_document
from wayproof.harness.inputs import Inputs, Pose, SweepInput
from wayproof.harness.interface.types import Command, Observation, Task
from wayproof.harness.stack.build import build_navigator


class BuiltinStack:
    """Maps, plans and decides by the settings of the task."""

    def start(self, task: Task) -> None:
        """Build the navigator of this mission."""
        config = from_document(json.loads(task.settings))
        self._deadline_s = task.deadline_s
        beams = {name: sensor.beams for name, sensor in task.sensors.items()}
        self._navigator = build_navigator(config, task.mission, beams)

    def step(self, observation: Observation) -> Command:
        """The decision of the navigator as a command."""
        navigator = self._navigator
        if observation.last is not None:
            self._settle(observation.last.fate == "late")
        pose = Pose(
            observation.position,
            observation.quaternion,
            observation.position_sigma,
            observation.trail,
            observation.heading_sigma,
        )
        sweeps = tuple(
            SweepInput(sweep.sensor, sweep.ranges_mm, sweep.classes) for sweep in observation.sweeps
        )
        inputs = Inputs(observation.time_ns, observation.sequence, pose, sweeps, digest="")
        self._decision = navigator.step(inputs)
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
        """Nothing to end."""

    def _settle(self, late: bool) -> None:
        """Commit the decision before, or drop it if its command was discarded."""
        self._navigator.commit(self._decision, 2.0 * self._deadline_s if late else 0.0)
