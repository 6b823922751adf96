"""Trial of other projects' worlds: each imported, run, replayed and explained, in one table.

    python -m tests.tools.world_folder FOLDER... --out table.md

Each world has a process and a time limit of its own. A row says how far it came: the refusal in one
line, or the outcome with its cause, whether the log replays, and whether a decision is explained.
With `--keep` world files and logs stay.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from wayproof.harness.attribution import read_case
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.explain import make_card
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.robots import find_robot
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up
from wayproof.models.world_files import FORMATS, ImportOptions, WorldFileError, import_world

WORLD_ENDINGS = (".world", ".sdf", ".xml", ".mjcf", ".yaml", ".bt")
"""Endings of the files that are tried in a folder; a named file is tried with any ending."""

SMALLER_WORDS = ("test", "tests", "hostile")
"""Folders that are left out: their worlds are broken on purpose, or of one feature."""


@dataclass
class Row:
    """Course of one world; empty fields were not reached.

    Attributes:
        world: Path of the file.
        solids: Number of solids.
        import_s: Processor time of the import and its children, s.
        import_mib: Peak memory of the process until then, MiB.
        refused: Line of the refusal by the import or the run.
        notes: Number of notes of the import.
        way: Way from start to goal, as the import chose them.
        outcome: Outcome of the episode.
        clearance: Least true clearance, m.
        cause: Cause of its failure.
        decisions: Number of decisions.
        replayed: `identical` or `differs`.
        explained: `yes`, or why not.
        seconds: Time of all, s.
        fault: A fault of Wayproof's own: exception, or the time limit.
    """

    world: str
    solids: str = ""
    import_s: str = ""
    import_mib: str = ""
    refused: str = ""
    notes: str = ""
    way: str = ""
    outcome: str = ""
    clearance: str = ""
    cause: str = ""
    decisions: str = ""
    replayed: str = ""
    explained: str = ""
    seconds: str = ""
    fault: str = ""


def try_world(
    path: Path, robot: str, settings: Sequence[str], models: Sequence[Path],
    keep: Path | None = None,
) -> Row:  # fmt: skip
    """Import, run, replay and explain one world; its files are kept in a folder if given."""
    row, begin = Row(str(path)), time.monotonic()
    try:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) if keep is None else keep
            _fill_row(row, path, robot, settings, models, folder)
    except (WorldFileError, InputError) as error:
        row.refused = " ".join(str(error).split())
    row.seconds = f"{time.monotonic() - begin:.0f}"
    return row


def _fill_row(
    row: Row, path: Path, robot: str, settings: Sequence[str], models: Sequence[Path], folder: Path
) -> None:
    spec = find_robot(Config(world="", robot=robot, seed=0)).spec
    options = ImportOptions(
        skip_missing=True, model_paths=tuple(models), robot_radius=spec.radius,
        robot_height=spec.height, robot_step=spec.step_height,
    )  # fmt: skip
    before = _processor_s()
    world, notes = import_world(path, options)
    row.import_s, row.import_mib = f"{_processor_s() - before:.1f}", f"{_peak_mib():.0f}"
    row.solids, row.notes = str(len(world.solids)), str(len(notes))
    row.way = next((note.split(":")[1].strip() for note in notes if note.startswith("way")), "")
    file = folder / f"{_plain_name(path)}.xml"
    file.write_text(world.text, encoding="utf-8")
    config = override(Config(str(file), robot, 0), settings)
    warm_up(config)
    target = file.with_suffix(".mcap")
    run_episode(build(config), target)
    log = open_log(target)
    row.outcome = f"{log.result['outcome']}: {log.result.get('reason', '')}"
    clearance = log.result.get("min_clearance_m")
    row.clearance = "" if clearance is None else f"{float(clearance):.2f}"
    row.cause = str(log.result.get("cause", "") or "")
    replayed = replay(log.path)
    row.decisions = str(replayed.decisions)
    row.replayed = "identical" if replayed.identical else "differs"
    case = read_case(log)
    number = max(replayed.decisions - 1, 0)
    make_card(case.as_of(number), number, case.as_of(number).navigator_at(number))
    row.explained = "yes"
    file.with_suffix(".txt").write_text("\n".join(notes) + "\n", encoding="utf-8")


def _plain_name(path: Path) -> str:
    return "-".join(re.sub(r"[^\w.-]+", "_", part) for part in path.with_suffix("").parts[-3:])


def _processor_s() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def worlds_in(paths: Sequence[Path]) -> Iterator[Path]:
    """Return the files that are named, and those in folders whose ending is a world's."""
    for path in paths:
        if path.is_file():
            yield path
        for file in sorted(path.rglob("*")) if path.is_dir() else []:
            inner = file.relative_to(path).parts[:-1]
            if file.suffix in WORLD_ENDINGS and file.is_file() and "model.sdf" != file.name:
                if not set(inner) & set(SMALLER_WORDS):
                    yield file


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a table in Markdown, with a line of counts."""
    names = [field.name for field in fields(Row)]
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    for row in rows:
        cells = [str(value).replace("|", "/") for value in asdict(row).values()]
        lines.append("| " + " | ".join(cells) + " |")
    ran = [row for row in rows if row.outcome]
    reached = sum(row.outcome.startswith("success") for row in ran)
    same = sum(row.replayed == "identical" for row in ran)
    refused, faults = (sum(bool(text) for text in texts) for texts in (
        [row.refused for row in rows], [row.fault for row in rows]))  # fmt: skip
    lines += ["", f"{len(rows)} worlds: {len(ran)} ran, {reached} reached, {same} replayed "
              f"identical, {refused} refused, {faults} faults"]  # fmt: skip
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Try every world and write the table after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "paths", nargs="+", type=Path, help=f"folders or files: {', '.join(FORMATS)}"
    )
    parser.add_argument("--out", type=Path, default=Path("worlds.md"), help="the table")
    parser.add_argument("--robot", default="drone")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--model-path", action="append", type=Path, default=[])
    parser.add_argument("--limit", type=float, default=600.0, help="time for one world, s")
    parser.add_argument("--keep", type=Path, help="folder for world files and logs")
    parser.add_argument("--one", action="store_true", help="print the row of one world as JSON")
    options = parser.parse_args(arguments)
    if options.one:
        path, robot = options.paths[0], options.robot
        row = try_world(path, robot, options.set, options.model_path, options.keep)
        print(json.dumps(asdict(row)))
        return
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for path in worlds_in(options.paths):
        rows.append(_in_process(path, options))
        options.out.write_text(table(rows), encoding="utf-8")
        last = rows[-1]
        print(f"{path}: {last.outcome or last.refused or last.fault}", flush=True)


def _in_process(path: Path, options: argparse.Namespace) -> Row:
    command = [sys.executable, "-m", __spec__.name, "--one", str(path), "--robot", options.robot]
    command += [word for setting in options.set for word in ("--set", setting)]
    command += [word for folder in options.model_path for word in ("--model-path", str(folder))]
    command += [] if options.keep is None else ["--keep", str(options.keep)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=options.limit, check=False)
    except subprocess.TimeoutExpired:
        return Row(str(path), fault=f"took more than {options.limit:g} s")
    lines = done.stdout.decode(errors="replace").splitlines()
    if done.returncode or not lines:
        text = " ".join(done.stderr.decode(errors="replace").split())[-200:]
        return Row(str(path), fault=text or f"exit code {done.returncode}")
    return Row(**json.loads(lines[-1]))


if __name__ == "__main__":
    main()
