"""Interface of a verb of the command line, and all that several verbs share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from wayproof.harness.cli.arguments import EachKeyOnce
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.config import StackConfig
    from wayproof.harness.log.reader import Log
    from wayproof.harness.recordings.recording import RecordingOptions
    from wayproof.harness.study.study import StudyResult

Document = dict[str, Any]

AddArguments = Callable[[argparse.ArgumentParser], object]
"""Declaration of arguments of a verb."""

LOGS = Path("logs")

MAX_CHECKED = 600.0
"""Default simulated time after which `--check` starts no further simulation, s."""


@dataclass(frozen=True)
class Verb:
    """One verb: `wayproof NAME ...`.

    Attributes:
        help: One line that says what the verb does.
        add_arguments: Declares the arguments, except `--json`.
        run: Runs the verb; returns the exit code and the document that `--json` prints. It imports
            what it needs by itself, so that `--help` does not load the simulator.
        example: Command line that can be typed.
        kinds: Verbs of their own by the word that follows the name: `wayproof NAME KIND ...`.
    """

    help: str
    add_arguments: AddArguments
    run: Callable[[argparse.Namespace, Console], tuple[int, Document]]
    example: str
    kinds: Mapping[str, Verb] = field(default_factory=dict)


def arguments(*each: AddArguments) -> AddArguments:
    """Return the declaration of several arguments together."""

    def add(parser: argparse.ArgumentParser) -> None:
        for one in each:
            one(parser)

    return add


def arg(spec: str, text: str, kind: type = str, default: Any = None, **more: Any) -> AddArguments:
    """Return the declaration of one argument.

    Args:
        spec: `NAME` of a positional one, `--name VALUE` of an option, `--name` of a switch.
        text: Help; the default is added to it.
        kind: Type of the value.
        default: Value where none is given.
        more: Further settings of `ArgumentParser.add_argument`.
    """
    name, _, value = spec.partition(" ")
    settings: dict[str, Any] = {"help": text, "default": default, **more}
    if not name.startswith("--"):
        settings["metavar"], name = name, settings.pop("dest", name.lower())
    elif not value:
        settings = {"action": "store_true", **settings, "default": default or False}
    else:
        settings["metavar"] = value
    if settings.get("action") not in ("store_true", "store_false"):
        settings["type"] = kind
        if default not in (None, []):
            settings["help"] += f" (default: {default})"
    return lambda parser: parser.add_argument(name, **settings)


add_plugins = arg(
    "--allow-plugins",
    "run the planner or controller that a log or study names as module:Class or FILE.py:Class",
)
"""Permission to run code that logs and study files name."""

add_log = arg("LOG", "log file", Path)

add_log_paths = arguments(arg("LOG", "log file, repeatable", Path, nargs="+"), add_plugins)

add_unchecked = arg(
    "--unchecked", "read the log even if its result does not follow from its content"
)

add_log_folder = arg("--logs FOLDER", "folder for new logs", Path, LOGS)

add_log_file = arg("--log FILE", "log file (default: in the folder of --logs)", Path)

add_settings = arg(
    "--set KEY=VALUE",
    "override a setting, repeatable; 'wayproof list' shows the names",
    default=[],
    action=EachKeyOnce,
)

add_perturb = arg("--perturb KIND:SEVERITY[:MODE]", "break one assumption, at a severity of 1 to 5")

add_prior = arg(
    "--prior FILE",
    "map of another day that may guide: .yaml, .bt, .ot, .map, .mcap, .ply, .spz or a world file; "
    "or truth, the world's own geometry; prior.* says where it lies and what it may do",
)

add_stack = arguments(
    arg(
        "--stack STACK",
        "put a stack on trial: a name of 'wayproof list', module:Class, file.py:Class, "
        "policy:FILE.onnx, exec:COMMAND, unix:PATH, tcp:HOST:PORT or ros2[:KEY=VALUE,...]",
    ),
    arg("--guard", "brake where the referee does not admit a command"),
)

add_check = arg(
    "--check SECONDS",
    "check causes of failure by simulating again with one thing corrected at a time, for "
    f"at most so much simulated time (default {MAX_CHECKED:g} s)",
    float,
    nargs="?",
    const=MAX_CHECKED,
)

add_summaries = arguments(
    arg("--markdown FILE", "write the verdict for a pull request", Path),
    arg(
        "--junit FILE",
        "write each gate as a test case for a CI server; an inconclusive one is an error",
        Path,
    ),
)

add_sensors = arguments(
    arg(
        "--sensor TOPIC",
        "sensor of a recording to read, repeatable (default: the only one)",
        default=[],
        action="append",
    ),
    arg("--pose TOPIC", "topic or frame of a recording's poses (default: the only one)"),
)

add_recording = arguments(
    arg("RECORDING", "file or folder", Path),
    arg("--format NAME", "format (default: found)"),
    add_sensors,
    arg("--body FRAME", "frame of the body (default: the poses')"),
    arg(
        "--mount X,Y,Z[,YAW[,PITCH[,ROLL]]]",
        "sensor in the body's frame, m and degrees, where the recording does not say; of a "
        "folder the body under the sensor whose poses it has",
    ),
    arg("--begin S", "first second read", float, 0.0),
    arg("--end S", "last second read", float),
    arg("--range-max M", "longest range that counts, m", float),
    arg("--max-gap S", "longest time between two poses, s", float, 1.0),
    arg("--intrinsics FX,FY,CX,CY", "of depth images, pixels, where the recording does not say"),
    arg("--depth-scale N", "units of a depth image in a metre (default: the format's)", float),
    arg("--pixel-stride N", "read each N-th row and column of depth images", int, 4),
    arg("--no-return-is-free", "a beam without return was free up to the longest range"),
)


def recording_options(options: argparse.Namespace) -> RecordingOptions:
    """Read the options of a recording.

    Raises:
        InputError: A mount or intrinsics are not made of as many numbers.
    """
    from wayproof.harness.recordings.poses import mount_of
    from wayproof.harness.recordings.recording import RecordingOptions

    intrinsics = None
    if options.intrinsics is not None:
        intrinsics = numbers("--intrinsics", options.intrinsics)
        if len(intrinsics) != 4:
            raise InputError(f"--intrinsics {options.intrinsics}: expected FX,FY,CX,CY, in pixels")
    return RecordingOptions(
        format=options.format,
        sensors=tuple(options.sensor),
        pose=options.pose,
        body=options.body,
        mount=None if options.mount is None else mount_of(numbers("--mount", options.mount)),
        start_s=options.begin,
        end_s=options.end,
        range_max=options.range_max,
        missing_returns_free=options.no_return_is_free or None,
        intrinsics=intrinsics and tuple(intrinsics),  # type: ignore[arg-type]  # four, as checked
        depth_scale=options.depth_scale,
        pixel_stride=options.pixel_stride,
        max_gap_s=options.max_gap,
    )


def numbers(name: str, text: str) -> list[float]:
    """Read numbers with commas between them.

    Raises:
        InputError: One is not a number.
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{name} {text}: expected numbers with commas between them") from None


def write_summaries(
    options: argparse.Namespace, result: StudyResult, allow_inconclusive: bool = False
) -> None:
    """Write the files of `--markdown` and `--junit`.

    Raises:
        InputError: A file cannot be written.
    """
    from wayproof.harness.outputs import written_whole
    from wayproof.harness.study.report.summary import junit, markdown

    texts = (
        (options.markdown, markdown(result)),
        (options.junit, junit(result, allow_inconclusive)),
    )
    for path, text in texts:
        if path is not None:
            with written_whole(path, "summary") as partial:
                partial.write_text(text, encoding="utf-8")


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print(f"wayproof: warning: {text}", file=sys.stderr)


def warn_of_changed_plugins(log: Log) -> list[str]:
    """Warn of each user's class whose file has changed since the log was written.

    Returns:
        Names of these classes.
    """
    from wayproof.harness.user_code import plugin_digests

    now = plugin_digests(log.config)
    changed = [name for name, digest in log.plugins.items() if now.get(name, digest) != digest]
    for name in changed:
        warn(
            f"the file of '{name}' has changed since the log was written "
            f"(SHA-256 {log.plugins[name][:12]} then, {now[name][:12]} now)"
        )
    return changed


def check_log(path: Path, options: argparse.Namespace) -> None:
    """Refuse a log whose result, chain or hashes do not follow from its content.

    Raises:
        InputError: The file is no log or damaged, or it contradicts itself and `--unchecked` is
            not given.
    """
    if options.unchecked:
        return
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.consistency import refuse_contradictions

    log = open_log(path, options.allow_plugins)
    refuse_contradictions(log, hint="; --unchecked reads it anyway")


def check_ending(name: str, path: Path | None, *endings: str) -> None:
    """Refuse a name of a file with another ending.

    Raises:
        InputError: It has one.
    """
    if path is not None and path.suffix not in endings:
        expected = " or ".join(endings)
        raise InputError(f"{name}: got '{path}', expected a name that ends in {expected}")


Replay = Callable[[Path, argparse.Namespace, Console], tuple[bool, Document]]
"""Replay of one log: prints its verdict, returns whether it is good and the document."""


def replay_each(
    replay: Replay, options: argparse.Namespace, console: Console
) -> tuple[int, Document]:
    """Replay one or more logs; exit code 1 if any is not good."""
    from wayproof.harness.log.reader import open_log

    outcomes = []
    for path in options.log:
        changed = warn_of_changed_plugins(open_log(path, True)) if options.allow_plugins else []
        good, document = replay(path, options, console)
        outcomes.append((good, {**document, "changed_plugins": changed}))
    code = 0 if all(good for good, _ in outcomes) else 1
    return code, one_or_all("replays", [document for _, document in outcomes])


def one_or_all(name: str, documents: list[Document]) -> Document:
    """Return the document of a verb that takes logs: flat for one log, else a list under `name`."""
    return documents[0] if len(documents) == 1 else {name: documents}


def stack_of(options: argparse.Namespace) -> StackConfig:
    """Return the stack that `--stack` and `--guard` give; the built-in one without.

    Raises:
        InputError: A guard, which the built-in stack has no use for.
    """
    from wayproof.harness.config import BUILTIN, StackConfig

    stack = StackConfig(BUILTIN if options.stack is None else options.stack, options.guard)
    refuse_idle_guard(stack)
    return stack


def refuse_idle_guard(stack: StackConfig) -> None:
    """Refuse a guard of the built-in stack, which would have no effect.

    Raises:
        InputError: It is one.
    """
    from wayproof.harness.config import BUILTIN

    if stack.guard and stack.name == BUILTIN:
        raise InputError("--guard: expected --stack; the built-in stack has no referee")
