"""Episode whose commands an agent gives, one after the other."""

from __future__ import annotations

import contextlib
from pathlib import Path

from wayproof.harness.interface.build import navigator_for
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.trial import TrialNavigator, logged_answer
from wayproof.harness.interface.types import Command, Motion, Observation, Task
from wayproof.harness.result import Result
from wayproof.harness.runner import open_episode
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.schema import wayproof_pb2 as pb


class AgentEpisode:
    """One episode: the loop, referee and log of `run_episode`, advanced by a command at a time.

    Attributes:
        task: Task that a stack on trial gets before its first observation.
        seen: Newest observation, as a stack on trial gets it.
        decision: Newest decision, with the referee's verdict; none before the first command.
        result: Once the episode has ended.
    """

    def __init__(self, scenario: Scenario, log: Path) -> None:
        """Begin an episode and its log.

        Raises:
            InputError: No map can be made for the mission, or the log cannot be written.
        """
        infos = [sensor_info(caster) for caster in scenario.scene.casters]
        self.task: Task = task_of(
            scenario.config, scenario.mission, {info.name: info for info in infos}
        )
        self.decision: pb.Decision | None = None
        self.result: Result | None = None
        with contextlib.ExitStack() as resources:
            opened = resources.enter_context(open_episode(scenario, log, stack=navigator_for))
            self._opened, self._episode = opened, opened.episode
            self._episode.sense()
            self.seen = self._observe()
            self._resources = resources.pop_all()

    def command(self, motion: Motion) -> None:
        """Command a motion, and simulate up to the next observation or the end of the episode.

        Raises:
            Exception: A fault of Wayproof's own ended the episode; its log is finished as `error`.
        """
        message = command_message(Command(motion), self.seen.sequence)
        self._episode.step(logged_answer(message, self.seen.time_ns))
        self.decision = self._episode.decision
        if self._episode.result is not None:
            self._end()
        else:
            self.seen = self._observe()

    def leave(self, why: str) -> None:
        """End an episode that is under way as `error`."""
        if self.result is None:
            self._episode.abandon(why)
            self._end()

    def truth(self) -> pb.Truth:
        """Return the simulator's truth of this instant."""
        return self._episode.truth()

    def goal_distance(self) -> float:
        """Return the true distance from the goal, m; in the plane for a ground robot."""
        return self._episode.goal_distance()

    def _observe(self) -> Observation:
        navigator = self._opened.navigator
        assert isinstance(navigator, TrialNavigator)
        return navigator.observe(self._episode.inputs)

    def _end(self) -> None:
        with self._resources:
            self.result = self._opened.end()
