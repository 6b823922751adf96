"""Compiling every kernel before anything is timed.

`python -m wayproof.harness.warm_up` compiles what the packaged robots run by default, in two
processes: the compiler takes one core, and half a minute to a minute on two.
"""

from __future__ import annotations

import atexit
import gc
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from wayproof import maps, planners
from wayproof.harness.config import Config
from wayproof.harness.scenario.robots import find_robot, warm_up_robot
from wayproof.models import rays, step_kernels, truth
from wayproof.models.robots import ROBOTS
from wayproof.models.sensors import measure, range_codec
from wayproof.models.worlds import solvability


def warm_up(config: Config) -> None:
    """Compile what an episode runs, or load it from the cache.

    What this process holds by then is left out when garbage is looked for later: to look through
    all that is loaded takes as long as ten decisions.
    """
    perceive(config)
    act(config)
    gc.collect()
    gc.freeze()


def perceive(config: Config) -> None:
    """Of these, what casts rays and makes maps."""
    maps.warm_up(config.map.kind, config.costmap.max_slope, config.sensors.semantics)
    measure.warm_up()
    range_codec.warm_up()
    rays.warm_up()
    truth.warm_up()
    solvability.warm_up()


def act(config: Config) -> None:
    """And what plans and controls."""
    step_kernels.warm_up()
    planners.warm_up(config.planner, oriented=bool(find_robot(config).spec.discs))
    warm_up_robot(config)


def for_each_robot(compile_part: Callable[[Config], None]) -> None:
    """Compile a part of what each of them needs."""
    for robot in ROBOTS:
        compile_part(Config("warehouse", robot, 0))


def main() -> None:
    """Fill the cache of compiled kernels."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(for_each_robot, (perceive, act)))


# Modules are garbage at the end, and OMPL's bindings complain of what of them is left.
atexit.register(gc.unfreeze)

if __name__ == "__main__":
    main()
