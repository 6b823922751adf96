"""Episodes of a study, numbered as planned, each with its log and that of its twin."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from wayproof.harness.errors import InputError
from wayproof.harness.outputs import ENDING
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import Planned, name_of, plan_episodes
from wayproof.harness.study.store import Store

State = Literal["ended", "running", "not run", "no log"]


@dataclass(frozen=True)
class Entry:
    """One episode of a study.

    Attributes:
        number: Its number, from 1.
        name: World, robot, stack, variant and perturbation, in words.
        seed: Its seed.
        state: `no log` of an episode that failed to run.
        outcome: Outcome; the error without a log; empty unless it has ended.
        cause: Cause of a failure, as corrected by a check; empty without one.
        log: Path of its log, or of the unfinished one while it runs; empty without one.
        twin: Path of the log of its twin; empty without one.
    """

    number: int
    name: str
    seed: int
    state: State
    outcome: str = ""
    cause: str = ""
    log: str = ""
    twin: str = ""

    @property
    def failed(self) -> bool:
        """Whether it has ended otherwise than at its goal, or failed to run."""
        return self.state == "no log" or self.outcome not in ("", "success")


def entries_of(folder: Path, allow_plugins: bool = False) -> list[Entry]:
    """Return all planned episodes of the study in a folder.

    Raises:
        InputError: It is no folder of a study, or a log in it is damaged or of another episode.
    """
    store = Store(folder)
    study = store.read_study(allow_plugins)
    planned = plan_episodes(study, store.read_contents())
    keys = {(one.arm, one.seed): one.key for one in planned}

    def twin(one: Planned) -> str:
        key = keys.get((one.reference, one.seed)) if one.reference else None
        path = None if key is None else store.log(key)
        return str(path) if path is not None and path.is_file() else ""

    return [
        _entry(store, number, one, twin(one), allow_plugins)
        for number, one in enumerate(planned, 1)
    ]


def _entry(store: Store, number: int, one: Planned, twin: str, allow_plugins: bool) -> Entry:
    path, name = store.log(one.key), name_of(one.arm)
    partial = path.with_name(path.name + ENDING)
    error = store.error(one.key)
    if error is not None:
        return Entry(number, name, one.seed, "no log", outcome=error)
    if path.is_file():
        log = open_planned(path, one, allow_plugins)
        return Entry(
            number,
            name,
            one.seed,
            "ended",
            outcome=log.result["outcome"],
            cause=log.check.get("cause") or log.result.get("cause", ""),
            log=str(path),
            twin=twin,
        )
    if partial.is_file():
        return Entry(number, name, one.seed, "running", log=str(partial))
    return Entry(number, name, one.seed, "not run")


def unplanned_in_words(folder: Path, allow_plugins: bool = False) -> str:
    """Return in words how many logs of a study's folder belong to no planned episode; "" of none.

    Raises:
        InputError: It is no folder of a study.
    """
    store = Store(folder)
    study = store.read_study(allow_plugins)
    planned = plan_episodes(study, store.read_contents())
    count = store.unplanned({one.key for one in planned})
    if not count or study.searches:  # which chooses its episodes as it goes
        return ""
    logs = "1 log is" if count == 1 else f"{count} logs are"
    return (
        f"{logs} of no planned episode: another build of Wayproof or of the study file made "
        f"them; 'wayproof view {store.logs}/KEY.mcap' shows one"
    )


def find_entry(folder: Path, entries: list[Entry], number: int) -> Entry:
    """Return the episode of a number that has a log.

    Raises:
        InputError: There is no such number, or the episode has no log.
    """
    if not 1 <= number <= len(entries):
        raise InputError(f"study '{folder}': no episode {number}, expected 1 to {len(entries)}")
    found = entries[number - 1]
    if not found.log:
        why = f": {found.outcome}" if found.outcome else ""
        raise InputError(
            f"study '{folder}': episode {number} ({found.name}, seed {found.seed}) has no log, "
            f"{found.state}{why}"
        )
    return found
