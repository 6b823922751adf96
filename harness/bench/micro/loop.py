"""`wayproof bench loop`: speed of whole episodes beside their bare physics, and of each stage."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayproof.harness.bench.micro.bare_physics import Followed, bare_seconds, setpoints_of
from wayproof.harness.bench.table import Progress
from wayproof.harness.config_document import from_document, override
from wayproof.harness.result import Result
from wayproof.harness.runner import open_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up

WORLD = "warehouse"
STAGES = ("sense", "map", "costmap", "plan")
ROBOTS = ("quadruped", "drone")
LIGHT = ("sensors.lidar=own", "map.resolution=0.1")
DENSE = ("sensors.lidar=ideal-lidar-dense", "map.resolution=0.05")
LOADS = {"light": LIGHT, "dense": DENSE, "dense-on-two": (*DENSE, "threads=2")}
"""Name -> settings of light episodes, and of dense ones on one core and on two."""


@dataclass(frozen=True)
class LoopRow:
    """Episodes of one robot under one load.

    Attributes:
        robot: Name of the robot.
        rays: Number of beams in all sweeps of one decision.
        resolution_m: Cell size of the map, m.
        threads: Number of threads for rays, map and costmap.
        episodes: Number of episodes in the warehouse, of seeds from the given one on.
        reached: Number of episodes that ended in success.
        share_of_physics: Processor time of the bare physics over that of the whole loop: the same
            steps of MuJoCo with the same controller and setpoints, timed after each episode. On one
            thread that is the loop's share of the speed of bare physics, whatever the host's load.
            The shortest way in truth, of which scores are made, is worked out before either.
        realtime_factor: Simulated seconds a second of wall time: sensing, map, costmap, decision,
            physics and log together.
        physics_realtime_factor: Simulated seconds a second of processor time of the bare physics
            with control.
        sense_ms: Median time of casting a decision's sweeps.
        map_ms: Median time of the map's update.
        costmap_ms: Median time of the costmap's update.
        plan_ms: Median time of the decision itself.
        decision_ms_p50: Median time from a sweep's cast to its decision.
        decision_ms_p99: 99th percentile of the same.
    """

    robot: str
    rays: int
    resolution_m: float
    threads: int
    episodes: int
    reached: int
    share_of_physics: float
    realtime_factor: float
    physics_realtime_factor: float
    sense_ms: float
    map_ms: float
    costmap_ms: float
    plan_ms: float
    decision_ms_p50: float
    decision_ms_p99: float


def bench_loop(
    repeats: int, seed: int, progress: Progress, only: str | None = None
) -> list[LoopRow]:
    """Run episodes of both robots under all loads; one row for each.

    Args:
        repeats: Number of episodes for each row.
        seed: First seed.
        progress: Called with a line about what is under way.
        only: Key of `LOADS` to measure; None for all.
    """
    rows = []
    for robot in ROBOTS:
        for load in [only] if only else LOADS:
            seeds = range(seed, seed + repeats)
            rows.append(_measure(robot, LOADS[load], seeds, progress))
    return rows


def _measure(robot: str, settings: tuple[str, ...], seeds: range, progress: Progress) -> LoopRow:
    simulated = wall = loop = bare = 0.0
    reached = rays = 0
    stages: list[list[float]] = []  # (decisions, stages) ms

    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            progress(f"loop: {robot}, {', '.join(settings)}, seed {seed}")
            named = {"world": WORLD, "robot": robot, "seed": seed}
            config = override(from_document(named), settings)
            warm_up(config)
            scenario = build(config)
            scenario.route_length()  # known from here on
            rays = sum(caster.table.beams for caster in scenario.scene.casters)
            result, followed, seconds = _run(scenario, Path(folder) / "episode.mcap", stages)
            loop += seconds
            setpoints, position = setpoints_of(scenario, followed, round(result.sim_time_s * 1e9))
            bare += bare_seconds(scenario, setpoints, position.tolist())
            simulated += result.sim_time_s
            wall += result.wall_time_s
            reached += result.outcome == "success"
    table = np.array(stages)
    sense, map_, costmap, plan = np.median(table, axis=0).round(2).tolist()
    decision = table.sum(axis=1)
    return LoopRow(
        robot=robot,
        rays=rays,
        resolution_m=scenario.config.map.resolution,
        threads=scenario.config.threads,
        episodes=len(seeds),
        reached=reached,
        share_of_physics=round(bare / loop, 3),
        realtime_factor=simulated / wall,
        physics_realtime_factor=simulated / bare,
        sense_ms=sense,
        map_ms=map_,
        costmap_ms=costmap,
        plan_ms=plan,
        decision_ms_p50=float(np.median(decision)),
        decision_ms_p99=float(np.percentile(decision, 99)),
    )


def _run(
    scenario: Scenario, path: Path, stages: list[list[float]]
) -> tuple[Result, Followed, float]:
    """Run an episode; append the times of the stages of each decision.

    Returns:
        Its result, what the robot followed, and the processor time of the loop, s.
    """

    def note(decision: pb.Decision, _: pb.Truth) -> None:
        stages.append([getattr(decision.stages, f"{stage}_ms") for stage in STAGES])
        followed.add(decision)

    with open_episode(scenario, path, note) as opened:
        followed = Followed(opened)
        began = time.process_time()
        opened.episode.run()
        return opened.end(), followed, time.process_time() - began
