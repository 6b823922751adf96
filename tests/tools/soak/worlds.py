"""Soak of world generators: no seed may crash one or give a closed world."""

from __future__ import annotations

from collections import Counter
from math import ceil
from types import SimpleNamespace

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


def soak_worlds(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Draw `count` worlds or a few more, as many of each name, in two processes."""
    seeds = ceil(count / len(WORLDS))
    jobs = [
        (name, seed + first + begin, min(BATCH, seeds - begin))
        for begin in range(0, seeds, BATCH)
        for name in WORLDS
    ]
    of, compiled, failures = Counter[str](), 0, []
    with WorkerPool(2) as pool:
        for (name, _, asked), batch in zip(jobs, pool.run_in_order(draw_batch, jobs), strict=True):
            of[name] += asked - len(batch.failures)
            compiled += batch.compiled
            failures += batch.failures
            progress(f"worlds: {of.total()} of {count}, {len(failures)} failures")
    return SimpleNamespace(count=of.total(), compiled=compiled, of=dict(of), failures=failures)


def draw_batch(name: str, first: int, seeds: int) -> SimpleNamespace:
    """Draw one world with consecutive seeds."""
    compiled, failures = 0, []
    for seed in range(first, first + seeds):
        difficulty = DIFFICULTIES[seed % len(DIFFICULTIES)]
        try:
            world = WORLDS[name](seed, difficulty)
            scene = world.mjcf()
            if seed % COMPILE_EVERY == 0:
                check_scene(world, scene)
                compiled += 1
        except Exception as error:  # whatever it is, it is what this looks for
            said = f"world {name}, seed {seed}, difficulty {difficulty}"
            failures.append(f"{said}: {type(error).__name__}: {error}")
    return SimpleNamespace(count=seeds - len(failures), compiled=compiled, failures=failures)


def check_scene(world: World, scene: str) -> None:
    """Draw a world again and compile it; raise a ValueError if that gives anything else."""
    if WORLDS[world.name](world.seed, world.difficulty).mjcf() != scene:
        raise ValueError("drawn again it has other bytes")
    model = mujoco.MjModel.from_xml_string(scene)
    floors = 1 if world.floor is None else len(world.floor)
    solids = len(world.solids) + sum(len(mover.solids) for mover in world.movers)
    if model.ngeom != floors + solids:
        raise ValueError(f"{model.ngeom} geoms, expected {floors} of floor and {solids} solids")
