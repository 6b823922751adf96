"""Failures whose cause was written down before, in halls of 12 m by 6 m."""

import math

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

WALLS = (
    ("6 -0.1 1.5", "6.2 0.1 1.5"),
    ("6 6.1 1.5", "6.2 0.1 1.5"),
    ("-0.1 3 1.5", "0.1 3.2 1.5"),
    ("12.1 3 1.5", "0.1 3.2 1.5"),
)
SOON = ("episode.stuck_after=6", "behaviour.max_recoveries=2")


def hall(folder, things):
    """Write a world with things in it; `user` is 1 of class floor, 0 of any other."""
    walls = "\n".join(
        f'<geom type="box" pos="{pos}" size="{size}" contype="1" conaffinity="1" user="0"/>'
        for pos, size in WALLS
    )
    path = folder / "hall.xml"
    path.write_text(
        f"""<mujoco model="hall"><size nuser_geom="1"/><option timestep="0.002"
integrator="implicitfast" cone="pyramidal" iterations="50"/><custom>
<numeric name="wayproof_start" data="1.5 3 0 0"/><numeric name="wayproof_goal" data="10.5 3 0"/>
<numeric name="wayproof_low" data="-1.2 -1.2 -0.5"/>
<numeric name="wayproof_high" data="13.2 7.2 4"/>
<numeric name="wayproof_route_length" data="0"/><text name="wayproof_format" data="1"/></custom>
<worldbody><light pos="6 3 10" dir="0 0 -1" directional="true"/>
<geom name="floor" type="plane" pos="6 3 0" size="7.2 4.2 0.05" contype="1" conaffinity="1"
 friction="0.8 0.005 0.0001" user="1"/>{walls}{things}</worldbody></mujoco>"""
    )
    return path


def cause(folder, things, robot, *settings, seed=1):
    config = override(Config(str(hall(folder, things)), robot, seed), settings)
    return run_episode(build(config), folder / "log.mcap")


def fence(x, offset, radius=0.01, pitch=0.2):
    posts = [offset + pitch * k for k in range(round(6.0 / pitch) + 1)]
    return "\n".join(
        f'<geom name="post_{k}" type="cylinder" size="{radius} 1.5" pos="{x} {y} 1.5" user="0"/>'
        for k, y in enumerate(posts)
    )


def ramps(degrees):
    """A ramp up and one down, across the hall."""
    half, turn = 0.59, math.radians(degrees)
    along, up = half * math.cos(turn), half * math.sin(turn)
    c, s = math.cos(turn / 2), math.sin(turn / 2)
    return "\n".join(
        f'<geom name="ramp_{k}" type="box" size="{half} 3 0.02" user="1"'
        f' pos="{6 + side * along} 3 {up - 0.02}" quat="{c} 0 {side * s} 0"/>'
        for k, side in enumerate((-1, 1))
    )


def step(height):
    return f'<geom name="step" type="box" size="1 3 {height / 2}" pos="6 3 {height / 2}" user="1"/>'


WALL = '<geom name="sheet" type="box" size="0.0005 3.2 1.5" pos="{x} 3 1.5" user="0"/>'


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("things", "robot", "says"),
    [
        (fence(6.0, 0.0), "quadruped", "no way to the goal exists"),
        (WALL.format(x=6.0), "quadruped", "no way to the goal exists"),
        (ramps(12), "quadruped", "costmap.max_slope = 0 rad makes an obstacle"),
        (fence(6.05, 0.05), "quadruped", "no way to the goal exists"),
        (fence(6.0, 0.0, radius=0.02, pitch=0.3), "drone", "no way to the goal exists"),
        (WALL.format(x=6.0005), "quadruped", "no way to the goal exists"),
        (ramps(25), "quadruped", "no way to the goal exists"),
        (step(0.17), "quadruped", "no way to the goal exists"),
    ],
)
def test_what_is_as_thin_as_it_may_be_or_of_class_floor_closes_a_way(tmp_path, things, robot, says):
    result = cause(tmp_path, things, robot, *SOON, "episode.time_limit=12")
    assert (result.outcome != "success", result.cause) == (True, "impossible")
    assert says in result.cause_evidence


def test_a_step_that_the_body_takes_closes_nothing(tmp_path):
    result = cause(tmp_path, step(0.02), "quadruped", "episode.time_limit=2")
    assert "no way" not in result.cause_evidence


@pytest.mark.few(1)
@pytest.mark.parametrize("x", [6.0, 6.05])
def test_a_cable_is_missed_wherever_it_hangs(tmp_path, x):
    cables = "\n".join(
        f'<geom name="cable_{k}" type="cylinder" size="0.0015 1.5" pos="{x} {y} 1.5" user="0"/>'
        for k, y in enumerate((x - 3.6, x - 3.2, x - 2.8, x - 2.4))
    )
    result = cause(tmp_path, cables, "drone", seed=1001)
    assert (result.outcome, result.cause) == ("collision", "missed_obstacle")
    assert "cable_" in result.cause_evidence


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("world", "robot", "seed", "settings", "found", "says"),
    [
        (
            "warehouse", "quadruped", 1026, ("pose_model.leg_height_sigma=0.3", *SOON),
            "localization", "its height 0.28 m off",
        ),
        (
            "empty", "drone", 1035, ("motion.speed_fraction=0.05", "episode.time_limit=20"),
            "impossible", "takes 26.4 s at 0.20 m/s (motion.speed_fraction = 0.05)",
        ),
        (
            "office", "drone", 825, ("pose_model.bias_sigma=0.3",),
            "localization", "against the body within a second, and its setpoints with it",
        ),
    ],
)  # fmt: skip
def test_a_cause_comes_before_what_it_causes(recorded, world, robot, seed, settings, found, says):
    result = recorded(world, robot, seed, *settings)
    assert result.cause == found
    assert says in result.cause_evidence
