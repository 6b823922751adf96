"""Trial of other projects' worlds: each imported, run, replayed and explained, in one table.

    python -m wayproof.harness.bench.maintain.world_folder FOLDER... --out table.md

Each world has a process and a time limit of its own. A row says how far it came: the refusal in one
line, or the outcome with its cause, whether the log replays, and whether a decision is explained.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from wayproof.harness.attribution import read_case
from wayproof.harness.config import Config, override
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
"""Endings of the files that are tried in a folder; a file that is named is tried whatever it is."""

SMALLER_WORDS = ("test", "tests", "hostile")
"""Folders that are left out: their worlds are broken on purpose, or of one feature."""


@dataclass
class Row:
    """Course of one world; empty fields were not reached.

    Attributes:
        world: Path of the file.
        solids: Number of solids.
        refused: Line of the refusal by the import or the run.
        notes: Number of notes of the import.
        way: From start to goal, as the import chose them.
        outcome: Of the episode.
        cause: Of its failure.
        decisions: Number of decisions.
        replayed: `identical` or `differs`.
        explained: `yes`, or why not.
        seconds: Time of all, s.
        fault: A fault of Wayproof's own: exception, or the time limit.
    """

    world: str
    solids: str = ""
    refused: str = ""
    notes: str = ""
    way: str = ""
    outcome: str = ""
    cause: str = ""
    decisions: str = ""
    replayed: str = ""
    explained: str = ""
    seconds: str = ""
    fault: str = ""


def try_world(path: Path, robot: str, settings: Sequence[str], models: Sequence[Path]) -> Row:
    """Import, run, replay and explain one world."""
    row, begin = Row(str(path)), time.monotonic()
    try:
        with tempfile.TemporaryDirectory() as folder:
            _through(row, path, robot, settings, models, Path(folder))
    except (WorldFileError, InputError) as error:
        row.refused = " ".join(str(error).split())
    row.seconds = f"{time.monotonic() - begin:.0f}"
    return row


def _through(
    row: Row, path: Path, robot: str, settings: Sequence[str], models: Sequence[Path], folder: Path
) -> None:
    spec = find_robot(Config(world="", robot=robot, seed=0)).spec
    options = ImportOptions(
        skip_missing=True, model_paths=tuple(models), robot_radius=spec.radius,
        robot_height=spec.height,
    )  # fmt: skip
    world, notes = import_world(path, options)
    row.solids, row.notes = str(len(world.solids)), str(len(notes))
    row.way = next((note.split(":")[1].strip() for note in notes if note.startswith("way")), "")
    file = folder / "world.xml"
    file.write_text(world.text, encoding="utf-8")
    config = override(Config(str(file), robot, 0), settings)
    warm_up(config)
    run_episode(build(config), folder / "log.mcap")
    log = open_log(folder / "log.mcap")
    row.outcome = f"{log.result['outcome']}: {log.result.get('reason', '')}"
    row.cause = str(log.result.get("cause", "") or "")
    replayed = replay(log.path)
    row.decisions = str(replayed.decisions)
    row.replayed = "identical" if replayed.identical else "differs"
    case = read_case(log)
    number = max(replayed.decisions - 1, 0)
    make_card(case.as_of(number), number, case.as_of(number).navigator_at(number))
    row.explained = "yes"


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
    parser.add_argument("--one", action="store_true", help="print the row of one world as JSON")
    options = parser.parse_args(arguments)
    if options.one:
        row = try_world(options.paths[0], options.robot, options.set, options.model_path)
        print(json.dumps(asdict(row)))
        return
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
