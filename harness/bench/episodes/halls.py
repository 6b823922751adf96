"""`wayproof bench halls`: the cost of an episode by the extent of its world."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from math import hypot
from pathlib import Path

import numpy as np

from wayproof.harness.bench.micro.bare_physics import Followed, bare_seconds, setpoints_of
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config, EpisodeConfig
from wayproof.harness.inputs import Inputs
from wayproof.harness.runner import OpenEpisode, open_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.arrays import Vector3
from wayproof.models.worlds import Box, World
from wayproof.models.worlds.layout import WALL_HEIGHT, WALL_THICKNESS, room_walls

ROBOTS = ("quadruped", "drone")

SIDES = {"20": 20.0, "60": 60.0, "120": 120.0, "300": 300.0}
"""Name of a part -> side of a square hall, m."""

FLOOR_PER_SOLID = 65.0
"""Floor for each solid, m^2: 110 of them in 120 x 60 m."""

GAP = 1.7
"""Least gap between solids, m, so that every body passes everywhere."""

RACKS = 5
"""Number of solids of which one is a rack."""

END_INSET = 2.0
"""Distance of start and goal from the walls, m."""

SLOWEST = 0.35
"""Mean speed that an episode has time for, m/s."""

STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class HallRow:
    """One episode with the default settings.

    Attributes:
        side_m: Side of the square hall, m.
        solids: Number of solids in it.
        robot: Name of the robot.
        outcome: Outcome of the episode.
        time_s: Simulated time, s.
        path_ratio: Length travelled over the shortest way in truth; None if that is not known.
        cpu_ms_p50: Median processor time of a decision: map, costmap and plan, ms.
        cpu_ms_p99: 99th percentile of it, ms.
        cpu_ms_max: Maximum of it, ms.
        map_ms: Mean wall time of the map's update, ms.
        costmap_ms: Mean wall time of the costmap's update, ms.
        plan_ms: Mean wall time of the decision itself, ms.
        loop_share: Processor time of the bare physics over that of the whole loop, without the
            search for the shortest way: see `bench loop`.
        build_s: Processor time to build the episode and its stack, s.
        memory_mib: Greatest resident memory of the process, MiB.
    """

    side_m: float
    solids: int
    robot: str
    outcome: str
    time_s: float
    path_ratio: float | None
    cpu_ms_p50: float
    cpu_ms_p99: float
    cpu_ms_max: float
    map_ms: float
    costmap_ms: float
    plan_ms: float
    loop_share: float
    build_s: float
    memory_mib: float


@dataclass(frozen=True)
class HallSummary:
    """Several halls of one side.

    Attributes:
        side_m: Side of the square halls, m.
        robot: Name of the robot.
        halls: Number of halls.
        reached: Share of them in which it reached the goal.
        path_ratio: Mean length travelled over the shortest way in truth, of those that it reached;
            None without one.
        path_ratio_max: Greatest of them.
        cpu_ms_p50: Mean over the halls of the median processor time of a decision, ms.
        cpu_ms_p99: Mean over the halls of its 99th percentile, ms.
        loop_share: Mean processor time of the bare physics over that of the whole loop.
        memory_mib: Greatest resident memory of a process, MiB.
    """

    side_m: float
    robot: str
    halls: int
    reached: float
    path_ratio: float | None
    path_ratio_max: float | None
    cpu_ms_p50: float
    cpu_ms_p99: float
    loop_share: float
    memory_mib: float


def bench_halls(
    repeats: int, seed: int, progress: Progress, only: str | None = None
) -> list[HallRow | HallSummary]:
    """Run both robots in halls of every side, each episode in a process of its own.

    One length travelled says little of a robot that does not know the way, so several halls of a
    side have a summary.

    Args:
        repeats: Number of halls of each side.
        seed: Seed of the first.
        progress: Called with a line about what is under way.
        only: Key of `SIDES` to measure; None for all.
    """
    sides = list(SIDES.values()) if only is None else [SIDES[only]]
    jobs = [
        (side, robot, each)
        for side in sides
        for robot in ROBOTS
        for each in range(seed, seed + repeats)
    ]
    rows: list[HallRow] = []
    with WorkerPool(1, fresh=True) as pool:
        for side, robot, each in jobs:
            progress(f"halls: {side:g} m, {robot}, seed {each}")
            rows += list(pool.run_in_order(run_one, [(side, robot, each)]))
    return [*rows, *(summarise(rows) if repeats > 1 else ())]


def summarise(rows: list[HallRow]) -> list[HallSummary]:
    """Summarise the halls of each side and robot, in the order in which they come."""
    groups: dict[tuple[float, str], list[HallRow]] = {}
    for row in rows:
        groups.setdefault((row.side_m, row.robot), []).append(row)
    return [_summary(side, robot, alike) for (side, robot), alike in groups.items()]


def _summary(side: float, robot: str, rows: list[HallRow]) -> HallSummary:
    reached = [row for row in rows if row.outcome == "success"]
    ratios = [row.path_ratio for row in reached if row.path_ratio is not None]
    return HallSummary(
        side_m=side,
        robot=robot,
        halls=len(rows),
        reached=len(reached) / len(rows),
        path_ratio=round(float(np.mean(ratios)), 3) if ratios else None,
        path_ratio_max=max(ratios) if ratios else None,
        cpu_ms_p50=round(float(np.mean([row.cpu_ms_p50 for row in rows])), 1),
        cpu_ms_p99=round(float(np.mean([row.cpu_ms_p99 for row in rows])), 0),
        loop_share=round(float(np.mean([row.loop_share for row in rows])), 3),
        memory_mib=max(row.memory_mib for row in rows),
    )


def run_one(side: float, robot: str, seed: int) -> HallRow:
    """Run one episode without keeping its log."""
    world = make_hall(side, seed)
    far = hypot(*np.subtract(world.goal, world.start)[:2].tolist())
    config = Config(
        "hall", robot, seed, episode=EpisodeConfig(time_limit=min(60.0 + far / SLOWEST, 3600.0))
    )
    warm_up(config)
    began = time.process_time()
    scenario = build(config, world)
    stages: list[tuple[float, float, float]] = []

    def note(decision: pb.Decision, _: pb.Truth) -> None:
        found = decision.stages
        stages.append((found.map_ms, found.costmap_ms, found.plan_ms))
        followed.add(decision)

    with (
        tempfile.TemporaryDirectory() as folder,
        open_episode(scenario, Path(folder) / "episode.mcap", note) as opened,
    ):
        built_s = time.process_time() - began
        scenario.route_length()  # known from here on
        followed, decided_ms = Followed(opened), _time_steps(opened)
        began = time.process_time()
        opened.episode.run()
        loop_s = time.process_time() - began
        result = opened.end()
    memory_mib = peak_memory_mib()
    setpoints, position = setpoints_of(scenario, followed, round(result.sim_time_s * 1e9))
    # The first time may load or compile kernels.
    bare_s = min(bare_seconds(scenario, setpoints, position.tolist()) for _ in range(2))
    shortest, mean_ms = result.route_length_m, np.mean(stages, axis=0).tolist()
    return HallRow(
        side_m=side,
        solids=len(world.solids),
        robot=robot,
        outcome=result.outcome,
        time_s=result.sim_time_s,
        path_ratio=result.path_length_m / shortest if shortest else None,
        cpu_ms_p50=round(float(np.median(decided_ms)), 1),
        cpu_ms_p99=round(float(np.percentile(decided_ms, 99)), 0),
        cpu_ms_max=round(max(decided_ms), 0),
        map_ms=mean_ms[0],
        costmap_ms=mean_ms[1],
        plan_ms=mean_ms[2],
        loop_share=round(bare_s / loop_s, 3),
        build_s=round(built_s, 1),
        memory_mib=memory_mib,
    )


def _time_steps(opened: OpenEpisode) -> list[float]:
    """Have the processor time of each step of an episode's stack appended to a list, ms."""
    navigator, spent_ms = opened.navigator, list[float]()
    step = navigator.step

    def timed(
        inputs: Inputs, sense_ms: float = 0.0, answer: pb.StackCommand | None = None
    ) -> pb.Decision:
        began = time.process_time()
        decision = step(inputs, sense_ms, answer)
        spent_ms.append(1e3 * (time.process_time() - began))
        return decision

    navigator.step = timed  # type: ignore[method-assign]
    return spent_ms


def peak_memory_mib() -> float:
    """Return the greatest resident memory of this process so far, MiB, without its parent's."""
    lines = STATUS.read_text(encoding="utf-8").splitlines()
    peak = next(line for line in lines if line.startswith("VmHWM:"))
    return int(peak.split()[1]) / 1024.0


def make_hall(side: float, seed: int) -> World:
    """Make a square hall with racks, crates and pillars, as many by area as in any other.

    Args:
        side: m.
        seed: Seed of the places and sizes.
    """
    rng = np.random.default_rng([seed, round(side)])
    low: Vector3 = (0.0, 0.0, -0.5)
    start = END_INSET, 0.25 * side, 0.0
    goal = side - END_INSET, 0.75 * side, 0.0
    count = round(side * side / FLOOR_PER_SOLID)
    return World(
        name="hall",
        seed=seed,
        low=low,
        high=(side, side, 3.0),
        solids=(*room_walls(low, (side, side, 3.0)), *_solids(rng, side, count, (start, goal))),
        start=start,
        start_heading=0.0,
        goal=goal,
    )


def _solids(
    rng: np.random.Generator, side: float, count: int, ends: tuple[Vector3, Vector3]
) -> list[Box]:
    """Draw axis-aligned boxes that keep a gap from one another, the walls and the ends."""
    boxes: list[Box] = []
    taken = np.array([(x - 0.5, y - 0.5, x + 0.5, y + 0.5) for x, y, _ in ends])  # (n, 4)
    edge = WALL_THICKNESS + GAP
    while len(boxes) < count:
        if len(boxes) % RACKS == 0:
            extent = rng.uniform(4.0, min(12.0, side / 3.0)), 1.1
            height = rng.uniform(2.0, WALL_HEIGHT)
        else:
            extent = rng.uniform(0.3, 1.5), rng.uniform(0.3, 1.5)
            height = rng.uniform(0.4, WALL_HEIGHT)
        size = np.array(extent if rng.integers(2) else extent[::-1])
        corner = rng.uniform(edge, side - edge - size)
        box = np.concatenate([corner, corner + size])
        apart = np.maximum(taken[:, :2] - box[2:], box[:2] - taken[:, 2:]).max(axis=1)
        if apart.min() < GAP:
            continue
        taken = np.vstack([taken, box])
        boxes.append(Box.between((*box[:2].tolist(), 0.0), (*box[2:].tolist(), height), "crate"))
    return boxes
