"""HTML report of a study over recordings: one self-contained page with a row for each pass."""

from __future__ import annotations

from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.gates import gate_in_words
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.recorded_table import COLUMNS, cells, passes_of
from wayproof.harness.study.report.templates import templates
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import StudyResult, conclude, read_own_rows, verdict_in_words


def write_recorded(
    folder: Path, study: StudyFile, allow_plugins: bool = False
) -> tuple[Path, StudyResult]:
    """Write the report of a study over recordings, as `report.html` in its folder.

    Raises:
        InputError: A recording is no longer there or was changed, a log is damaged, or nothing has
            ended.
    """
    store = Store(folder)
    planned = plan_episodes(study, store.read_contents())
    rows, foreign = read_own_rows(planned, store, allow_plugins)
    if not rows:
        raise InputError(f"study '{folder}': no pass has ended")
    result = conclude(study, planned, rows, foreign)
    first = planned[0].arm
    page = templates().get_template("recorded.html.j2")
    text = page.render(
        site=False,
        result=result,
        verdict=verdict_in_words(result),
        passes=list(passes_of(rows, first.variant, first.stack)),
        columns=COLUMNS,
        cells=cells,
        words=gate_in_words,
        folder=folder,
    )
    path = folder / "report.html"
    with written_whole(path, "report") as partial:
        partial.write_text(text, encoding="utf-8")
    return path, result
