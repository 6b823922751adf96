"""A study in its folder: run it or open it, and read its table and its verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from wayproof.harness.api.episode import RecordedEpisode, open, text_of
from wayproof.harness.errors import InputError
from wayproof.harness.study.compare import compare
from wayproof.harness.study.file import StudyFile, read_study
from wayproof.harness.study.gates import gate_in_words
from wayproof.harness.study.looks import continued
from wayproof.harness.study.lost import Lost
from wayproof.harness.study.plan import Planned, name_of, plan_episodes
from wayproof.harness.study.processes import ProcessEngine
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.rows import arrow_table, read_row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import conclude, read_own_rows, run_study


@dataclass(frozen=True)
class RecordedStudy:
    """A study in its folder; nothing is simulated to read it.

    Attributes:
        folder: Folder of the study, with `logs/` in it.
        file: The study.
    """

    folder: Path
    file: StudyFile

    def table(self) -> pa.Table:
        """Return one row for each episode that has ended, metrics and log with it.

        Raises:
            InputError: A log is damaged or contradicts itself.
        """
        store, planned = Store(self.folder), self._planned()
        found = [read_row(store, one, allow_plugins=True) for one in planned]
        rows = [one for one in found if one is not None]
        if not rows:
            raise InputError(f"study '{self.folder}': no episode has ended")
        table = arrow_table(rows)
        logs = [str(store.log(row.key)) if row.chain else None for row in rows]
        return table.append_column("log", pa.array(logs, pa.string()))

    def result(self) -> StudyResult:
        """Return its verdict, gates, lost episodes and changes, as `wayproof study` prints them.

        Raises:
            InputError: As of `table`.
        """
        planned = self._planned()
        rows, foreign = read_own_rows(planned, Store(self.folder), allow_plugins=True)
        return conclude(self.file, planned, rows, foreign)

    def compare(self, before: RecordedStudy, gates: Sequence[str] = ()) -> Comparison:
        """Compare its episodes with those of an earlier study, as `wayproof compare` does.

        Args:
            before: The reference.
            gates: Conditions on this study against it; the default ones if none.

        Raises:
            InputError: No episode is in both, or a gate is malformed.
        """
        found = compare(before.folder, self.folder, gates, allow_plugins=True).result
        changed = [
            {**asdict(one), "arm": name_of(one.arm), "better_or_worse": SIDES[one.side]}
            for one in found.changes
        ]
        judged = [{"gate": gate_in_words(one), "verdict": one.verdict} for one in found.gates]
        return Comparison(
            found.verdict,
            pa.Table.from_pylist(changed).drop_columns(["side"] if changed else []),
            pa.Table.from_pylist(judged),
            found.lost,
        )

    def episode(self, key: str) -> RecordedEpisode:
        """Open the log of an episode by its key, as in the table.

        Raises:
            InputError: There is no such log.
        """
        return open(Store(self.folder).log(key))

    def _planned(self) -> list[Planned]:
        return plan_episodes(self.file, Store(self.folder).read_contents())


SIDES = {"bad": "worse", "good": "better", "": ""}


class Comparison(NamedTuple):
    """Comparison of two studies.

    Attributes:
        verdict: `held`, `failed`, `inconclusive` or `incomplete`.
        changes: A row for each arm and figure, those that are surely worse first.
        gates: A row for each gate and arm.
        lost: Episodes that failed, those first that were won before.
    """

    verdict: str
    changes: pa.Table
    gates: pa.Table
    lost: tuple[Lost, ...]


def study(
    what: Path | str,
    *,
    settings: Mapping[str, object] | None = None,
    out: Path | str | None = None,
    jobs: int = 1,
    allow_plugins: bool = False,
) -> RecordedStudy:
    """Run a study, or open the folder of one that has been run.

    Args:
        what: A study file, the name of a packaged study, or the folder of a study, which is opened.
        settings: Fields of the study or settings of its episodes, as `--set` takes them.
        out: Folder of its logs; `logs/NAME` if none. Episodes that are in it are kept.
        jobs: Number of processes.
        allow_plugins: Whether code that the study names may run.

    Raises:
        InputError: There is no such study, a field is wrong, or the folder cannot be written.
    """
    path = Path(what)
    if path.is_dir() and settings is None and out is None:
        return RecordedStudy(path, Store(path).read_study(allow_plugins))
    pairs = [f"{name}={text_of(value)}" for name, value in (settings or {}).items()]
    asked = read_study(str(what), allow_plugins, pairs)
    store = Store(Path(out) if out is not None else Path("logs") / asked.folder)
    asked = continued(asked, store)
    with ProcessEngine(jobs, asked.bounds) as engine:
        run_study(asked, plan_episodes(asked), store, engine, lambda _: None)
    return RecordedStudy(store.folder, store.read_study(allow_plugins))
