from dataclasses import replace

import numpy as np

from tests.tools.soak.random_settings import (
    NOT_VARIED,
    changed_settings,
    random_config,
    vary,
)
from wayproof.harness.config import Config
from wayproof.harness.config_document import override, value_of

DRAWS = 60


def wide_configs():
    return [random_config(np.random.default_rng((5, n)), 3.0, wide=True) for n in range(DRAWS)]


def test_a_draw_comes_again():
    assert wide_configs() == wide_configs()


def test_a_narrow_draw_varies_no_further_setting():
    narrow = random_config(np.random.default_rng((5, 0)), 3.0)
    names = {one.partition("=")[0] for one in changed_settings(narrow)}
    assert not narrow.waypoints
    assert not any(name.startswith(("world.", "behaviour.max", "planner.re")) for name in names)


def test_wide_draws_hold_people_goals_robots_and_unknown_space_at_a_cost():
    drawn = wide_configs()
    people = [value_of(one, "world.passers_by") for one in drawn]
    assert {0, 1, 2, 3} >= set(people) > {0}
    assert {len(one.waypoints) for one in drawn} == {0, 1, 2}
    brought = {one.robot.rpartition("/")[2] for one in drawn if one.robot.endswith(".toml")}
    assert brought == {"go1.toml", "go2.toml", "spot.toml", "crazyflie.toml"}
    assert sum(one.costmap.unknown_policy == "penalize" for one in drawn) > DRAWS / 3
    assert not any(one.map.kind == "octomap" for one in drawn)


def test_what_limits_the_machine_or_has_no_effect_is_not_varied():
    config = override(Config("maze", "drone", 7), ["motion.limits=cautious"])
    seen = set()
    for n in range(DRAWS):
        varied = vary(config, np.random.default_rng(n))
        unlike = {one.partition("=")[0] for one in changed_settings(replace(varied, robot="drone"))}
        seen |= unlike - {"waypoints", "costmap.unknown_policy", "world.passers_by"}
    assert not seen & set(NOT_VARIED)
    assert not any(name.startswith(("world.warehouse", "estimate.", "prior.")) for name in seen)
    sections = {name.partition(".")[0] for name in seen}
    assert sections >= {"behaviour", "costmap", "map", "pose_model", "planner", "latency"}


def test_numbers_are_scaled_and_zeros_replaced():
    config = Config("maze", "quadruped", 7)
    factors = []
    for n in range(DRAWS):
        varied = vary(config, np.random.default_rng(n))
        for name in (one.partition("=")[0] for one in changed_settings(varied)):
            value, before = value_of(varied, name), value_of(config, name)
            if isinstance(before, float):
                factors.append(value / before if before else 1.0)
    assert min(factors) >= 0.29
    assert max(factors) <= 3.4
    assert min(factors) < 0.6 < 1.5 < max(factors)
