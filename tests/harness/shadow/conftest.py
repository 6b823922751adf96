from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.shadow.summary import summarize

FR079 = Path(__file__).resolve().parents[3] / "examples/recordings/fr079/fr079-200.clf.bz2"

BODY = """
name = "wheeled"
radius = 0.25
height = 0.4

[limits]
speed = 1.0
acceleration = 1.0
jerk = 10.0
yaw_rate = 1.0
"""

BEAMS = 180
ANGLES = np.radians(-90.0 + np.arange(BEAMS))


@pytest.fixture(scope="session")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "wheeled.toml"
    path.write_text(BODY)
    return path


@pytest.fixture(scope="session")
def fr079_log(tmp_path_factory, robot):
    """Log of the first 12 s of a real run."""
    folder = tmp_path_factory.mktemp("fr079")
    return shadowed(FR079, robot, folder / "fr079.mcap", end=12.0)


def shadowed(recording, robot, log, settings=(), end=None, **asked):
    opened = open_recording(recording, options=RecordingOptions(end=end))
    prepared = prepare(opened, find_body(str(robot)), settings, **asked)
    return run_recording(opened, prepared, log)


def verdict_on(log):
    return summarize(assess(log))


def corridor_scan(x, y, yaw, *, ahead=8.0, half_width=1.0, block=None):
    """Ranges of a laser in a corridor along x, closed at `ahead`, with a post at `block` (x, y)."""
    c, s = np.cos(yaw + ANGLES), np.sin(yaw + ANGLES)
    with np.errstate(divide="ignore"):
        ranges = np.where(c > 0.0, (ahead - x) / c, (-3.0 - x) / c)
        ranges = np.minimum(ranges, np.where(s > 0.0, (half_width - y) / s, (-half_width - y) / s))
    if block is not None:
        dx, dy = block[0] - x, block[1] - y
        along, off = dx * c + dy * s, np.abs(-dx * s + dy * c)
        met = (along > 0.0) & (off < 0.15)
        ranges = np.where(met, np.minimum(ranges, along), ranges)
    return ranges


def written(path, poses, period=0.2, **world):
    """A CARMEN log of a corridor, with a scan at each pose (x, y, yaw)."""
    lines = ["PARAM robot_front_laser_max 20 a 0\n", "PARAM robot_frontlaser_offset 0 a 0\n"]
    for number, (x, y, yaw) in enumerate(poses):
        ranges = " ".join(f"{one:.3f}" for one in corridor_scan(x, y, yaw, **world))
        at = f"{x:.6f} {y:.6f} {yaw:.6f}"
        stamp = 100.0 + period * number
        lines.append(f"FLASER {BEAMS} {ranges} {at} {at} {stamp:.3f} host {stamp:.3f}\n")
    path.write_text("".join(lines))
    return path
