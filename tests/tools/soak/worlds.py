"""Soak of world generators: no seed may crash one or give a closed world."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import ceil

import mujoco

from wayproof.harness.bench.table import Progress
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.worlds import WORLDS, World

DIFFICULTIES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Difficulties, in turn by seed."""

BATCH = 50
"""Number of seeds of one world in a job."""

COMPILE_EVERY = 20
"""Period, in seeds, of drawing a world again, to the same bytes, and compiling it."""


@dataclass
class Drawn:
    """Results of drawn worlds.

    Attributes:
        count: Number of worlds drawn and found open by their generators.
        compiled: Number of these that were drawn twice and compiled.
        of: Name -> number of worlds.
        seconds_per_1000: Name -> processor time of 1000 worlds, s.
        slowest: Name, seed and difficulty of the slowest world.
        slowest_s: Processor time of that world, s.
        failures: World, seed, difficulty and the error of each failure.
    """

    count: int = 0
    compiled: int = 0
    of: dict[str, int] = field(default_factory=dict)
    seconds_per_1000: dict[str, float] = field(default_factory=dict)
    slowest: str = ""
    slowest_s: float = 0.0
    failures: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Batch:
    """Worlds drawn by one job: see `Drawn`."""

    count: int
    compiled: int
    seconds: float
    slowest: str
    slowest_s: float
    failures: list[str]


def soak_worlds(count: int, seed: int, progress: Progress, first: int = 0) -> Drawn:
    """Draw `count` worlds or a few more, as many of each name, in two processes.

    Args:
        count: Number of worlds.
        seed: First seed.
        progress: Called with a line about what is under way.
        first: Number of seeds to skip, which were drawn before.
    """
    drawn, seconds = Drawn(), dict.fromkeys(WORLDS, 0.0)
    jobs = list(batches(ceil(count / len(WORLDS)), seed + first))
    with WorkerPool(2) as pool:
        for (name, _, _), batch in zip(jobs, pool.run_in_order(draw_batch, jobs), strict=True):
            drawn.count += batch.count
            drawn.compiled += batch.compiled
            drawn.of[name] = drawn.of.get(name, 0) + batch.count
            seconds[name] += batch.seconds
            drawn.seconds_per_1000[name] = round(1e3 * seconds[name] / max(drawn.of[name], 1), 1)
            if batch.slowest_s > drawn.slowest_s:
                drawn.slowest, drawn.slowest_s = batch.slowest, batch.slowest_s
            drawn.failures += batch.failures
            progress(f"worlds: {drawn.count} of {count}, {len(drawn.failures)} failures")
    return drawn


def batches(seeds: int, first: int) -> Iterator[tuple[str, int, int]]:
    """Yield name, first seed and number of seeds: every world with every seed, in order."""
    for begin in range(0, seeds, BATCH):
        for name in WORLDS:
            yield name, first + begin, min(BATCH, seeds - begin)


def draw_batch(name: str, first: int, seeds: int) -> Batch:
    """Draw one world with consecutive seeds."""
    compiled, slowest, slowest_s, failures = 0, "", 0.0, []
    began = time.process_time()
    for seed in range(first, first + seeds):
        difficulty = DIFFICULTIES[seed % len(DIFFICULTIES)]
        said = f"world {name}, seed {seed}, difficulty {difficulty}"
        before = time.process_time()
        try:
            world = WORLDS[name](seed, difficulty)
            took = time.process_time() - before
            scene = world.mjcf()
            if seed % COMPILE_EVERY == 0:
                check_scene(world, scene)
                compiled += 1
        except Exception as error:  # whatever it is, it is what this looks for
            failures.append(f"{said}: {type(error).__name__}: {error}")
            continue
        if took > slowest_s:
            slowest, slowest_s = said, took
    seconds = time.process_time() - began
    return Batch(seeds - len(failures), compiled, seconds, slowest, slowest_s, failures)


def check_scene(world: World, scene: str) -> None:
    """Draw a world again and compile it.

    Raises:
        ValueError: Other bytes, or MuJoCo refuses the scene or finds other geoms in it.
    """
    if WORLDS[world.name](world.seed, world.difficulty).mjcf() != scene:
        raise ValueError("drawn again it has other bytes")
    model = mujoco.MjModel.from_xml_string(scene)
    floors = 1 if world.floor is None else len(world.floor)
    solids = len(world.solids) + sum(len(mover.solids) for mover in world.movers)
    if model.ngeom != floors + solids:
        raise ValueError(f"{model.ngeom} geoms, expected {floors} of floor and {solids} solids")
