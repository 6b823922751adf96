"""Falsification of an episode: a search for a failing perturbation, with all logs kept by key."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.falsify.search import SearchResult, Trial, search, shorten
from wayproof.harness.study.falsify.space import LEAST, Space
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import CLEAN, Arm, Planned, perturbation_at, planned_for
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, run_missing


@dataclass(frozen=True)
class Task:
    """Episode and perturbation to search.

    Attributes:
        config: Config of the unperturbed episode.
        name: `KIND` or `KIND:MODE` of the perturbation.
        window: Duration of the perturbation, s.
        greatest: Greatest severity.
        budget: Maximum number of episodes, without the unperturbed one and the shortening.
        seed: Seed of the search.
    """

    config: Config
    name: str
    window: float
    greatest: float
    budget: int
    seed: int

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InputError: A value is out of its range; the message names the option.
        """
        perturbation_at(self.name, MAX_SEVERITY)
        if not 0.0 < self.window <= 3600.0:
            raise InputError(f"--window {self.window:g}: expected more than 0 s, at most 3600")
        if not LEAST < self.greatest <= MAX_SEVERITY:
            raise InputError(
                f"--greatest {self.greatest:g}: expected {LEAST:g} to {MAX_SEVERITY:g}"
            )


@dataclass(frozen=True)
class Falsification:
    """Result of a falsification.

    Attributes:
        method: Method of the search.
        episodes: Number of episodes run up to the first failure, with those run beside it.
        failing: The first failure; None without one.
        nearest: The episode of the least clearance.
        outcome: Outcome of the failure.
        reason: Reason of that outcome.
        log: Log of the failure.
        shortest: The failure with the shortest window.
        cuts: Number of episodes run to shorten the window.
        shortest_log: Log of the failure with the shortest window.
        setting: Perturbation of that failure, as a value of `--set perturbation=`.
    """

    method: str
    episodes: int
    failing: Trial | None
    nearest: Trial
    outcome: str = ""
    reason: str = ""
    log: str = ""
    shortest: Trial | None = None
    cuts: int = 0
    shortest_log: str = ""
    setting: str = ""


def falsify(task: Task, store: Store, engine: Engine, finished: Finished) -> Falsification:
    """Search for a failure, keep its log, and cut its trigger down to the shortest window.

    Raises:
        InputError: The unperturbed episode fails or cannot be run, or the folder cannot be written.
    """
    with store.open():
        store.clear_partial()
        runs = _Runs(task, store, engine, finished)
        space = Space(task.name, runs.duration(), task.window, task.greatest)
        result = search(space, runs, task.budget, task.seed)
        if result.failing is None:
            return Falsification(result.method, runs.episodes, None, result.nearest)
        return _keep(result, result.failing, runs, store)


def _keep(result: SearchResult, failing: Trial, runs: _Runs, store: Store) -> Falsification:
    """Shorten the window of a failure, and copy both logs under plain names."""
    episodes = runs.episodes
    shortest, cuts = shorten(failing, runs)
    logs = {"failing": failing, "shortest": shortest}
    for name, one in logs.items():
        shutil.copyfile(
            store.log(runs.planned(one.perturbation).key), store.folder / f"{name}.mcap"
        )
    logged = open_log(store.folder / "failing.mcap", allow_plugins=True).result
    return Falsification(
        method=result.method,
        episodes=episodes,
        failing=failing,
        nearest=result.nearest,
        outcome=logged["outcome"],
        reason=logged["reason"],
        log=str(store.folder / "failing.mcap"),
        shortest=shortest,
        cuts=cuts,
        shortest_log=str(store.folder / "shortest.mcap"),
        setting=msgspec.json.encode(shortest.perturbation).decode(),
    )


class _Runs:
    """Runner of the episodes of a search that are not in the folder yet."""

    def __init__(self, task: Task, store: Store, engine: Engine, finished: Finished) -> None:
        self._task = task
        self._store = store
        self._engine = engine
        self._finished = finished
        self._contents = contents_of(named_by(task.config))
        self.episodes = 0

    def __call__(self, perturbations: Sequence[AnyPerturbation]) -> list[Trial]:
        """Run an episode with each perturbation, in parallel."""
        planned = [self.planned(one) for one in perturbations]
        run_missing(planned, self._store, self._engine, self._finished)
        self.episodes += len(planned)
        return [self._trial(*one) for one in zip(perturbations, planned, strict=True)]

    def planned(self, perturbation: AnyPerturbation | None) -> Planned:
        """Return the episode with a perturbation."""
        config = self._task.config
        arm = Arm(
            config.world,
            config.robot,
            variant="",
            perturbation=self._task.name if perturbation else CLEAN,
            severity=0,
        )
        return planned_for(arm, with_perturbation(config, perturbation), self._contents)

    def duration(self) -> float:
        """Return the simulated time of the unperturbed episode, s.

        Raises:
            InputError: It does not reach the goal.
        """
        clean = self.planned(None)
        run_missing([clean], self._store, self._engine, self._finished)
        result = self._result(clean)
        if result["outcome"] != "success":
            raise InputError(
                f"the unperturbed episode ends in '{result['outcome']}', expected one that reaches "
                "the goal: there is nothing to search for"
            )
        return float(result["sim_time_s"])

    def _trial(self, perturbation: AnyPerturbation, planned: Planned) -> Trial:
        result = self._result(planned)
        failed = result["outcome"] != "success"
        return Trial(perturbation, failed, float(result["min_clearance_m"]))

    def _result(self, planned: Planned) -> dict[str, str]:
        error = self._store.error(planned.key)
        if error is not None:
            raise InputError(error)
        log = open_planned(self._store.log(planned.key), planned, allow_plugins=True)
        return log.result
