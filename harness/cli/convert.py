"""`wayproof convert`: write a log as a file for another viewer, or a recording as a bag of ROS."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_plugins, add_unchecked, check_log
from wayproof.harness.errors import InputError

ENDING = ".mcap"


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the file."""
    began = time.perf_counter()
    write = _foxglove if options.foxglove is not None else _bag
    document = write(options, console)
    out = Path(document["out"])
    files = [one for one in (out, *out.rglob("*")) if one.is_file()]
    size, wall = 1e-6 * sum(one.stat().st_size for one in files), time.perf_counter() - began
    what = "decisions" if "decisions" in document else "messages"
    console.print(
        f"{document[what]} {what} in {wall:.1f} s: {out}, {size:.1f} MB",
        soft_wrap=True,
        highlight=False,
    )
    return 0, document | {"megabytes": size, "wall_time_s": wall}


def _foxglove(options: argparse.Namespace, console: Console) -> Document:
    out: Path = options.foxglove
    if out.suffix != ENDING:
        raise InputError(f"--foxglove: got '{out}', expected a name that ends in {ENDING}")
    if out.resolve() == options.log.resolve():
        raise InputError(f"--foxglove: got the log itself, '{out}'")
    check_log(options.log, options)
    from wayproof.harness.viewer.foxglove import write_foxglove

    with console.status("making the maps again"):
        decisions = write_foxglove(options.log, out, options.allow_plugins)
    return {"out": str(out), "decisions": decisions}


def _bag(options: argparse.Namespace, console: Console) -> Document:
    """Write a recording of any format; of a log, its maps and plans as well."""
    from wayproof.harness.recordings.bags.writing import BagKind
    from wayproof.harness.recordings.formats import open_recording
    from wayproof.harness.recordings.recording import RecordingOptions
    from wayproof.harness.viewer.ros_bag import check_name, convert, open_log_of

    kind: BagKind = "ros1" if options.ros1 else options.storage
    out: Path = options.ros1 or options.ros2
    check_name(out, kind)
    chosen = RecordingOptions(sensors=tuple(options.sensor), pose=options.pose)
    recording = open_recording(options.log, options=chosen)
    if recording.format == "wayproof":
        check_log(options.log, options)
    log = open_log_of(recording, options.log, options.allow_plugins)
    with console.status("writing the bag"):
        messages = convert(recording, log, out, kind)
    for what, count in recording.faults.items():
        console.print(f"{count} {what}", soft_wrap=True, highlight=False)
    return {"out": str(out), "messages": messages, "faults": recording.faults}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "log", metavar="LOG", type=Path, help="log, or recording for --ros1, --ros2"
    )
    outputs = parser.add_mutually_exclusive_group(required=True)
    outputs.add_argument(
        "--foxglove",
        type=Path,
        metavar="FILE.mcap",
        help="MCAP file with schemas that Foxglove draws",
    )
    outputs.add_argument("--ros2", type=Path, metavar="FOLDER", help="bag of ROS 2")
    outputs.add_argument("--ros1", type=Path, metavar="FILE.bag", help="bag of ROS 1")
    parser.add_argument(
        "--storage", choices=("mcap", "sqlite"), default="mcap", help="storage of --ros2"
    )
    parser.add_argument(
        "--sensor",
        action="append",
        default=[],
        metavar="TOPIC",
        help="sensor of a recording, repeatable (default: the only one)",
    )
    parser.add_argument("--pose", metavar="TOPIC", help="topic or frame of a recording's poses")
    add_unchecked(parser)
    add_plugins(parser)


VERB = Verb(
    help="convert a log for Foxglove, or a log or recording to a bag of ROS",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof convert logs/warehouse-drone-3.mcap --foxglove drone.mcap",
)
