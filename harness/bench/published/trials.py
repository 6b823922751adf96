"""Episodes of published benchmarks in two processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.bench.table import Progress
from wayproof.harness.config import BUILTIN, Config, PluginConfig, StackConfig
from wayproof.harness.errors import InputError
from wayproof.harness.interface.connect import connect
from wayproof.harness.log.writer import check_folder
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.world_files import FileWorld

PROCESSES = 2


@dataclass(frozen=True)
class Trial:
    """One episode to run.

    Attributes:
        world: World of the episode.
        config: Settings and seed.
        log: Path of the log.
    """

    world: FileWorld
    config: Config
    log: Path


@dataclass(frozen=True)
class Finished:
    """Result of a trial.

    Attributes:
        trial: The trial.
        result: Result of the episode; None if it could not be started.
        refused: Reason why it could not be started; empty if it was.
        track: True (time in s, x, y, z in m) at each decision.
    """

    trial: Trial
    result: Result | None
    refused: str
    track: tuple[tuple[float, float, float, float], ...]

    def first(self, reached: Callable[[float, float, float], bool]) -> float | None:
        """Return the time of the first decision with the body at the end of a benchmark, s."""
        return next((time for time, *place in self.track if reached(*place)), None)


def refuse_unknown_stack(stack: StackConfig) -> None:
    """Connect to the stack and close it again, before any episode is refused for it.

    Raises:
        InputError: There is no such stack, or it does not answer.
    """
    if stack.name != BUILTIN:
        connect(stack.name, PluginConfig().wall_s).close()


def run_trials(trials: Iterable[Trial], progress: Progress) -> Iterator[Finished]:
    """Run trials; yield the results in the order given.

    Raises:
        InputError: The folder of the logs cannot be written to.
    """
    trials = list(trials)
    for folder in {trial.log.parent for trial in trials}:
        check_folder(folder)
    if not trials:
        return
    progress("compiling kernels (a minute the first time, then cached)")
    warm_up(trials[0].config)  # once, not in both processes at the same time
    with WorkerPool(PROCESSES) as pool:
        finished_trials = pool.run_in_order(run_trial, [(trial,) for trial in trials])
        for number, finished in enumerate(finished_trials, start=1):
            trial = finished.trial
            outcome = finished.refused or (finished.result and finished.result.outcome)
            name = f"{trial.world.name}, seed {trial.config.seed}"
            progress(f"{number} of {len(trials)}: {name}: {outcome}")
            yield finished


def run_trial(trial: Trial) -> Finished:
    """Run one episode; bad input is an outcome, so that one bad world does not stop the others."""
    track: list[tuple[float, float, float, float]] = []

    def note(_: pb.Decision, truth: pb.Truth) -> None:
        x, y, z = truth.position
        track.append((truth.timestamp.ToNanoseconds() * 1e-9, x, y, z))

    try:
        warm_up(trial.config)
        result = run_episode(build(trial.config, trial.world), trial.log, note)
    except InputError as error:
        return Finished(trial, None, str(error), tuple(track))
    return Finished(trial, result, "", tuple(track))
