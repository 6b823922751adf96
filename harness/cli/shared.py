"""Arguments that several verbs share."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from wayproof.harness.cli.arguments import EachKeyOnce
from wayproof.harness.cli.verb import arg, arguments, numbers
from wayproof.harness.errors import InputError

LOGS = Path("logs")

MAX_CHECKED = 600.0
"""Default simulated time after which `--check` starts no further simulation, s."""


def _intrinsics(text: str) -> tuple[float, ...]:
    values = numbers("--intrinsics", text)
    if len(values) != 4:
        raise InputError(f"--intrinsics {text}: expected FX,FY,CX,CY, in pixels")
    return values


plugins = arg(
    "--allow-plugins",
    "run the planner or controller that a log or study names by its class",
)
"""Permission to run code that logs and study files name."""

log = arg("LOG", "log file", Path)

log_paths = arguments(arg("LOG", "log file, repeatable", Path, nargs="+"), plugins)

unchecked = arg("--unchecked", "read the log even if its result does not follow from its content")

log_folder = arg("--logs FOLDER", "folder for new logs", Path, LOGS)

log_file = arg("--log FILE", "log file (default: in the folder of --logs)", Path)

settings = arg(
    "--set KEY=VALUE",
    "override a setting, repeatable; 'wayproof list' shows the names",
    default=[],
    action=EachKeyOnce,
)

perturb = arg("--perturb KIND:SEVERITY[:MODE]", "break one assumption, at a severity of 1 to 5")

prior = arg(
    "--prior FILE",
    "prior map: .yaml, .bt, .ot, .map, .mcap, .ply, .spz, a world file, or truth; "
    "prior.* says where it lies and what it may do",
)

stack = arguments(
    arg(
        "--stack STACK",
        "put a stack on trial: a name of 'wayproof list', module:Class, file.py:Class, "
        "policy:FILE.onnx, exec:COMMAND, unix:PATH, tcp:HOST:PORT or ros2[:KEY=VALUE,...]",
    ),
    arg("--guard", "brake where the referee does not admit a command"),
)

check = arg(
    "--check SECONDS",
    "check causes of failure: simulate again with one thing corrected at a time, for at most "
    f"this simulated time (default {MAX_CHECKED:g} s)",
    float,
    nargs="?",
    const=MAX_CHECKED,
)

summaries = arguments(
    arg("--markdown FILE", "write the verdict for a pull request", Path),
    arg(
        "--junit FILE",
        "write each gate as a test case for a CI server; an inconclusive one is an error",
        Path,
    ),
)

sensors = arguments(
    arg(
        "--sensor TOPIC",
        "sensor of a recording to read, repeatable (default: the only one)",
        default=[],
        dest="sensors",
        action="append",
    ),
    arg("--pose TOPIC", "topic or frame of a recording's poses (default: the only one)"),
)

recording = arguments(
    arg("RECORDING", "file or folder", Path),
    arg("--format NAME", "format (default: found)"),
    sensors,
    arg("--body FRAME", "frame of the body (default: the poses')"),
    arg(
        "--mount X,Y,Z[,YAW[,PITCH[,ROLL]]]",
        "sensor in the body's frame, m and degrees, if the recording does not say; for a "
        "folder, the body in the sensor's frame",
        partial(numbers, "--mount"),
    ),
    arg("--begin S", "first second read", float, 0.0),
    arg("--end S", "last second read", float),
    arg("--range-max M", "longest range that counts, m", float),
    arg("--max-gap S", "longest time between two poses, s", float, 1.0),
    arg(
        "--intrinsics FX,FY,CX,CY",
        "of depth images, pixels, if the recording does not say",
        _intrinsics,
    ),
    arg("--depth-scale N", "units of a depth image in a metre (default: the format's)", float),
    arg("--pixel-stride N", "read each N-th row and column of depth images", int, 4),
    arg("--no-return-is-free", "a beam without return was free up to the longest range"),
)

inconclusive = arg(
    "--allow-inconclusive",
    "exit code 0 for inconclusive gates, except those that must be 'proven'",
)
