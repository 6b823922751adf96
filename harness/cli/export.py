"""`wayproof export`: write the contents of a log as files that other tools read."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_plugins, add_unchecked, check_log
from wayproof.harness.errors import InputError, unknown_name

if TYPE_CHECKING:
    from wayproof.harness.log.reader import Log


class Output(NamedTuple):
    """One kind of file: its contents, and the function that writes it."""

    help: str
    write: Callable[[Log, Path, argparse.Namespace], Document]


def _write_table(kind: str, default: str) -> Callable[[Log, Path, argparse.Namespace], Document]:
    """Return the writer of a kind of file from a table of the log."""

    def write(log: Log, path: Path, options: argparse.Namespace) -> Document:
        from wayproof.harness.tables.files import WRITERS
        from wayproof.harness.tables.tables import TABLES

        name = options.table or default
        if name not in TABLES:
            raise unknown_name("table", name, TABLES)
        table = TABLES[name](log)
        WRITERS[kind](table, path)
        return {"table": name, "rows": len(table)}

    return write


def _write_map(log: Log, path: Path, options: argparse.Namespace) -> Document:
    """Write the map of a decision in the format of the file's ending."""
    from wayproof.harness.map_files.files import write_map

    decision, cells = write_map(log, path, options.at)
    return {"decision": decision, "cells": cells}


OUTPUTS: dict[str, Output] = {
    "parquet": Output("table as Parquet", _write_table("parquet", "decisions")),
    "csv": Output("table as CSV, without columns of lists", _write_table("csv", "decisions")),
    "tum": Output("trajectory as TUM, for evo", _write_table("tum", "poses")),
    "kitti": Output("trajectory as KITTI poses, for evo", _write_table("kitti", "poses")),
    "map": Output(
        "map as .yaml and .pgm (Nav2), .bt (OctoMap), .pcd or .ply (centres of occupied cells), "
        "or .map (our own)",
        _write_map,
    ),
}
"""Option -> kind of file that it writes."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write each requested file."""
    from wayproof.harness.log.codec.container import is_mcap
    from wayproof.harness.log.reader import open_log

    requested = {name: getattr(options, name) for name in OUTPUTS}
    targets = {name: path for name, path in requested.items() if path is not None}
    if not targets:
        raise InputError(f"export: got no file, expected --{' FILE, --'.join(OUTPUTS)} FILE")
    for name, path in targets.items():
        if path.resolve() == options.log.resolve():
            raise InputError(f"--{name}: got the log itself, '{path}'")
        if is_mcap(path):
            raise InputError(f"--{name} '{path}': a log or recording, expected another name")
    check_log(options.log, options)
    log = open_log(options.log, options.allow_plugins)
    documents = []
    for name, path in targets.items():
        document = OUTPUTS[name].write(log, path, options)
        facts = ", ".join(f"{key} {value}" for key, value in document.items())
        console.print(f"{path}: {facts}", soft_wrap=True, highlight=False)
        documents.append({"file": str(path), "format": name, **document})
    return 0, {"files": documents}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path, help="log file")
    for name, output in OUTPUTS.items():
        parser.add_argument(f"--{name}", type=Path, metavar="FILE", help=output.help)
    parser.add_argument(
        "--table",
        metavar="TABLE",
        help="decisions, truth, poses (the estimated ones) or sweeps (default: decisions; of a "
        "trajectory: poses)",
    )
    parser.add_argument(
        "--at", type=int, metavar="N", help="decision whose map is written (default: the last)"
    )
    add_unchecked(parser)
    add_plugins(parser)


VERB = Verb(
    help="write what a log holds as files: tables, trajectories, and its map",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof export logs/warehouse-drone-3.mcap --parquet decisions.parquet",
)
