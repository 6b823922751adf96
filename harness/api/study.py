"""A study in its folder: its table and its verdict."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from wayproof.harness.api.episode import RecordedEpisode, open
from wayproof.harness.errors import InputError
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.plan import Planned, plan_episodes
from wayproof.harness.study.rows import arrow_table, read_row
from wayproof.harness.study.store import Store


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
        found = [read_row(store, one) for one in planned]
        rows = [one for one in found if one is not None]
        if not rows:
            raise InputError(f"study '{self.folder}': no episode has ended")
        table = arrow_table(rows)
        logs = [str(store.log(row.key)) if row.chain else None for row in rows]
        return table.append_column("log", pa.array(logs, pa.string()))

    def episode(self, key: str) -> RecordedEpisode:
        """Open the log of an episode by its key, as in the table.

        Raises:
            InputError: There is no such log.
        """
        return open(Store(self.folder).log(key))

    def _planned(self) -> list[Planned]:
        return plan_episodes(self.file, Store(self.folder).read_contents())


def study(folder: Path | str) -> RecordedStudy:
    """Open the folder of a study that `wayproof study` has run.

    Raises:
        InputError: It is no folder of a study.
    """
    return RecordedStudy(Path(folder), Store(Path(folder)).read_study())
