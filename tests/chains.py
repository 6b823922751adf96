"""The corpus: episodes whose decisions and motions may change only where a change means them to.

    python -m tests.chains              compare all with `tests/chains.txt`; 1 if any differs
    python -m tests.chains --write      write the file
    python -m tests.chains --quick      a few that reach most of the code
    python -m tests.chains --only WORD  those whose name holds the word; may be repeated

Each case is a command that a user could type. Its line holds the outcome, the number of decisions,
a digest of what was done (true poses, and the records of the decisions without their reasons), and
the chain over the whole records. Where only the chain differs, decisions have other reasons and all
else is as before.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import os
import shlex
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.tools.world_splat import write_splat
from wayproof.harness.cli.main import main as wayproof
from wayproof.harness.config import Config
from wayproof.harness.log.reader import open_log
from wayproof.harness.prior.of_world import splat_of_world
from wayproof.harness.scenario.worlds import find_world
from wayproof.maps import MAPS
from wayproof.models.sensors.devices import DEVICES
from wayproof.models.worlds import WORLDS
from wayproof.planners.registry import PLANNERS

RECORDED = Path(__file__).with_suffix(".txt")
ROOT = Path(__file__).resolve().parents[1]
FR079 = ROOT / "examples/recordings/fr079/fr079-200.clf.bz2"
ROBOTS = ("quadruped", "drone")

BRIEF_S = 2.5
"""Time limit of most episodes, simulated, s: some 25 decisions."""

WHEELED = """name = "wheeled"
radius = 0.25
height = 0.4

[limits]
speed = 1.0
acceleration = 1.0
jerk = 10.0
yaw_rate = 1.0
"""
"""Body of the recordings."""

PERTURBATIONS = (
    *("calibration:3", "depth_dropout:3", "depth_noise:4", "depth_scale:3", "false_returns:3"),
    *("latency:3", "motion:3", "occlusion:3", "pose_drift:4", "pose_jump:4", "rate:3", "slip:3"),
    *("clock_skew:2", "out_of_order:4"),
)

WORDED = ("reason", "predicate", "chain", "stages")
"""Fields of a decision that say why it was made, that hold the chain, or that are measured."""

SPINNING = ("livox-mid360", "ouster-os1-64", "velodyne-vlp16")
"""Devices of which few sweeps show all that they do, as each has many beams."""


class Case(NamedTuple):
    """One command; `{name}` in it is a file of `write_inputs`."""

    name: str
    command: str


def cases() -> list[Case]:
    """Return every case, the slowest first where that is known."""
    return [
        *longer(),
        *(
            Case(f"world-{world}-{robot}-{seed}", episode(world, robot, seed))
            for world in WORLDS
            for robot in ROBOTS
            for seed in (1, 2)
        ),
        *(
            Case(f"map-{kind}-{robot}", episode("warehouse", robot, 5, *of_map(kind)))
            for kind in MAPS
            for robot in ROBOTS
            if (kind, robot) != ("grid2d", "drone")  # it has no heights to fly at
        ),
        *(
            Case(
                f"planner-{planner}",
                episode("office", robot, 3, f"planner.name={planner}", limit=1),
            )
            for planner, robot in zip(PLANNERS, ROBOTS * len(PLANNERS), strict=False)
        ),
        *(
            Case(f"sensor-{device}", with_device(device))
            for device in DEVICES
            if DEVICES[device].kind != "rangefinder"  # the drone carries one
        ),
        *(
            Case(f"perturb-{one.partition(':')[0]}", f"{perturbed(robot)} --perturb {one}")
            for one, robot in zip(PERTURBATIONS, ROBOTS * len(PERTURBATIONS), strict=False)
        ),
        *others(),
    ]


def longer() -> Iterator[Case]:
    """Return episodes that end by themselves, and those that need more time to show anything."""
    yield Case("whole-drone", episode("warehouse", "drone", 4, limit=None))
    yield Case("whole-quadruped", episode("cylinders", "quadruped", 4, limit=None))
    yield Case(
        "whole-jump", episode("warehouse", "drone", 3, limit=None, rest="--perturb pose_jump:5")
    )
    yield Case("whole-ghosts", episode("ghosts", "drone", 3, limit=None))
    ends = "--start 4,30 --goal 116,30"
    for robot in ROBOTS:
        yield Case(f"hall-{robot}", episode("{hall}", robot, 1, limit=5, rest=ends))
    over = "--start 2.5,4 --goal 7,4"
    yield Case(
        "slope", episode("{hill}", "quadruped", 0, "costmap.max_slope=0.3", limit=6, rest=over)
    )
    goals = "--goal 3.5,4.0 --goal 6.5,4.0"
    yield Case("goals", episode("empty", "drone", 1, limit=None, rest=goals))
    yield Case("recording-carmen", "shadow {fr079} --robot {wheeled} --end 20")
    yield Case("recording-log", "shadow {recorded} --robot drone --end 3")
    yield Case("stack-exec", on_trial("exec:{python} -m wayproof serve gap", "drone"))


def others() -> Iterator[Case]:
    """Return the cases of settings that have no registry."""
    for policy in ("penalize", "allow"):
        setting = f"costmap.unknown_policy={policy}"
        yield Case(f"unknown-{policy}-drone", episode("maze", "drone", 2, setting))
        yield Case(f"unknown-{policy}-quadruped", episode("maze", "quadruped", 2, setting))
    for robot in ROBOTS:
        lidar = episode("warehouse", robot, 2, "estimate.kind=lidar")
        yield Case(f"estimate-lidar-{robot}", lidar)
        yield Case(f"prior-truth-{robot}", episode("warehouse", robot, 1, "prior.source=truth"))
        people = (f"world.{one}" for one in ("passers_by=4", "passers_by_speed=0.8"))
        yield Case(f"people-{robot}", episode("office", robot, 6, *people))
        classes = ("sensors.semantics=true", 'costmap.class_margins={{"shelf":0.1}}')
        yield Case(f"classes-{robot}", episode("warehouse", robot, 7, *classes))
    yield Case("imu-bias", perturbed("drone", "estimate.kind=lidar") + " --perturb imu_bias:3")
    stale = perturbed("drone", "prior.source=truth") + " --perturb stale_prior:3"
    yield Case("stale-prior", stale)
    yield Case("prior-splat", episode("corridor", "drone", 1, rest="--prior {splat}"))
    guess = ("prediction.source=completion", "prior.source=truth")
    yield Case("prediction", episode("warehouse", "drone", 1, *guess))
    for stack, robot in (("blind", "drone"), ("dwa", "quadruped"), ("gap", "quadruped")):
        yield Case(f"stack-{stack}", on_trial(stack, robot))
    yield Case("stack-imitation", on_trial("imitation", "drone"))
    yield Case("stack-guard", on_trial("blind", "drone") + " --guard")


def episode(
    world: str,
    robot: str,
    seed: int,
    *settings: str,
    limit: float | None = BRIEF_S,
    rest: str = "",
) -> str:
    """Return the command of an episode."""
    limits = () if limit is None else (f"episode.time_limit={limit:g}",)
    options = " ".join(f"--set {shlex.quote(one)}" for one in (*settings, *limits))
    return f"run {world} --robot {robot} --seed {seed} {options} {rest}".rstrip()


def of_map(kind: str) -> list[str]:
    """Return the settings of a kind of map; an OctoMap has no decay."""
    return [f"map.kind={kind}", *(["map.half_life=0"] if kind == "octomap" else [])]


def with_device(device: str) -> str:
    """Return the command of an episode with one device as the sensor of its kind."""
    mount = "lidar" if DEVICES[device].kind == "lidar" else "depth"
    limit = 1.0 if device in SPINNING else BRIEF_S
    return episode("warehouse", "drone", 8, f"sensors.{mount}={device}", limit=limit)


def perturbed(robot: str, *settings: str) -> str:
    """Return the command of an episode, without its perturbation."""
    return episode("warehouse", robot, 3, *settings)


def on_trial(stack: str, robot: str) -> str:
    """Return the command of an episode of a stack on trial."""
    return episode("warehouse", robot, 9, rest=f"--stack {shlex.quote(stack)}")


QUICK = (
    *("world-office-quadruped-1", "world-warehouse-drone-2", "world-crossing-quadruped-1"),
    *("map-tsdf-drone", "planner-rrtstar", "perturb-depth_dropout", "stack-dwa", "prior-splat"),
    *("estimate-lidar-quadruped", "recording-log"),
)
"""Names of the cases of `--quick`."""


def write_inputs(folder: Path) -> dict[str, str]:
    """Write the files that the commands name, and return their paths."""
    x, y = np.meshgrid(0.1 * np.arange(121), 0.1 * np.arange(81))
    away = np.minimum(((x - 5.0) ** 2 + (y - 4.0) ** 2) / 4.0, 1.0)
    np.save(folder / "hill.npy", 0.3 * (1.0 - away) ** 2)
    type_in(f"import {folder}/hill.npy --resolution 0.1 --out {folder}/hill.xml")
    (folder / "hall.mjcf.xml").write_text(hall_mjcf())
    type_in(f"import {folder}/hall.mjcf.xml --out {folder}/hall.xml")
    (folder / "wheeled.toml").write_text(WHEELED)
    splat = splat_of_world(find_world(Config("corridor", "", 1)))
    write_splat(folder / "corridor.ply", splat)
    recorded = folder / "recorded.mcap"
    type_in(f"{episode('cylinders', 'drone', 1, limit=4)} --log {recorded}")
    return {
        "hall": str(folder / "hall.xml"),
        "hill": str(folder / "hill.xml"),
        "wheeled": str(folder / "wheeled.toml"),
        "splat": str(folder / "corridor.ply"),
        "recorded": str(recorded),
        "fr079": str(FR079),
        "python": sys.executable,
    }


def hall_mjcf() -> str:
    """Return a hall of 120 x 60 m with a post on every 49 m^2, as MJCF."""
    rng = np.random.default_rng(0)
    posts = [
        f'<geom type="box" pos="{x:.2f} {y:.2f} 1" size="0.5 0.5 1"/>'
        for x in np.arange(8.0, 116.0, 7.0) + rng.uniform(-2.0, 2.0)
        for y in np.arange(4.0, 60.0, 7.0) + rng.uniform(-2.0, 2.0)
    ]
    floor = '<geom type="box" pos="60 30 -0.05" size="60 30 0.05"/>'
    return f"<mujoco><worldbody>{floor}{''.join(posts)}</worldbody></mujoco>"


def type_in(command: str) -> None:
    """Run a command in this process.

    Raises:
        SystemExit: It was refused.
    """
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        code = wayproof(shlex.split(command))
    if code == 2:
        raise SystemExit(f"{command}\n{errors.getvalue()}")


def line_of(case: Case, folder: str, inputs: dict[str, str]) -> str:
    """Run a case and return its line."""
    log_path = Path(folder) / f"{case.name}.mcap"
    try:
        type_in(f"{case.command.format(**inputs)} --log {log_path}")
    except SystemExit as error:
        print(error, file=sys.stderr)
        return f"{case.name} refused 0 - -"
    log = open_log(log_path)
    done = hashlib.blake2b(digest_size=8)
    count, chain = 0, ""
    for decision in log.decisions():
        count, chain = count + 1, decision.chain
        for field in WORDED:
            decision.ClearField(field)
        done.update(decision.SerializeToString(deterministic=True))
    for truth in log.truth():
        done.update(np.array([*truth.position, *truth.quaternion]).tobytes())
    log_path.unlink()
    outcome = log.result.get("outcome", "")
    return f"{case.name} {outcome or 'recording'} {count} {done.hexdigest()} {chain}"


def lines_of(chosen: list[Case]) -> Iterator[str]:
    """Run cases on all cores and return their lines, in order."""
    processes = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        inputs = write_inputs(Path(folder))
        with ProcessPoolExecutor(processes, mp_context=get_context("fork")) as pool:
            yield from [
                running.result()
                for running in [pool.submit(line_of, case, folder, inputs) for case in chosen]
            ]


def differences(found: list[str], recorded: list[str]) -> Iterator[str]:
    """Return what differs from the recorded lines, in words."""
    known = {line.split()[0]: line.split() for line in recorded}
    for line in found:
        name, *values = line.split()
        _, *before = known.get(name, [name])
        if not before:
            yield f"{name}: not recorded"
        elif values[0] == "refused":
            yield f"{name}: refused, was {' '.join(before)}"
        elif values[:3] != before[:3]:
            yield f"{name}: decided otherwise: {' '.join(values)}, was {' '.join(before)}"
        elif values[3] != before[3]:
            yield f"{name}: the same but for its reasons: chain {values[3]}, was {before[3]}"


def main() -> int:
    """Compare the corpus with its record, or write it."""
    parser = argparse.ArgumentParser(description="Compare the decisions of the corpus.")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", action="append", default=[], metavar="WORD")
    options = parser.parse_args()
    chosen = [
        case
        for case in cases()
        if (not options.quick or case.name in QUICK)
        and (not options.only or any(word in case.name for word in options.only))
    ]
    found = sorted(lines_of(chosen))
    recorded = RECORDED.read_text().splitlines() if RECORDED.exists() else []
    differing = list(differences(found, recorded))
    if not found:
        parser.error(f"--only {' '.join(options.only)}: no case has that in its name")
    if not (options.quick or options.only):
        names = {case.name for case in chosen}
        gone = [line.split()[0] for line in recorded if line.split()[0] not in names]
        differing += [f"{name}: recorded, and no case any more" for name in gone]
    if options.write:
        kept = {line.split()[0]: line for line in recorded} if len(chosen) < len(cases()) else {}
        kept |= {line.split()[0]: line for line in found}
        RECORDED.write_text("".join(f"{kept[name]}\n" for name in sorted(kept)))
    print("\n".join([*differing, f"{len(found)} episodes, {len(differing)} differ"]))
    return 1 if differing and not options.write else 0


if __name__ == "__main__":
    sys.exit(main())
