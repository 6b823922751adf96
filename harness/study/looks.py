"""Looks at a study: seeds that are added after one make its gates sequential from their start."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count, islice
from math import ceil

import msgspec

from wayproof.harness.errors import InputError
from wayproof.harness.study.analysis import is_imported
from wayproof.harness.study.contents import Contents, contents_of
from wayproof.harness.study.file import StudyFile, arms_of, files_of, seeds_of
from wayproof.harness.study.plan import Planned, plan_episodes
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.store import Store

FIRST = 5
"""Number of seeds before the first look."""

GROWTH = 1.125
"""Factor by which the seeds grow from one look to the next: all logs are read at each."""


def continued(study: StudyFile, store: Store) -> StudyFile:
    """Return a study that continues from where its folder was judged before.

    Whoever adds seeds because a gate was inconclusive has looked, so an interval of a fixed size no
    longer holds: the gates become sequential, over all seeds in the order in which they were run.

    Raises:
        InputError: It has fewer seeds than its folder was judged over; or other seeds or files, and
            its worlds are files, and seeds make no more.
    """
    if study.searches or not store.is_judged:
        return study
    try:
        kept = store.read_study(allow_plugins=True)
    except InputError:  # of another version: its episodes are other ones
        return study
    seen, asked = seeds_of(kept), seeds_of(study)
    both = [seed for seed in seen if seed in asked]
    again = plan_episodes(with_seeds(study, both)) if both else []
    if not any(store.log(one.key).is_file() for one in again):  # other episodes than were judged
        return study
    added = [seed for seed in asked if seed not in seen]
    now, before = _files(study, contents_of(files_of(study))), _files(kept, store.read_contents())
    if study.gates and (now or before) and (now != before or added):
        raise InputError(
            f"study folder '{store.folder}': judged before over other files or seeds of them: "
            "a choice after the fact; expected the same ones, or --out FOLDER"
        )
    if study.sequential or kept.sequential or added:
        return with_seeds(msgspec.structs.replace(study, sequential=True), [*seen, *added])
    if study.gates and len(both) < len(seen):
        raise InputError(
            f"study folder '{store.folder}': judged over {len(seen)} seeds, so that {len(both)} of "
            "them are a choice after the fact; expected all of them, or --out FOLDER"
        )
    return study


def _files(study: StudyFile, contents: Contents) -> set[str]:
    """Return what the imported worlds and recordings of a study are."""
    places = (*study.worlds, *study.recordings)
    return {contents.get(name, name) for name in places if is_imported(name)}


def with_seeds(study: StudyFile, seeds: list[int]) -> StudyFile:
    """Return a study of other seeds."""
    return msgspec.structs.replace(study, seeds=seeds)


def run_until_decided(
    study: StudyFile,
    store: Store,
    at_most: int,
    jobs: int,
    run: Callable[[StudyFile, list[Planned]], StudyResult],
) -> StudyResult:
    """Add seeds until every gate is held or one fails, by sequential gates.

    Args:
        study: The study; its seeds come first, and those that follow them after these.
        store: Its folder, which may have been judged before.
        at_most: Greatest number of seeds.
        jobs: Number of episodes that run at a time.
        run: Runs and judges the planned episodes of a study.

    Raises:
        InputError: No gate can be decided by seeds, or the folder has more of them.
    """
    _check(study, at_most)
    listed = seeds_of(study)
    supply = [*listed, *islice(count(max(listed) + 1), at_most)][:at_most]
    sequential = msgspec.structs.replace(study, sequential=True)
    begun = seeds_of(continued(with_seeds(sequential, supply[:1]), store))
    order = [*begun, *(seed for seed in supply if seed not in begun)]
    if len(begun) > at_most:
        raise InputError(f"--at-most {at_most}: expected at least the {len(begun)} seeds judged")
    size = max(len(begun), min(FIRST, at_most))
    while True:
        asked = with_seeds(sequential, order[:size])
        result = run(asked, plan_episodes(asked))
        if result.verdict != "inconclusive" or size >= at_most:
            return result
        least = max(ceil(size * GROWTH), size + jobs // arms_of(study))
        size = min(least, at_most)


def _check(study: StudyFile, at_most: int) -> None:
    """Refuse a study that seeds cannot decide.

    Raises:
        InputError: It has no gates, or no more worlds; or at most no seed.
    """
    if at_most < 1:
        raise InputError(f"--at-most {at_most}: expected at least 1")
    if not study.gates or study.searches:
        raise InputError("--until-decided: expected a study with gates")
    if study.recordings or any(map(is_imported, study.worlds)):
        raise InputError(
            "--until-decided: adds seeds, and each seed of a world file or recording is the same "
            "world; expected generated worlds"
        )


def saved_in_words(study: StudyFile, result: StudyResult, at_most: int) -> str:
    """Return in words where a study stopped and what it saved."""
    arms = arms_of(study)
    seeds = result.episodes // arms
    left = at_most - seeds
    if result.verdict == "inconclusive":
        return f"stopped undecided at {seeds} seeds, the most allowed; --at-most N continues"
    if result.verdict == "incomplete":
        return f"stopped at {seeds} seeds: episodes have not run"
    return f"decided by {seeds} of at most {at_most} seeds: {left * arms} episodes saved"
