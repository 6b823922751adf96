"""Compilation of every kernel before anything is timed.

`python -m wayproof.harness.warm_up` compiles what the packaged robots run by default, in two
processes: the compiler takes one core, and about a minute on two.
"""

from __future__ import annotations

import atexit
import gc
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from wayproof import maps, planners
from wayproof.harness.config import Config
from wayproof.harness.estimators import line_map, surface_map
from wayproof.harness.scenario.robots import find_robot, warm_up_robot
from wayproof.kernel_cache import note_missed
from wayproof.maps import echo_history, ground_fit, missing_floor, range_image
from wayproof.models import rays, step_kernels, truth
from wayproof.models.robots import ROBOTS
from wayproof.models.sensors import codecs, measure
from wayproof.models.worlds import solvability


def warm_up(config: Config) -> None:
    """Compile the kernels of an episode, or load them from the cache.

    All objects of this process are then excluded from garbage collection: scanning them takes as
    long as ten decisions.
    """
    compile_perception(config)
    compile_planning(config)
    warm_up_robot(config)
    gc.collect()
    gc.freeze()


def compile_perception(config: Config) -> None:
    """Compile the kernels of ray casting and mapping."""
    maps.warm_up(config.map.kind, config.costmap.max_slope, config.sensors.semantics)
    ground_fit.warm_up()
    missing_floor.warm_up()
    echo_history.warm_up()
    range_image.warm_up()
    measure.warm_up()
    codecs.warm_up()
    rays.warm_up()
    truth.warm_up()
    solvability.warm_up()
    if config.estimate.kind == "lidar":
        surface_map.warm_up()
        line_map.warm_up()


def compile_planning(config: Config) -> None:
    """Compile the kernels of plans, and of physics steps."""
    step_kernels.warm_up()
    planners.warm_up(config.planner, oriented=bool(find_robot(config).spec.discs))


def parts() -> list[tuple[Callable[[Config], None], list[str]]]:
    """Return parts of the kernels that share few, longest first, each with its robots."""
    each = [(warm_up_robot, [robot]) for robot in reversed(ROBOTS)]
    return [(compile_perception, [*ROBOTS]), (compile_planning, [*ROBOTS]), *each]


def compile_part(part: Callable[[Config], None], robots: Sequence[str]) -> None:
    """Compile one part of the kernels for some packaged robots."""
    for robot in robots:
        part(Config("warehouse", robot, 0))


def main() -> None:
    """Fill the cache of compiled kernels."""
    began = time.perf_counter()
    note_missed(__name__)  # said once, not by each process
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:
        for compiled in [pool.submit(compile_part, *part) for part in parts()]:
            compiled.result()
    print(f"kernels: {time.perf_counter() - began:.0f} s")


# Modules are garbage at exit, and OMPL's bindings warn about those that are frozen.
atexit.register(gc.unfreeze)

if __name__ == "__main__":
    main()
