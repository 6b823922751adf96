"""Trial of recordings in the layouts of public datasets, made from our simulation.

    python -m wayproof.harness.bench.published.layout_trial --out FOLDER

Each layout is stepped through twice, and the map of every 20th decision is compared cell by cell
with that of the episode that measured the same.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayproof.harness import config_document as settings
from wayproof.harness.bench.published.layouts import DEPTH_LAYOUTS, Camera, write_kitti
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.inputs import Inputs
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recompute.segments import SegmentedStack, segments_of
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.recording import Recording, RecordingOptions
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.shadow.summary import summarize
from wayproof.maps import UNKNOWN, states_in
from wayproof.models.sensors.devices import DEVICES, OWN, DepthCamera

FOCAL = 525.0
"""Focal length that TUM gives for its cameras, pixels."""

EVERY = 20
"""Number of decisions from one comparison of maps to the next."""

TOP = 0.8
"""Height up to which maps are compared, m; the operating area of a recording ends above it."""

NAME = "trial-camera"


class Alike(NamedTuple):
    """Agreement of the maps of two logs.

    Attributes:
        maps: Number of pairs that were compared.
        cells: Number of cells that either map knows, over all pairs.
        same: Number of them with the same state in both.
    """

    maps: int
    cells: int
    same: int

    @property
    def share(self) -> float:
        """Return the share of cells with the same state; 0 without a cell."""
        return self.same / self.cells if self.cells else 0.0


def camera_of(width: int, height: int) -> Camera:
    """Return a camera with the field of view of TUM's at another number of pixels."""
    focal = FOCAL * width / 640.0
    return Camera(width, height, (focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)))


@contextmanager
def registered(camera: Camera) -> Iterator[None]:
    """Register the camera as a device named `NAME`, 10 images a second, up to 13 m: 16 bits."""
    focal = camera.intrinsics[0]
    DEVICES[NAME] = DepthCamera(
        height=camera.height,
        width=camera.width,
        field_of_view_horizontal=2.0 * math.atan(0.5 * camera.width / focal),
        field_of_view_vertical=2.0 * math.atan(0.5 * camera.height / focal),
        range=13.0,
        rate=10.0,
        no_return_is_free=False,
        source="Sturm et al., 2012: a Kinect, without its errors",
    )
    known = settings.NAMED["sensors.lidar"]
    settings.NAMED["sensors.lidar"] = (OWN, *DEVICES)
    try:
        yield
    finally:
        settings.NAMED["sensors.lidar"] = known
        del DEVICES[NAME]


def options_for(name: str, own: Recording, camera: Camera) -> RecordingOptions:
    """Return the options for a folder of a layout that was made of a recording of one sensor."""
    mount, range_max = next(own.sweeps()).T_body_sensor, own.sensors[0].range_max
    if name == "kitti":
        return RecordingOptions(mount=mount, range_max=range_max)
    given = camera.intrinsics if name == "tum" else None  # of the others a file has them
    return RecordingOptions(mount=mount, range_max=range_max, pixel_stride=1, intrinsics=given)


def step_through(path: Path, options: RecordingOptions, body_height: float, log: Path) -> Path:
    """Step the built-in stack through a recording of the quadruped, at a height above the floor."""
    recording = open_recording(path, options=options)
    chosen = [f"recording.body_height={body_height!r}", "recording.decision_period=0"]
    return run_recording(recording, prepare(recording, find_body("quadruped"), chosen), log)


def compare_maps(episode: Path, shadow: Path, every: int = EVERY) -> Alike:
    """Compare the maps of an episode and of its recording at decisions of the same time."""
    logs = open_log(episode), open_log(shadow)
    low = np.max([log.mission.low for log in logs], axis=0)
    high = np.min([log.mission.high for log in logs], axis=0)
    high[2] = TOP
    records = [_by_millisecond(log) for log in logs]
    stacks = [SegmentedStack(segments_of(log)) for log in logs]
    maps = cells = same = 0
    for number, (time_ms, inputs) in enumerate(records[1].items()):
        pair = records[0][time_ms], inputs
        own = [stack.watch(one).map for stack, one in zip(stacks, pair, strict=True)]
        if number % every:
            continue
        first, second = (states_in(one, low, high) for one in own)
        known = (first != UNKNOWN) | (second != UNKNOWN)
        maps, cells = maps + 1, cells + int(known.sum())
        same += int((first == second)[known].sum())
    return Alike(maps, cells, same)


def _by_millisecond(log: Log) -> dict[int, Inputs]:
    """Return the inputs of each decision by its time since the first: frames have no stamps."""
    inputs = [record.inputs for record in log.records()]
    return {round((one.time_ns - inputs[0].time_ns) * 1e-6): one for one in inputs}


def episode_of(folder: Path, name: str, sensor: str, seconds: float) -> Path:
    """Run the quadruped in an office with one sensor, and return the log."""
    log = folder / f"{name}.mcap"
    chosen = [
        f"sensors.lidar={sensor}",
        f"episode.time_limit={seconds:g}",
        "map.no_return=ignored",  # no layout says where nothing came back
    ]
    run_episode(build(override(Config("office", "quadruped", 1), chosen)), log)
    return log


def _trial(path: Path, options: RecordingOptions, height: float, episode: Path) -> bool:
    """Step through a recording twice and print the results; return whether they are right."""
    name, folder = path.name, episode.parent
    began = time.process_time()
    log = step_through(path, options, height, folder / f"{name}.log.mcap")
    spent = time.process_time() - began
    summary = summarize(assess(log))
    again = open_log(step_through(path, options, height, folder / f"{name}.again.mcap"))
    same_chain = again.result["chain"] == summary.chain
    alike = compare_maps(episode, log)
    identical, violations = replay(log).identical, len(audit(log).violations)
    share = "none" if summary.admitted_share is None else f"{summary.admitted_share:.1%}"
    print(
        f"{name}: {summary.decisions} decisions, {summary.driven_m:.2f} m, {share} admitted, "
        f"chain {summary.chain[:8]}, twice the same: {same_chain}, replay identical: {identical}, "
        f"{violations} violations, {alike.share:.4%} of {alike.cells} cells of {alike.maps} maps "
        f"alike, {spent * 60.0 / summary.duration_s:.1f} CPU s a minute",
        flush=True,
    )
    return same_chain and identical and not violations and alike.share >= 0.999


def main(arguments: list[str]) -> int:
    """Run the trial; return 1 if a layout is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder that does not exist")
    parser.add_argument("--seconds", type=float, default=30.0, help="length of an episode, s")
    parser.add_argument("--width", type=int, default=640, help="columns of the depth images")
    names = [*DEPTH_LAYOUTS, "kitti"]
    parser.add_argument("--layout", action="append", choices=names, help="of these alone")
    options = parser.parse_args(arguments)
    layouts = options.layout or names
    options.out.mkdir(parents=True)
    camera = camera_of(options.width, options.width * 3 // 4)
    good = True
    depth_layouts = [name for name in DEPTH_LAYOUTS if name in layouts]
    if depth_layouts:
        good &= _depth_trials(options.out, camera, options.seconds, depth_layouts)
    if "kitti" in layouts:
        episode = episode_of(options.out, "lidar-episode", "ideal-lidar-dense", options.seconds)
        own = open_recording(episode)
        path = write_kitti(own, options.out / "kitti")
        good &= _trial(path, options_for("kitti", own, camera), own.body_height or 0.0, episode)
    return 0 if good else 1


def _depth_trials(folder: Path, camera: Camera, seconds: float, names: Sequence[str]) -> bool:
    """Run the trial of layouts of depth images; return whether all are as they must be."""
    good = True
    with registered(camera):
        episode = episode_of(folder, "depth-episode", NAME, seconds)
        own = open_recording(episode)
        for name in names:
            path = DEPTH_LAYOUTS[name](own, camera, folder)
            good &= _trial(path, options_for(name, own, camera), own.body_height or 0.0, episode)
    return good


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
