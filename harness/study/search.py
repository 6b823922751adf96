"""Searches over perturbations of one episode: what `threshold` and `falsify` have in common.

A search asks for episodes, batch by batch, and hears how each ended. All searches of a study
advance side by side. What a search finds follows from the logs in the folder alone, so that one
that was interrupted continues, and a report repeats it without a run.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from wayproof.harness.config_document import with_perturbation
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.study.contents import Contents
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import Planned, planned_for
from wayproof.harness.study.store import Store

Asked = Sequence[AnyPerturbation | None]
"""Perturbation of each episode of a batch; None for the unperturbed one."""


@dataclass(frozen=True)
class Trial:
    """One episode of a search.

    Attributes:
        perturbation: Perturbation of the episode; None of the unperturbed one.
        failed: Whether it did not reach the goal.
        clearance: Least true clearance, m.
        outcome: Outcome.
        reason: Reason of that outcome.
        duration: Simulated time, s.
        log: Path of its log.
    """

    perturbation: AnyPerturbation | None
    failed: bool
    clearance: float
    outcome: str = ""
    reason: str = ""
    duration: float = 0.0
    log: str = ""


Steps = Generator[Asked, list[Trial], None]
"""Generator that asks for the episodes of a batch and is sent their results."""


class Search(Protocol):
    """A search around one episode; it keeps what it has found so far.

    Attributes:
        planned: The unperturbed episode.
        error: Error of an episode that could not be run; empty without one.
    """

    planned: Planned
    error: str

    def steps(self) -> Steps:
        """Ask for episodes until the search has ended."""
        ...


def halved(passed: float, failed: float, resolution: float) -> float | None:
    """Return the middle of a bracket to try next; None once it is as narrow as `resolution`."""
    return None if abs(failed - passed) <= resolution else (passed + failed) / 2.0


def advance(
    searches: Sequence[Search],
    store: Store,
    contents: Contents,
    run: Callable[[Sequence[Planned]], None] = lambda planned: None,
) -> None:
    """Advance all searches, until each has ended or asks for an episode that has not.

    Args:
        searches: The searches; none has begun.
        store: Folder of the logs.
        contents: Identities of the files that the study names.
        run: Function that runs the episodes that are not in the folder; by default none is run.

    Raises:
        InputError: A log is damaged or of another episode.
    """
    waiting = [(one, steps, next(steps)) for one in searches for steps in (one.steps(),)]
    while waiting:
        batches = [[_planned(one, each, contents) for each in asked] for one, _, asked in waiting]
        run([planned for batch in batches for planned in batch])
        following = []
        for (search, steps, asked), batch in zip(waiting, batches, strict=True):
            if not all(store.is_done(planned.key) for planned in batch):
                continue
            trials = [_trial(store, *each) for each in zip(asked, batch, strict=True)]
            search.error = next((one.reason for one in trials if one.outcome == "error"), "")
            if search.error:
                continue
            try:
                following.append((search, steps, steps.send(trials)))
            except StopIteration:
                pass
        waiting = following


def _planned(search: Search, perturbation: AnyPerturbation | None, contents: Contents) -> Planned:
    if perturbation is None:
        return search.planned
    config = with_perturbation(search.planned.config, perturbation)
    return planned_for(search.planned.arm, config, contents)


def _trial(store: Store, perturbation: AnyPerturbation | None, planned: Planned) -> Trial:
    error = store.error(planned.key)
    if error is not None:
        return Trial(perturbation, True, 0.0, outcome="error", reason=error)
    path = Path(store.log(planned.key))
    result = open_planned(path, planned, allow_plugins=True).result
    return Trial(
        perturbation,
        failed=result["outcome"] != "success",
        clearance=float(result.get("min_clearance_m", 0.0)),
        outcome=result["outcome"],
        reason=result.get("reason", ""),
        duration=float(result.get("sim_time_s", 0.0)),
        log=str(path),
    )
