"""Scenes to measure ray casters on: every primitive, any size and attitude, strewn over a floor."""

from __future__ import annotations

import numpy as np

KINDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
SIDE = 40.0  # m, of the square that geoms are strewn over
CLEARING = 2.0  # m, about the origin: no geom as it is placed reaches a sensor that stands there


def clutter(count: int, moving: int = 0, seed: int = 0) -> str:
    """MJCF of `count` mixed primitives between 0 and 2 m above a floor, which comes in addition.

    Args:
        count: Geoms besides the floor; the five shapes take turns.
        moving: How many of them, the first ones, are mocap bodies.
        seed: Of places, sizes and attitudes.

    Raises:
        ValueError: More geoms move than there are.
    """
    if not 0 <= moving <= count:
        raise ValueError(f"moving: got {moving}, expected 0 to {count}")
    rng = np.random.default_rng(seed)
    strewn = [_geom(rng, KINDS[i % len(KINDS)], i < moving) for i in range(count)]
    floor = '<geom type="plane" size="0 0 1"/>'
    return f"<mujoco><worldbody>{floor}{''.join(strewn)}</worldbody></mujoco>"


def _geom(rng: np.random.Generator, kind: str, moves: bool) -> str:
    place = rng.uniform(-SIDE / 2, SIDE / 2, 2)
    while np.hypot(*place) < CLEARING:
        place = rng.uniform(-SIDE / 2, SIDE / 2, 2)
    quaternion = _numbers(*rng.normal(size=4))  # MuJoCo scales it to unit length
    pose = f'pos="{_numbers(*place, rng.uniform(0.0, 2.0))}" quat="{quaternion}"'
    shape = f'type="{kind}" size="{_numbers(*rng.uniform(0.1, 0.6, 3))}"'
    if moves:
        return f'<body mocap="true" {pose}><geom {shape}/></body>'
    # In the world body itself: MuJoCo's own caster is more than twice as fast on one body with
    # a tree of geoms as on a body for each.
    return f"<geom {shape} {pose}/>"


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)
