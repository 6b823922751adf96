"""Random settings of whole episodes: some that go together, or any number of any section."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import replace
from math import exp
from pathlib import Path
from typing import get_args

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.config_document import override, setting_names, value_of
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import PERTURBATIONS, AnyPerturbation, perturbation_from
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.prior_config import NO_PRIOR
from wayproof.maps import MAPS, MapConfig, UnknownPolicy
from wayproof.models.places import PLACES
from wayproof.models.robots import ROBOTS, custom
from wayproof.models.worlds import WORLDS
from wayproof.planners import PLANNERS

FURTHER = (
    "costmap.max_slope=0.4",
    "costmap.window=8",
    "estimate.kind=lidar",
    "latency.mode=modelled",
    "map.half_life=0",
    "map.resolution=0.06",
    "map.resolution=0.15",
    "motion.limits=cautious",
    "motion.speed_fraction=0.5",
    "pose_model.bias_sigma=0.04",
    "prior.source=truth",
    "sensors.lidar=velodyne-vlp16",
)
"""Settings of which each episode has up to `MOST_FURTHER`, where they go with the others."""

MOST_FURTHER = 3

MOST_VARIED = 6
"""Maximum number of settings of a wide draw that are switched or scaled."""

LOG_FACTOR = 1.2
"""Greatest natural logarithm of the factor on a number: 0.3 to 3.3 times its value."""

FROM_ZERO = (0.01, 0.05, 0.2)
"""Values in place of a zero, which no factor changes."""

NOT_VARIED = (
    "episode.time_limit",
    "map.memory_mib",
    "plugins.memory_mib",
    "plugins.wall_s",
    "seed",
    "stack.guard",
)
"""Settings that are drawn elsewhere, limit the machine or are of a stack on trial."""

MOST_PASSERS_BY = 3
MOST_WAYPOINTS = 2

EXAMPLES = Path(custom.__file__).parent / "examples"


def random_config(
    rng: np.random.Generator, time_limit_s: float = 3.0, *, wide: bool = False
) -> Config:
    """Return a random config; every fourth is unperturbed."""
    world, robot = (str(rng.choice(sorted(names))) for names in (WORLDS, ROBOTS))
    kinds = sorted(set(MAPS) - {"octomap"} if wide else MAPS)  # minutes for each OctoMap
    kind = str(rng.choice(kinds)) if rng.integers(2) else MapConfig().kind
    settings = (
        f"map.kind={kind}",
        *(["map.half_life=0"] if kind == "octomap" else []),  # it does not fade
        f"costmap.unknown_policy={rng.choice(get_args(UnknownPolicy))}",
        f"planner.name={rng.choice(sorted(PLANNERS))}",
        f"costmap.localization_margin={rng.uniform(0.02, 0.15):.3f}",
        f"episode.time_limit={time_limit_s}",
    )
    config = override(Config(world, robot, int(rng.integers(2**31))), settings)
    perturbation = perturbation_from(f"{rng.choice(sorted(PERTURBATIONS))}:{rng.integers(1, 6)}")
    if rng.integers(4) != 0:
        needed = override(config, needed_by(perturbation))
        config = replace(needed, perturbation=perturbation)
    further = rng.choice(FURTHER, size=int(rng.integers(MOST_FURTHER + 1)), replace=False)
    config = _where_valid(config, further.tolist())
    return vary(config, rng) if wide else config


def needed_by(perturbation: AnyPerturbation) -> tuple[str, ...]:
    """Return the settings without which a perturbation has nothing to act on."""
    return ("estimate.kind=lidar",) if perturbation.changes == "motion_sensors" else ()


def vary(config: Config, rng: np.random.Generator) -> Config:
    """Return a config with up to `MOST_VARIED` switches and numbers changed.

    Every second takes unknown space at a cost, every fourth has people in its world, every fourth
    several goals, and every fourth is of a robot of the examples of spec files.
    """
    if rng.integers(2):
        config = _where_valid(config, ["costmap.unknown_policy=penalize"])
    if rng.integers(4) == 0:
        people = int(rng.integers(1, MOST_PASSERS_BY + 1))
        config = _where_valid(config, [f"world.passers_by={people}"])
    if rng.integers(4) == 0:
        places = rng.choice(sorted(PLACES), size=int(rng.integers(1, MOST_WAYPOINTS + 1)))
        config = replace(config, waypoints=tuple(places.tolist()))
    if rng.integers(4) == 0:
        specs = sorted(EXAMPLES.glob("*.toml"))
        config = replace(config, robot=str(specs[int(rng.integers(len(specs)))]))
    names = _varied_names(config)
    count = int(rng.integers(MOST_VARIED + 1))
    chosen = rng.choice(names, size=count, replace=False).tolist()
    return _where_valid(
        config, [f"{name}={_varied(value_of(config, name), rng)}" for name in chosen]
    )


def _varied_names(config: Config) -> list[str]:
    """Return the names of all switches and numbers that can change the episode."""
    without_effect = _sections_without_effect(config)
    return [
        name
        for name in setting_names()
        if name not in NOT_VARIED
        and not name.startswith(without_effect)
        and isinstance(value_of(config, name), int | float)
    ]


def _sections_without_effect(config: Config) -> tuple[str, ...]:
    """Return the starts of names of settings that nothing reads with these."""
    other_worlds = sorted(set(WORLDS) - {config.world})
    in_use = {
        "estimate.": config.estimate.kind == "lidar",
        "map.dynamic.": config.map.kind == "dynamic",
        "prior.": config.prior.source != NO_PRIOR,
        "prediction.": config.prediction.source != NO_PREDICTOR,
    }
    unused = [section for section, used in in_use.items() if not used]
    return (*(f"world.{name}." for name in other_worlds), *unused)


def _varied(value: float, rng: np.random.Generator) -> str:
    """Return another value of a setting as text: a switch turned, or a number scaled."""
    if isinstance(value, bool):
        return "false" if value else "true"
    factor = exp(rng.uniform(-LOG_FACTOR, LOG_FACTOR))
    if isinstance(value, int):
        return str(round(value * factor))
    return f"{value * factor:.4g}" if value else str(rng.choice(FROM_ZERO))


def _where_valid(config: Config, settings: Iterable[str]) -> Config:
    """Return a config with those of the settings that go with the others."""
    for setting in settings:
        with contextlib.suppress(InputError):
            config = override(config, [setting])
    return config


def changed_settings(config: Config) -> tuple[str, ...]:
    """Return `name=value` of each setting that is not the default, as `--set` would take it."""
    plain = Config(config.world, config.robot, config.seed, robot_file=config.robot_file)
    values = [(name, value_of(config, name), value_of(plain, name)) for name in setting_names()]
    return tuple(f"{name}={value}" for name, value, default in values if value != default)
