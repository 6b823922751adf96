"""Episode with referee and log, whose commands an agent gives, one after the other."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np

from wayproof.harness.interface.build import navigator_for
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.trial import TrialNavigator, logged_answer
from wayproof.harness.interface.types import Command, Motion, Observation, Task
from wayproof.harness.metrics import efficiency
from wayproof.harness.result import Outcome, Result
from wayproof.harness.runner import open_episode
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.schema import wayproof_pb2 as pb


class AgentEpisode:
    """One episode: the loop, referee and log of `run_episode`, advanced by a command at a time.

    Attributes:
        task: Task that a stack on trial gets before its first observation.
        seen: Newest observation, as a stack on trial gets it.
        model: World and robot.
        data: State of the simulation.
    """

    def __init__(self, scenario: Scenario, log: Path, *, kept: bool) -> None:
        """Begin an episode and its log, which is `kept` or not.

        Raises:
            InputError: No map can be made for the mission, or the log cannot be written.
        """
        infos = [sensor_info(caster) for caster in scenario.scene.casters]
        self.task: Task = task_of(
            scenario.config, scenario.mission, {info.name: info for info in infos}
        )
        self._kept = kept
        self._decision: pb.Decision | None = None
        self._result: Result | None = None
        with contextlib.ExitStack() as resources:
            opened = resources.enter_context(open_episode(scenario, log, stack=navigator_for))
            self._opened, self._episode = opened, opened.episode
            self.model, self.data = scenario.scene.model, opened.episode.data
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
        self._decision = self._episode.decision
        if self._episode.result is not None:
            self._end()
        else:
            self.seen = self._observe()

    @property
    def ended(self) -> tuple[Outcome, str] | None:
        """Outcome and reason, once the episode has ended."""
        return None if self._result is None else (self._result.outcome, self._result.reason)

    def leave(self, why: str) -> None:
        """End an episode that is under way as `error`."""
        if self._result is None:
            self._episode.abandon(why)
            self._end()

    def truth(self) -> dict[str, Any]:
        """Return the simulator's truth of this instant."""
        truth = self._episode.truth()
        return {
            "time_s": truth.timestamp.ToNanoseconds() * 1e-9,
            "position": np.array(truth.position),
            "quaternion": np.array(truth.quaternion),
            "clearance_m": truth.clearance_m,
            "goal_distance_m": self.goal_distance(),
            "collisions": truth.collisions,
        }

    def verdict(self) -> dict[str, Any]:
        """Return the referee's verdict on the newest command, and whether the guard cut it."""
        verdict = pb.Verdict() if self._decision is None else self._decision.verdict
        return {"verdict": verdict.verdict, "cut": verdict.cut}

    def summary(self) -> dict[str, Any]:
        """Return the result; `spl` without a way to the goal is left out."""
        result = self._result
        assert result is not None
        info = {
            "outcome": result.outcome,
            "reason": result.reason,
            "cause": result.cause,
            "evidence": result.cause_evidence,
            "commands": result.commands,
            "not_admitted": result.not_admitted,
            "first_not_admitted": result.first_not_admitted,
            "least_clearance_m": result.min_clearance_m,
            "chain": result.chain,
            "log": result.log if self._kept else "",
        }
        if result.route_length_m is not None:
            reached = result.outcome == "success"
            info["spl"] = reached * efficiency(result.path_length_m, result.route_length_m)
        return info

    def goal_distance(self) -> float:
        """Return the true distance from the goal, m; in the plane for a ground robot."""
        return self._episode.goal_distance()

    def _observe(self) -> Observation:
        navigator = self._opened.navigator
        assert isinstance(navigator, TrialNavigator)
        return navigator.observe(self._episode.inputs)

    def _end(self) -> None:
        with self._resources:
            self._result = self._opened.end()
