"""Movers in a world file: a mocap body each, and a text in `<custom>` with its route."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields, replace
from math import hypot, isfinite
from typing import Any

import mujoco
import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.solids import solid_of
from wayproof.models.world_files.terrain import Terrain, ground_heights
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.solids import Cylinder

MAX_MOVERS = 500
"""Maximum number of movers in a world: each is placed at every step of the physics."""

MAX_POINTS = 20_000
"""Maximum number of points of all their routes."""

MAX_DROP = 1.5
"""Height above or below the floor from which a mover stands on another one, m."""


ALWAYS = ("route", "times", "returns", "loops", "stands_off")
"""Fields of a mover that are always written; of the others those that differ from the default."""

DEFAULTS: dict[str, Any] = {
    one.name: one.default for one in fields(Mover) if one.name not in ("name", "solids")
}


def mover_text(mover: Mover) -> str:
    """Return all of a mover but its solids, as JSON whose numbers read back as the same bits."""
    written = {name: getattr(mover, name) for name in (*ALWAYS, *DEFAULTS)
               if name in ALWAYS or getattr(mover, name) != DEFAULTS[name]}  # fmt: skip
    return json.dumps({**written, "kind": mover.solids[0].kind})


def mover_of(name: str, text: str, parts: Sequence[Part]) -> Mover:
    """Return a mover by its body's name, its text and the geoms of its body.

    Args:
        name: Name of the body.
        text: As `mover_text` writes it.
        parts: Parts in the body's own frame.

    Raises:
        ValueError: The text is not that of a mover.
    """
    try:
        content = json.loads(text)
        kind = str(content.pop("kind"))
        solids = tuple(solid_of(replace(part, kind=kind)) for part in parts)
        route = tuple(_point(point) for point in content.pop("route"))
        times = tuple(float(time) for time in content.pop("times"))
        others = {key: type(DEFAULTS[key])(value) for key, value in content.items()}
        return Mover(name, solids, route, times=times, **others)
    except (AttributeError, LookupError, TypeError, ValueError, RecursionError) as error:
        what = " ".join(str(error).split())[:100]
        raise ValueError(f"mover '{name}': not as 'wayproof import' writes it ({what})") from None


def _point(values: Any) -> Vector3:
    x, y, z = (float(value) for value in values)
    if not all(map(isfinite, (x, y, z))):
        raise ValueError("a point that is not finite")
    return x, y, z


def check_movers(movers: Sequence[Mover]) -> None:
    """Refuse more movers than a simulation can move.

    Raises:
        ValueError: Saying how many.
    """
    points = sum(len(mover.route) for mover in movers)
    if len(movers) > MAX_MOVERS or points > MAX_POINTS:
        raise ValueError(
            f"{len(movers)} movers with {points} points, expected at most {MAX_MOVERS} with "
            f"{MAX_POINTS}"
        )


def stood_on_ground(movers: Sequence[Mover], terrain: Terrain) -> tuple[list[Mover], int]:
    """Return movers with their routes on the floor, and the number of those that are not near it.

    Args:
        movers: Movers with routes at the height of their feet, or near it, m.
        terrain: What is not level of the scene's floor, which is at 0 elsewhere.
    """
    stood = []
    for mover in movers:
        points = np.array(mover.route)
        heights = ground_heights(terrain, points)
        if np.abs(points[:, 2] - heights).max() > MAX_DROP:
            continue
        route = [(x, y, float(z)) for (x, y, _), z in zip(mover.route, heights, strict=True)]
        stood.append(replace(mover, route=tuple(route)))
    return stood, len(movers) - len(stood)


def around_start(mover: Mover) -> Cylinder:
    """Return a cylinder about a mover where it begins."""
    (x, y, z), top = mover.place(0).position, max(solid.top for solid in mover.solids)
    return Cylinder((x, y, z), (x, y, z + top), hypot(*mover.size), "person")


def bodies_of(model: mujoco.MjModel, names: Sequence[str]) -> dict[int, str]:
    """Return the names of movers by the ids of their bodies.

    Raises:
        ValueError: A mover without a body that is moved from outside.
    """
    found = {}
    for name in names:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body < 0 or model.body_mocapid[body] < 0:
            raise ValueError(f"mover '{name}': no mocap body of that name")
        found[int(body)] = name
    return found
