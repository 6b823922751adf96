"""Environment of Gymnasium: an agent commands one robot in one world, and the referee judges it.

Each episode is one of `wayproof run --stack`, with the agent in the place of the stack: the same
loop, referee and log, and for the same commands the same chain.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from wayproof.harness.config import Config, StackConfig
from wayproof.harness.config_document import from_document, override, with_perturbation
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.gym.agent_episode import AgentEpisode
from wayproof.harness.gym.picture import draw
from wayproof.harness.gym.reward import TRUNCATIONS, Reward
from wayproof.harness.gym.spaces import (
    ActionKind,
    Arrays,
    ObservationKind,
    action_space,
    as_given,
    check_kinds,
    motion_of,
    observation_space,
    observed,
)
from wayproof.harness.gym.training import TrainingEpisode, suits
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.interface.policy_tensors import BEARINGS, SCAN_RANGE_M, PolicyObserver
from wayproof.harness.interface.types import Observation, Task
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.result import ADMITTED
from wayproof.harness.scenario.outlines import outlines
from wayproof.harness.scenario.robots import refuse_unused
from wayproof.harness.scenario.scenario import Scenario, build, sensor_info
from wayproof.models.sensors.caster import ROBOT_GROUP

AGENT = "gymnasium"
"""Name of the stack in the logs of an agent's episodes."""

OPTIONS = ("world", "difficulty", "perturb", "log")
"""Keys of the options of `reset`."""

Episode = AgentEpisode | TrainingEpisode

Given = Arrays | NDArray[np.float32]
"""An observation: by name, or of kind `flat` in one row."""

Info = dict[str, Any]
"""Truth, verdict and result, which an agent must not learn from."""


class WayproofEnv(gymnasium.Env[Given, NDArray[np.float32]], EzPickle):
    """One robot in one world, commanded by an agent.

    A pickled environment is a new one of the same arguments.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's own name and type)

    def __init__(
        self,
        world: str = "warehouse",
        robot: str = "quadruped",
        *,
        action: ActionKind = "velocity",
        observation: ObservationKind = "scan",
        guard: bool = False,
        referee: bool = False,
        reward: Reward | None = None,
        settings: Sequence[str] = (),
        difficulty: float | None = None,
        perturb: str | None = None,
        logs: Path | str | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Describe the episodes; each is built by `reset`.

        Args:
            world: Name of a world, or the path of a world file.
            robot: Name of a robot, or the path of a spec file.
            action: `velocity` or `waypoints`.
            observation: `scan`, `flat` or `sweeps`.
            guard: Whether the referee brakes where it does not admit a command.
            referee: Whether the referee judges each command, and a failure gets its cause. A guard,
                a log and a weight of `not_admitted` ask for it too; it takes ten times as long.
            reward: Weights of the reward; by default those of `Reward`.
            settings: As `--set` takes them, such as `map.resolution=0.2`.
            difficulty: Difficulty of the world; by default the config's.
            perturb: The assumption that is off, as `--perturb` takes it.
            logs: Folder for the log of each episode, `WORLD-ROBOT-SEED.mcap`, in place of an
                earlier one of that name; none are kept by default.
            render_mode: `rgb_array`: `render` returns a picture from above.

        Raises:
            InputError: There is no such world, robot, setting or kind.
        """
        EzPickle.__init__(
            self, world, robot, action=action, observation=observation, guard=guard,
            referee=referee, reward=reward, settings=settings, difficulty=difficulty,
            perturb=perturb, logs=logs, render_mode=render_mode,
        )  # fmt: skip
        check_kinds(observation, action)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode: got '{render_mode}', expected 'rgb_array'")
        self.render_mode = render_mode
        self._action, self._observation, self._weights = action, observation, reward or Reward()
        self._robot, self._settings, self._guard = robot, tuple(settings), guard
        self._referee = referee or self._weights.not_admitted != 0.0
        self._own = {"world": world, "difficulty": difficulty, "perturb": perturb}
        self._logs = None if logs is None else Path(logs)
        self._log: Path | None = None
        infos = map(sensor_info, build(self._config({}, seed=0)).scene.casters)
        self._beams = {info.name: beams_from_info(info) for info in infos}
        self.observation_space = observation_space(observation, self._beams)  # type: ignore[assignment]  # its own type is wider
        self.action_space: spaces.Box = action_space(action)  # type: ignore[assignment]
        self._scratch = Path(tempfile.mkdtemp(prefix="wayproof-"))  # of logs that are not kept
        self._episodes: list[Episode] = []  # the one that reset began
        self._remove = weakref.finalize(self, _end, self._episodes, self._scratch)
        self._arrays: Arrays = {}
        self._observer: PolicyObserver

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make this one from the arguments: another would end with what is made for it."""
        WayproofEnv.__init__(self, *state["_ezpickle_args"], **state["_ezpickle_kwargs"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Given, Info]:
        """Begin an episode; one under way is ended as `error`, and its log finished.

        Args:
            seed: Seed of the world and of all randomness in the episode; by default the next one
                that the generator of the environment draws.
            options: `world`, `difficulty` and `perturb` in place of the environment's own, and
                `log`, the name of the log of this episode.

        Raises:
            InputError: The episode cannot be built, or its log cannot be written.
        """
        super().reset(seed=seed)
        self._leave("the environment was reset")
        own_seed = int(self.np_random.integers(2**31)) if seed is None else seed
        config = self._config(options or {}, own_seed)
        scenario = build(config)
        self._episodes.append(self._begun(scenario, options or {}))
        self._observer = PolicyObserver(self.task)
        self._arrays = self._observed()
        info = {"seed": own_seed, "world": scenario.config.world, "robot": scenario.config.robot}
        return as_given(self._observation, self._arrays), {**info, "truth": self._current().truth()}

    def step(self, action: NDArray[np.float32]) -> tuple[Given, float, bool, bool, Info]:
        """Command one motion, and simulate up to the next observation.

        Returns:
            Observation, reward, whether the episode ended (goal, collision, fall, out of bounds,
            error), whether it was cut off (time limit, stuck), and truth and verdict. At the end of
            an episode the observation is the last one that a command answered.

        Raises:
            InputError: The action has another shape.
            ResetNeeded: No episode is under way.
        """
        episode = self._current()
        if episode.ended is not None:
            raise gymnasium.error.ResetNeeded("step: expected an episode that reset began")
        before_m, before_ns = episode.goal_distance(), episode.seen.time_ns
        episode.command(motion_of(self._action, action, episode.task, episode.seen))
        truth, verdict = episode.truth(), episode.verdict()
        outcome = None if episode.ended is None else episode.ended[0]
        reward = self._weights.of_step(
            progress_m=before_m - truth["goal_distance_m"],
            elapsed_s=truth["time_s"] - before_ns * 1e-9,
            admitted=verdict.get("verdict", ADMITTED) == ADMITTED,
            outcome=outcome,
        )
        info: Info = {**verdict, "truth": truth}
        if episode.ended is None:
            self._arrays = self._observed()
        else:
            info |= episode.summary()
        truncated = outcome in TRUNCATIONS
        return (
            as_given(self._observation, self._arrays),
            reward,
            outcome is not None and not truncated,
            truncated,
            info,
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture from above (rows, columns, 3); None without a `render_mode`.

        Raises:
            ResetNeeded: There is no episode.
        """
        episode = self._current()
        if self.render_mode is None:
            return None
        truth, mission = episode.truth(), episode.task.mission
        heading, at = yaw_of_quaternion(truth["quaternion"]), truth["position"][:2]
        bearings = heading + np.radians(np.arange(BEARINGS) + 0.5) * (360.0 / BEARINGS)
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        met = self._arrays["scan"] < SCAN_RANGE_M
        return draw(
            outlines(episode.model, episode.data, episode.model.geom_group != ROBOT_GROUP),
            (np.array(mission.low[:2]), np.array(mission.high[:2])),
            episode.seen.goal[:2],
            (at, heading, mission.radius),
            (at + self._arrays["scan"][:, None] * rays)[met],
        )

    def close(self) -> None:
        """End the episode under way, and remove logs that are not kept."""
        self._leave("the environment was closed")
        self._remove()

    @property
    def task(self) -> Task:
        """Body, limits, goal and sensors of the episode, as a stack on trial gets them.

        Raises:
            ResetNeeded: There is no episode.
        """
        return self._current().task

    @property
    def seen(self) -> Observation:
        """The newest observation, as a stack on trial gets it: for an expert to imitate.

        Raises:
            ResetNeeded: There is no episode.
        """
        return self._current().seen

    def _current(self) -> Episode:
        if not self._episodes:
            raise gymnasium.error.ResetNeeded("expected an episode that reset began")
        return self._episodes[0]

    def _leave(self, why: str) -> None:
        while self._episodes:
            self._episodes.pop().leave(why)

    def _config(self, options: Mapping[str, Any], seed: int) -> Config:
        """Return the config of an episode.

        Raises:
            InputError: There is no such option, world, robot, setting or perturbation.
        """
        if unknown := sorted(set(options) - set(OPTIONS)):
            raise unknown_name("option of reset", unknown[0], OPTIONS)
        own = {**self._own, **options}
        named = {"world": own["world"], "robot": self._robot, "seed": seed}
        config = override(from_document(named), self._settings)
        refuse_unused(config, [one.partition("=")[0] for one in self._settings])
        if own["difficulty"] is not None:
            config = override(config, [f"difficulty={own['difficulty']}"])
        if own["perturb"] is not None:
            config = with_perturbation(config, perturbation_from(own["perturb"]))
        guard = self._guard or config.stack.guard
        return replace(config, stack=StackConfig(AGENT, guard=guard))

    def _begun(self, scenario: Scenario, options: Mapping[str, Any]) -> Episode:
        """Begin an episode, with referee and log if anything asks for them."""
        config = scenario.config
        log = None if (given := options.get("log")) is None else Path(given)
        if log is None and self._logs is not None:
            names = Path(config.world).stem, Path(config.robot).stem, config.seed
            log = self._logs / "{}-{}-{}.mcap".format(*names)
        if log is None and not self._referee and suits(config):
            return TrainingEpisode(scenario, whole_sweeps=self._observation == "sweeps")
        scratch = self._scratch / "episode.mcap"
        return AgentEpisode(scenario, log or scratch, kept=log is not None)

    def _observed(self) -> Arrays:
        return observed(self._observation, self._observer, self.seen, self._beams)


def _end(episodes: list[Episode], scratch: Path) -> None:
    """End the episode of an environment that nobody closed, and remove logs that are not kept."""
    for episode in episodes:
        episode.leave("the environment was not closed")
    shutil.rmtree(scratch, ignore_errors=True)
