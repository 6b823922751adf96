"""`wayproof export`: write what a log holds as files that other tools read."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import (
    Document,
    Verb,
    arg,
    arguments,
    check_ending,
    check_log,
    recording_options,
)
from wayproof.harness.errors import InputError, unknown_name

if TYPE_CHECKING:
    from wayproof.harness.recordings.bags.writing import BagKind

Write = Callable[[Path, argparse.Namespace], Document]
"""Writer of a file from the log or recording that the options name; returns its facts."""


class Output(NamedTuple):
    """One kind of file: its contents, the function that writes it, and the value in the help."""

    help: str
    write: Write
    value: str = "FILE"


def _table(kind: str, default: str) -> Write:
    """Return the writer of a kind of file from a table of the log."""

    def write(path: Path, options: argparse.Namespace) -> Document:
        from wayproof.harness.log.reader import open_log
        from wayproof.harness.tables.files import WRITERS
        from wayproof.harness.tables.tables import TABLES

        name = options.table or default
        if name not in TABLES:
            raise unknown_name("table", name, TABLES)
        table = TABLES[name](open_log(options.log, options.allow_plugins))
        WRITERS[kind](table, path)
        return {"table": name, "rows": len(table)}

    return write


def _map(path: Path, options: argparse.Namespace) -> Document:
    """Write the map of a decision in the format of the file's ending."""
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.map_files.files import write_map

    log = open_log(options.log, options.allow_plugins)
    decision, cells = write_map(log, path, options.at)
    return {"decision": decision, "cells": cells}


def _foxglove(path: Path, options: argparse.Namespace) -> Document:
    check_ending("--foxglove", path, ".mcap")
    from wayproof.harness.viewer.foxglove import write_foxglove

    return {"decisions": write_foxglove(options.log, path, options.allow_plugins)}


def _bag(path: Path, options: argparse.Namespace) -> Document:
    """Write a bag of a recording of any format; of a log, its maps and plans as well."""
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.recordings.formats import open_recording
    from wayproof.harness.viewer.ros_bag import convert

    kind: BagKind = "ros1" if path.suffix == ".bag" else options.storage
    if kind != "ros1" and path.suffix in (".mcap", ".db3", ".bag"):
        raise InputError(f"--bag: got '{path}', expected a FILE.bag, or the name of a folder")
    recording = open_recording(options.log, options=recording_options(options))
    log = None
    if recording.format == "wayproof":
        check_log(options.log, options)
        log = open_log(options.log, options.allow_plugins)
    messages = convert(recording, log, path, kind)
    return {"messages": messages, **recording.faults}


def _log(path: Path, options: argparse.Namespace) -> Document:
    """Write the readable part of an unfinished or damaged log as a valid one."""
    from wayproof.harness.log.recover import recover

    return recover(options.log, path, options.allow_plugins)._asdict()


OUTPUTS: dict[str, Output] = {
    "parquet": Output("table as Parquet", _table("parquet", "decisions")),
    "csv": Output("table as CSV, without columns of lists", _table("csv", "decisions")),
    "tum": Output("trajectory as TUM, for evo", _table("tum", "poses")),
    "kitti": Output("trajectory as KITTI poses, for evo", _table("kitti", "poses")),
    "map": Output(
        "map as .yaml and .pgm (Nav2), .bt (OctoMap), .pcd or .ply (centres of occupied cells), "
        "or .map (our own)",
        _map,
    ),
    "foxglove": Output("MCAP file with schemas that Foxglove draws", _foxglove, "FILE.mcap"),
    "bag": Output(
        "bag of a log or recording: a FILE.bag of ROS 1, or a FOLDER of ROS 2", _bag, "PATH"
    ),
    "log": Output(
        "readable part of an unfinished (.partial) or damaged log, as a valid log",
        _log,
        "FILE.mcap",
    ),
}
"""Option -> kind of file that it writes."""

TABLES = ("--parquet", "--csv", "--tum", "--kitti")
"""Options that write a table."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write each requested file."""
    requested = {name: getattr(options, f"to_{name}") for name in OUTPUTS}
    targets = {name: path for name, path in requested.items() if path is not None}
    if not targets:
        raise InputError(f"export: got no file, expected --{', --'.join(OUTPUTS)} with its name")
    _check(options, targets)
    documents = []
    for name, path in targets.items():
        with console.status(f"writing {path}"):
            facts = OUTPUTS[name].write(path, options)
        shown = ", ".join(f"{key} {value}" for key, value in facts.items())
        console.print(f"{path}: {shown}")
        documents.append({"file": str(path), "format": name, **facts})
    return 0, {"files": documents}


def _check(options: argparse.Namespace, targets: dict[str, Path]) -> None:
    """Refuse names that are taken by a log, and a log that contradicts itself.

    Raises:
        InputError: There is one.
    """
    from wayproof.harness.log.codec.container import is_mcap

    for name, path in targets.items():
        if path.resolve() == options.log.resolve():
            raise InputError(f"--{name}: got the log itself, '{path}'")
        if name not in ("foxglove", "bag", "log") and is_mcap(path):  # these check it themselves
            raise InputError(f"--{name} '{path}': a log or recording, expected another name")
    if "log" in targets:
        if len(targets) > 1:
            raise InputError("--log: goes with no other file; export the valid log's afterwards")
    elif set(targets) != {"bag"}:
        check_log(options.log, options)


VERB = Verb(
    help="write what a log holds as files: tables, trajectories, its map, bags, a readable log",
    add_arguments=arguments(
        arg("LOG", "log, or recording for --bag", Path),
        *(
            arg(f"--{name} {one.value}", one.help, Path, dest=f"to_{name}")
            for name, one in OUTPUTS.items()
        ),
        arg(
            "--table TABLE",
            "decisions, truth, poses (the estimated ones) or sweeps (default: decisions; of a "
            "trajectory: poses)",
            needs=TABLES,
        ),
        arg("--at N", "decision whose map is written (default: the last)", int, needs=["--map"]),
        arg(
            "--storage KIND",
            "storage of a bag of ROS 2",
            default="mcap",
            choices=("mcap", "sqlite"),
            needs=["--bag"],
        ),
        shared.sensors,
        shared.unchecked,
        shared.plugins,
    ),
    run=run,
    example="wayproof export logs/warehouse-drone-3.mcap --parquet decisions.parquet",
)
