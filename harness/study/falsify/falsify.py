"""A search over an episode of the user's: side by side, kept by key, and gone on with."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.falsify.search import Hunt, Tried, hunt, shorten
from wayproof.harness.study.falsify.space import LEAST, Space
from wayproof.harness.study.file import CLEAN, Arm, Planned, perturbation_at, planned_for
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, run_missing


@dataclass(frozen=True)
class Search:
    """What to look for.

    Attributes:
        config: Of the unperturbed episode.
        name: `KIND` or `KIND:MODE` of the perturbation.
        window: How long it acts, s.
        greatest: Greatest severity that is tried.
        budget: Most episodes, the unperturbed one and the shortening apart.
        seed: Of the choice of episodes.
    """

    config: Config
    name: str
    window: float
    greatest: float
    budget: int
    seed: int

    def __post_init__(self) -> None:
        """Refuse what cannot be searched.

        Raises:
            InputError: Naming the option.
        """
        perturbation_at(self.name, MAX_SEVERITY)
        if not 0.0 < self.window <= 3600.0:
            raise InputError(f"--window {self.window:g}: expected more than 0 s, at most 3600")
        if not LEAST < self.greatest <= MAX_SEVERITY:
            raise InputError(
                f"--greatest {self.greatest:g}: expected {LEAST:g} to {MAX_SEVERITY:g}"
            )


@dataclass(frozen=True)
class Found:
    """What a search came to.

    Attributes:
        method: How the episodes were chosen.
        episodes: Run until the first failure, or all; those that ended beside it are counted.
        failing: The first failure; none if there was none.
        nearest: The episode of the least clearance.
        outcome: Of the failure.
        reason: Likewise.
        log: Of the failure.
        shortest: The same failure with the shortest window.
        cuts: Episodes run for that.
        shortest_log: Of the failure with the shortest window.
        setting: Its perturbation, as `--set perturbation=` takes it.
    """

    method: str
    episodes: int
    failing: Tried | None
    nearest: Tried
    outcome: str = ""
    reason: str = ""
    log: str = ""
    shortest: Tried | None = None
    cuts: int = 0
    shortest_log: str = ""
    setting: str = ""


def search(asked: Search, store: Store, engine: Engine, finished: Finished) -> Found:
    """Search, keep the failing log, and cut its trigger down to the shortest window.

    Raises:
        InputError: The unperturbed episode fails or cannot be run, or the folder cannot be written.
    """
    with store.open():
        store.clear_partial()
        runs = _Runs(asked, store, engine, finished)
        space = Space(asked.name, runs.duration(), asked.window, asked.greatest)
        hunted = hunt(space, runs, asked.budget, asked.seed)
        if hunted.failing is None:
            return Found(hunted.method, runs.episodes, None, hunted.nearest)
        return _keep(hunted, hunted.failing, runs, store)


def _keep(hunted: Hunt, failing: Tried, runs: _Runs, store: Store) -> Found:
    """Copy the failing log under a plain name, shorten its window, and copy that log too."""
    episodes = runs.episodes
    shortest, cuts = shorten(failing, runs)
    logs = {"failing": failing, "shortest": shortest}
    for name, one in logs.items():
        shutil.copyfile(
            store.log(runs.planned(one.perturbation).key), store.folder / f"{name}.mcap"
        )
    result = open_log(store.folder / "failing.mcap", allow_plugins=True).result
    return Found(
        method=hunted.method,
        episodes=episodes,
        failing=failing,
        nearest=hunted.nearest,
        outcome=result["outcome"],
        reason=result["reason"],
        log=str(store.folder / "failing.mcap"),
        shortest=shortest,
        cuts=cuts,
        shortest_log=str(store.folder / "shortest.mcap"),
        setting=msgspec.json.encode(shortest.perturbation).decode(),
    )


class _Runs:
    """Runs the episodes of a search, those that the folder does not hold yet."""

    def __init__(self, asked: Search, store: Store, engine: Engine, finished: Finished) -> None:
        self._asked = asked
        self._store = store
        self._engine = engine
        self._finished = finished
        self._contents = contents_of(named_by(asked.config))
        self.episodes = 0

    def __call__(self, perturbations: Sequence[AnyPerturbation]) -> list[Tried]:
        """Side by side."""
        planned = [self.planned(one) for one in perturbations]
        run_missing(planned, self._store, self._engine, self._finished)
        self.episodes += len(planned)
        return [self._tried(*one) for one in zip(perturbations, planned, strict=True)]

    def planned(self, perturbation: AnyPerturbation | None) -> Planned:
        """The episode with a perturbation."""
        config = self._asked.config
        arm = Arm(config.world, config.robot, "", self._asked.name if perturbation else CLEAN, 0)
        return planned_for(arm, replace(config, perturbation=perturbation), self._contents)

    def duration(self) -> float:
        """Simulated time of the unperturbed episode, s.

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

    def _tried(self, perturbation: AnyPerturbation, planned: Planned) -> Tried:
        result = self._result(planned)
        failed = result["outcome"] != "success"
        return Tried(perturbation, failed, float(result["min_clearance_m"]))

    def _result(self, planned: Planned) -> dict[str, str]:
        error = self._store.error(planned.key)
        if error is not None:
            raise InputError(error)
        log = open_planned(self._store.log(planned.key), planned, allow_plugins=True)
        return log.result
