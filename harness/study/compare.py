"""Comparison of two runs of a study, arm by arm and seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.study.analysis import Sample, samples_between
from wayproof.harness.study.contents import PROGRAM, Contents
from wayproof.harness.study.default_gates import DEFAULT_GATES
from wayproof.harness.study.gate import Gate, SequentialGate, read_gate
from wayproof.harness.study.matching import settings_in
from wayproof.harness.study.plan import Arm, Planned, plan_episodes
from wayproof.harness.study.result import Paired, StudyResult
from wayproof.harness.study.rows import Row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import judged, read_own_rows

MOST_SHOWN = 4
"""Maximum number of differences between two folders that are named."""

MOST_LETTERS = 24
"""Maximum length of a value that differs; of a longer one the end is shown."""


@dataclass(frozen=True)
class Compared:
    """Comparison of two folders.

    Attributes:
        result: Its verdict.
        samples: The arms with their pairs.
        time_limit: Greatest time limit of an episode of either folder, s.
    """

    result: StudyResult
    samples: list[Sample]
    time_limit: float


def compare(
    before: Path, after: Path, gates: Sequence[str], allow_plugins: bool = False
) -> Compared:
    """Compare the episodes of the second folder with those of the first, by default gates if none.

    Episodes of either folder without a partner in the other count as missing. Where each folder has
    one stack that the other lacks, these are two builds of one stack, and are compared.

    Raises:
        InputError: A folder is not one of a study, a gate is malformed, or no episode is shared.
    """
    second, first = (read_folder(folder, allow_plugins) for folder in (after, before))
    kind = SequentialGate if second.sequential or first.sequential else Gate
    renamed = _renamed(first.planned, second.planned)
    first = first.in_terms_of(renamed)
    samples = samples_between(first.rows, second.rows)
    if not any(sample.pairs for sample in samples):
        raise InputError(f"'{before}' and '{after}' have no arm and seed in common")
    read = [read_gate(text, kind) for text in gates or DEFAULT_GATES]
    if not gates:
        read = [one for one in read if _has_figure(samples, one.metric)]
    planned = [*second.planned, *first.planned]
    pairs = [pair for sample in samples for pair in sample.pairs]
    result = replace(
        judged(
            f"{after} against {before}",
            read,
            planned,
            [*second.rows, *first.rows],
            samples,
            of_each=2,
        ),
        foreign=(*first.foreign, *second.foreign),
        pairs=Paired(
            count=len(pairs),
            reached=sum(row.success for _, row in pairs),
            reached_before=sum(twin.success for twin, _ in pairs),
        ),
        differences=differences_of(first, second, renamed=bool(renamed)),
    )
    return Compared(result, samples, max(one.config.episode.time_limit for one in planned))


def _has_figure(samples: Sequence[Sample], metric: str) -> bool:
    """Return whether any episode of a pair has a metric."""
    rows = (row for sample in samples for pair in sample.pairs for row in pair)
    return any(row.metrics[metric] is not None for row in rows)


@dataclass(frozen=True)
class Folder:
    """A folder of a study, as read.

    Attributes:
        planned: Its episodes.
        rows: Rows of those that have ended.
        foreign: Lines about logs of other episodes.
        contents: Identities of Wayproof and of the files that the study names.
        sequential: Whether seeds were added after a look at it.
    """

    planned: list[Planned]
    rows: list[Row]
    foreign: tuple[str, ...]
    contents: Contents
    sequential: bool

    def in_terms_of(self, renamed: Mapping[str, str]) -> Folder:
        """Return it with the new names of its stacks."""
        return replace(
            self,
            planned=[replace(one, arm=_in_terms_of(renamed, one.arm)) for one in self.planned],
            rows=[replace(one, arm=_in_terms_of(renamed, one.arm)) for one in self.rows],
        )


def differences_of(first: Folder, second: Folder, renamed: bool) -> tuple[str, ...]:
    """Return what differs between the pairs of two folders, beside a stack that was renamed.

    Raises:
        InputError: A world or a recording is another one: then its episodes are no pairs.
    """
    worlds = {one.arm.world for one in second.planned}
    found: dict[str, tuple[object, object]] = {}
    for name in sorted(first.contents.keys() & second.contents.keys()):
        both = first.contents[name], second.contents[name]
        if both[0] != both[1] and name in worlds:
            raise InputError(
                f"world '{name}': of other content in each folder, so nothing is paired"
            )
        if both[0] != both[1]:
            found["code of Wayproof" if name == PROGRAM else name] = both
    pairs = {(one.arm, one.seed): one for one in first.planned}
    by_arm = {
        one.arm: (pairs[one.arm, one.seed], one)
        for one in reversed(second.planned)
        if (one.arm, one.seed) in pairs
    }
    for twin, one in by_arm.values():
        before, after = settings_in(twin.config), settings_in(one.config)
        for name in dict.fromkeys([*before, *after]):
            if before.get(name) != after.get(name) and not (renamed and name == "stack.name"):
                found.setdefault(name, (before.get(name), after.get(name)))
    lines = [
        f"{name} ({str(old)[-MOST_LETTERS:]} -> {str(new)[-MOST_LETTERS:]})"
        for name, (old, new) in found.items()
    ]
    more = len(lines) - MOST_SHOWN
    return (*lines[:MOST_SHOWN], f"{more} more") if more > 0 else tuple(lines)


def _renamed(before: Sequence[Planned], after: Sequence[Planned]) -> dict[str, str]:
    """Return the stack that only the first study has -> the one that only the second has."""
    first, second = ({one.arm.stack for one in planned} for planned in (before, after))
    old, new = sorted(first - second), sorted(second - first)
    return dict(zip(old, new, strict=True)) if len(old) == len(new) == 1 else {}


def _in_terms_of(renamed: Mapping[str, str], arm: Arm) -> Arm:
    """Return an arm with the new name of its stack."""
    return replace(arm, stack=renamed.get(arm.stack, arm.stack))


def read_folder(folder: Path, allow_plugins: bool) -> Folder:
    """Read a folder with all rows.

    Raises:
        InputError: It is no folder of a study, or a log in it is damaged.
    """
    store = Store(folder)
    study, contents = store.read_study(allow_plugins), store.read_contents()
    planned = plan_episodes(study, contents)
    rows, foreign = read_own_rows(planned, store, allow_plugins)
    return Folder(planned, rows, foreign, contents, study.sequential)
