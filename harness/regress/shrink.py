"""Search for the smallest scenario that fails as a log did: same outcome, same cause.

Every scenario is an episode by its content, with its log in a folder, so that a search that was
interrupted continues, and no episode is run twice.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.attribution.case import read_case
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.config import BUILTIN
from wayproof.harness.config_document import as_asked
from wayproof.harness.counterfactual.check import check
from wayproof.harness.counterfactual.verdict import record_check
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.regress.reductions import REDUCTIONS, changed_settings
from wayproof.harness.regress.scene import Case, case_of
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import CLEAN, Arm, Planned, planned_for
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.report.provenance import run_command
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, run_missing
from wayproof.models.world_files.ground import FLOOR_KIND

TRIES = "tries"
"""Folder of the search below that of the result; it is removed when the search ends by itself."""

MOST_CHECKED = 120.0
"""Simulated time of the check of the cause that is left, s."""


@dataclass(frozen=True)
class Size:
    """Size of a scenario.

    Attributes:
        solids: Number of solids but the floor.
        movers: Number of movers.
        goals: Number of goals.
        settings: Number of settings that are not at their defaults.
        perturbation: Perturbation in words; empty without one.
        seconds: Simulated time until it ends, s.
    """

    solids: int
    movers: int
    goals: int
    settings: int
    perturbation: str
    seconds: float

    def in_words(self) -> str:
        """Return the size in words."""
        parts = [
            f"{count} {name}{'' if count == 1 else 's'}"
            for count, name in (
                (self.solids, "solid"), (self.movers, "mover"),
                (self.goals, "goal"), (self.settings, "changed setting"),
            )
        ]  # fmt: skip
        perturbed = [self.perturbation] if self.perturbation else []
        return ", ".join([*parts, *perturbed, f"{self.seconds:.1f} s"])


@dataclass(frozen=True)
class Shrunk:
    """Result of a search.

    Attributes:
        outcome: Outcome of the log, and of the scenario that is left.
        cause: Cause of both.
        before: Size of the scenario of the log.
        after: Size of what is left.
        episodes: Number of episodes that it took, with those of an earlier run of the same search.
        ended: Whether nothing more can be taken away; else the bound was reached.
        check: Answer of the check of the cause: confirmed, contradicted or inconclusive.
        world: World file.
        log: Log of what is left.
    """

    outcome: str
    cause: str
    before: Size
    after: Size
    episodes: int
    ended: bool
    check: str
    world: Path
    log: Path


class _Spent(Exception):
    """Signal that the bound of the search is reached."""


class _Trials:
    """Episodes of a search: they are run in batches, and each tells whether it fails alike."""

    def __init__(
        self, folder: Path, log: Log, engine: Engine, most: int, finished: Finished
    ) -> None:
        self.store = Store(folder)
        self._engine, self._most, self._finished = engine, most, finished
        self._like = log.result["outcome"], log.result.get("cause", "")
        self._keys: set[str] = set()

    @property
    def episodes(self) -> int:
        """Number of episodes so far."""
        return len(self._keys)

    def plan(self, case: Case) -> Planned:
        """Return the episode of a scenario."""
        config = replace(case.write(self.store.folder), record="failures")
        arm = Arm(config.world, config.robot, "", CLEAN, 0.0)
        return planned_for(arm, config, contents_of(named_by(config)))

    def fail_alike(self, cases: Sequence[Case]) -> list[bool]:
        """Run scenarios, and return which fail with the outcome and the cause of the log.

        Raises:
            _Spent: They would be more than the bound.
        """
        planned = [self.plan(case) for case in cases]
        self._keys |= {one.key for one in planned}
        if len(self._keys) > self._most:
            raise _Spent
        run_missing(planned, self.store, self._engine, self._finished)
        return [self.result(one) == self._like for one in planned]

    def log(self, planned: Planned) -> Path:
        """Return the path of the log of an episode."""
        return self.store.log(planned.key)

    def result(self, planned: Planned) -> tuple[str, str]:
        """Return outcome and cause of an episode; `error` and why of one not run."""
        error = self.store.error(planned.key)
        if error is not None:
            return "error", error
        result = open_planned(self.log(planned), planned, allow_plugins=True).result
        return result["outcome"], result.get("cause", "")


def shrink(
    log: Log,
    folder: Path,
    engine: Engine,
    most: int,
    finished: Finished,
    say: Callable[[str], None],
    robot: str | None = None,
) -> Shrunk:
    """Search for the smallest scenario, and write it as a world file with the log of its episode.

    Args:
        log: Log of a failure.
        folder: Folder of the result.
        engine: Engine that runs the episodes.
        most: Maximum number of episodes.
        finished: Called after each episode.
        say: Called with a line for each reduction.
        robot: Spec file of the robot, if it is the user's own.

    Raises:
        InputError: The log is no failure, or its scenario does not fail again as a world file.
    """
    outcome, cause = log.result["outcome"], log.result.get("cause", "")
    if outcome in ("success", "error") or not cause:
        raise InputError(f"log '{log.path}': {outcome}, expected a failure with a cause")
    case = case_of(log, int(log.result["cause_decision"]), robot)
    trials = _Trials(folder / TRIES, log, engine, most, finished)
    with trials.store.open():
        trials.store.clear_partial()
        first = trials.plan(case)
        if not trials.fail_alike([case])[0]:
            found = ": ".join(trials.result(first))
            raise InputError(
                f"log '{log.path}': its scenario as a world file ends with {found[:200]}, expected "
                f"{outcome}: {cause}; a stack that is not repeatable cannot be shrunk"
            )
        before = _size(case, trials.log(first))
        case, ended = _reduced(case, trials, say)
        last = trials.plan(case)
        after = _size(case, trials.log(last))
        folder.mkdir(parents=True, exist_ok=True)
        world, copy = folder / "world.xml", folder / "shrunk.mcap"
        world.write_text(case.text(), encoding="utf-8")
        shutil.copyfile(trials.log(last), copy)
    answer = _check(open_log(copy, allow_plugins=True))
    if ended:
        shutil.rmtree(folder / TRIES)
    return Shrunk(
        outcome=outcome, cause=cause, before=before, after=after, episodes=trials.episodes,
        ended=ended, check=answer, world=world, log=copy,
    )  # fmt: skip


def _reduced(case: Case, trials: _Trials, say: Callable[[str], None]) -> tuple[Case, bool]:
    """Return the smallest scenario, and whether the search ended by itself.

    Each scenario that fails alike is smaller than those before it, so one is kept at any bound.
    """
    before = None
    while before != (before := (case.text(), case.config)):  # what is taken away may free more
        for name, reduction in REDUCTIONS.items():
            given, steps = case, reduction(case)
            try:
                asked = next(steps)
                while True:
                    alike = trials.fail_alike(asked)
                    kept = [one for one, failed in zip(asked, alike, strict=True) if failed]
                    case = kept[0] if kept else case
                    asked = steps.send(alike)
            except StopIteration as stop:
                case = stop.value
            except _Spent:
                return case, False
            if (case.text(), case.config) != (given.text(), given.config):
                say(f"{name}: smaller, after {trials.episodes} episodes")
    return case, True


def _size(case: Case, log: Path) -> Size:
    perturbation, config = case.config.perturbation, case.config
    words = ""
    if perturbation is not None:
        words = f"{perturbation.kind}:{perturbation.severity:g}"
        if perturbation.window is not None:
            words += f" from {perturbation.window[0]:g} to {perturbation.window[1]:g} s"
    return Size(
        solids=sum(part.kind != FLOOR_KIND for part in case.found.parts),
        movers=len(case.found.movers),
        goals=len(config.waypoints) + 1,
        settings=len(changed_settings(config)),
        perturbation=words,
        seconds=float(open_log(log, allow_plugins=True).result["sim_time_s"]),
    )


def _check(log: Log) -> str:
    """Check the cause of the log of what is left, and store the verdict in it."""
    finding = find_cause(read_case(log))
    assert finding is not None
    stack = "" if log.config.stack.name == BUILTIN else log.config.stack.name
    verdict = check(log, finding, thorough=False, most_s=MOST_CHECKED, stack=stack)
    record_check(log.path, verdict)
    return verdict.answer


def command_of(log: Log, world: Path) -> str:
    """Return the command that runs the episode of a log again, with its world in a file."""
    config = replace(as_asked(log.config, log.asked), world=str(world), record="full")
    arm = Arm(config.world, config.robot, "", CLEAN, 0.0)
    return run_command(Planned(arm, config.seed, config, key=""))
