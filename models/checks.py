"""Model checks: mistakes that would make sensors see wrongly, found before an episode starts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.rays.geometry import opaque
from wayproof.models.sensors.beams import directions
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.sensors.devices import Mount

MIN_MUJOCO_VERSION = (4, 0)
"""Oldest supported version: in earlier ones rays miss bodies with a turned frame of inertia."""

DEFAULT_MIN_RANGE = 0.05
"""Minimum range assumed for a sensor without one, m."""

MAX_NAMED = 3
"""Maximum number of offenders that are named; the others are counted."""


@dataclass(frozen=True)
class Finding:
    """One thing about a model.

    Attributes:
        severity: `error` if the sensors would see wrongly, `warning` if only another way of looking
            at the model would, such as the other ray engine or the renderer.
        text: Problem in one line: what was got, what was expected, and why.
    """

    severity: Literal["error", "warning"]
    text: str


def check(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    mounts: Sequence[Mount],
    base: int,
    engine: Literal["tile", "mujoco"],
    prefix: str = "",
    version: str = mujoco.__version__,
) -> list[Finding]:
    """Find faults that would make the sensors of one robot see wrongly.

    Args:
        model: Robot and world.
        data: The robot where it starts, at rest, geom poses as `mujoco.mj_kinematics` leaves them.
        mounts: The robot's sensors.
        base: Body id of the robot's base; the bodies below it are the robot.
        engine: Ray engine of the sweeps.
        prefix: Prefix of the robot's names in the model.
        version: Version of MuJoCo.

    Returns:
        Errors first; none for a sound model.
    """
    own = engine == "mujoco" or any(mount.device.noise.grazing for mount in mounts)
    findings = [*_old_mujoco(version), *_missed_geoms(model, own)]
    for mount in mounts:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, prefix + mount.site) < 0:
            text = f"sensor '{mount.name}': got no site '{prefix + mount.site}', expected one"
            findings.append(Finding("error", text))
            continue
        view = _View(model, data, mount, model.site(prefix + mount.site).id)
        findings += [*_site_inside(view), *_own_body_seen(view, base)]
    findings += _near_clip(model, mounts)
    return sorted(findings, key=lambda finding: finding.severity)


class _View:
    """View of one sensor from its site."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, mount: Mount, site: int) -> None:
        self.model = model
        self.data = data
        self.mount = mount
        self.origin = data.site_xpos[site]
        self.R_world_sensor = data.site_xmat[site].reshape(3, 3)
        if mount.device.by_mujoco:  # past its own body, in any group
            visible = opaque(model) & (model.geom_bodyid != model.site_bodyid[site])
        else:
            visible = _visible(model)
        self.visible = np.flatnonzero(visible)

    def meets(self, geom: int) -> bool:
        """Return whether any beam of the first sweep meets the geom within range."""
        beams = directions(self.mount.device.beam_table(), 0) @ self.R_world_sensor.T
        reach = self.model.geom_rbound[geom]
        center = self.data.geom_xpos[geom] - self.origin
        if reach > 0.0:  # only beams that pass near enough; a plane has no bounds
            along = np.maximum(beams @ center, 0.0)
            near = np.linalg.norm(along[:, None] * beams - center, axis=1) <= reach
            beams = beams[near]
        distances = (distance_to(self.model, self.data, geom, self.origin, beam) for beam in beams)
        return any(0.0 <= distance <= self.mount.device.range for distance in distances)


def _old_mujoco(version: str) -> Iterator[Finding]:
    numbers = tuple(int(number) for number in re.findall(r"\d+", version)[:2])
    if numbers < MIN_MUJOCO_VERSION:
        expected = ".".join(map(str, MIN_MUJOCO_VERSION))
        text = f"mujoco: got {version}, expected {expected} or newer: earlier ones miss rays"
        yield Finding("error", text)


def _missed_geoms(model: mujoco.MjModel, used: bool) -> Iterator[Finding]:
    """Yield a finding for geoms that no contact meets and that `mj_multiRay`, if used, misses.

    It leaves out a body whose colliding geoms' common bounding sphere a ray does not meet, and with
    it what else of the body sticks out of that sphere.
    """
    silent = (model.geom_contype == 0) & (model.geom_conaffinity == 0)
    bounded = model.body_bvhadr[model.geom_bodyid] != -1
    candidates = np.flatnonzero(_visible(model) & silent & bounded)
    missed = [int(geom) for geom in candidates if _sticks_out(model, int(geom))]
    if missed:
        yield Finding(
            "error" if used else "warning",
            f"geoms {_names(model, missed)}: got contype = conaffinity = 0 beside colliding geoms, "
            "expected a body of their own: mj_multiRay misses them",
        )


def _sticks_out(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom leaves the bounding sphere of its body's colliding ones."""
    body = model.geom_bodyid[geom]
    bounds = model.bvh_aabb[model.body_bvhadr[body]]  # centre, half sides; frame of inertia
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[body])
    center = (model.geom_pos[geom] - model.body_ipos[body]) @ R.reshape(3, 3)
    is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    reach = np.inf if is_plane else model.geom_rbound[geom]
    farthest = np.linalg.norm(center - bounds[:3]) + reach
    return bool(farthest > np.linalg.norm(bounds[3:]))


def _site_inside(view: _View) -> Iterator[Finding]:
    model, mount = view.model, view.mount
    holding = [int(g) for g in view.visible if holds(model, view.data, int(g), view.origin)]
    if holding:
        yield Finding(
            "error",
            f"site '{mount.site}' of sensor '{mount.name}': got a place inside geoms "
            f"{_names(model, holding)}, expected one outside all that its beams meet",
        )


def _own_body_seen(view: _View, base: int) -> Iterator[Finding]:
    model, mount = view.model, view.mount
    own = _is_below(model, base)[model.geom_bodyid[view.visible]]
    met = [int(geom) for geom in view.visible[own] if view.meets(int(geom))]
    if not met:
        return
    if mount.device.by_mujoco:
        expected = "a free view: a <rangefinder> leaves out its own body alone"
    else:
        expected = f"group {ROBOT_GROUP}, which its beams leave out"
    yield Finding(
        "error",
        f"sensor '{mount.name}': got beams that meet the robot's own geoms "
        f"{_names(model, met)}, expected {expected}",
    )


def _near_clip(model: mujoco.MjModel, mounts: Sequence[Mount]) -> Iterator[Finding]:
    clip = float(model.vis.map.znear * model.stat.extent)
    nearest = {mount.name: mount.device.minimum_range or DEFAULT_MIN_RANGE for mount in mounts}
    blind = [name for name, distance in nearest.items() if clip > distance]
    if blind:
        least = min(nearest[name] for name in blind)
        yield Finding(
            "warning",
            f"visual.map.znear x statistic.extent: got {clip:.3g} m, expected at most {least:g} m, "
            f"the nearest of sensors {_listed(blind)}: rendered depth would miss what is nearer",
        )


def _visible(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return geoms (g,) that the beams of a sweep meet."""
    others: NDArray[np.bool_] = model.geom_group != ROBOT_GROUP
    return opaque(model) & others


def _is_below(model: mujoco.MjModel, base: int) -> NDArray[np.bool_]:
    """Return bodies (b,) that are `base` or hang from it; parents come before their children."""
    below = np.zeros(model.nbody, bool)
    below[base] = True
    for body in range(base + 1, model.nbody):
        below[body] = below[model.body_parentid[body]]
    return below


def _names(model: mujoco.MjModel, geoms: Iterable[int]) -> str:
    return _listed([model.geom(geom).name or f"number {geom}" for geom in geoms])


def _listed(names: list[str]) -> str:
    rest = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(f"'{name}'" for name in names[:MAX_NAMED]) + rest


Geoms = mujoco.mjtGeom


def distance_to(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
) -> float:
    """Return the distance to a geom along a ray, m; -1 for a miss, and for any SDF.

    Args:
        model: Holds the geom, whatever its group and colour.
        data: Geom poses.
        geom: Id.
        origin: (3,) world frame, m.
        direction: (3,) unit vector, world frame.
    """
    kind = model.geom_type[geom]
    if kind == Geoms.mjGEOM_MESH:
        return float(mujoco.mj_rayMesh(model, data, geom, origin, direction))
    if kind == Geoms.mjGEOM_HFIELD:
        return float(mujoco.mj_rayHfield(model, data, geom, origin, direction))
    if kind == Geoms.mjGEOM_SDF:
        return -1.0
    pose = data.geom_xpos[geom], data.geom_xmat[geom]
    return float(mujoco.mju_rayGeom(*pose, model.geom_size[geom], origin, direction, kind))


def holds(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: NDArray[np.float64]
) -> bool:
    """Return whether a point (3,) in the world is inside a geom; behind a plane counts as inside.

    By parity of crossings along most of three rays: meshes are taken as closed surfaces, and of a
    signed distance field nothing is said: False.
    """
    kind, size = model.geom_type[geom], model.geom_size[geom]
    R = data.geom_xmat[geom].reshape(3, 3)
    local = R.T @ (point - data.geom_xpos[geom])
    if kind == Geoms.mjGEOM_PLANE:
        beside = (size[:2] > 0.0) & (np.abs(local[:2]) >= size[:2])
        return bool(local[2] < 0.0 and not beside.any())
    if kind == Geoms.mjGEOM_HFIELD:
        size = model.hfield_size[model.geom_dataid[geom]]  # x, y, top, base
        top = data.geom_xpos[geom] + R @ (local[0], local[1], size[2] + 1.0)
        surface = size[2] + 1.0 - distance_to(model, data, geom, top, -R[:, 2])
        return bool((np.abs(local[:2]) < size[:2]).all() and -size[3] < local[2] < surface)
    return sum(_crossings(model, data, geom, point, ray) % 2 for ray in SKEW_DIRECTIONS) >= 2


SKEW_DIRECTIONS = np.array([[0.48, 0.6, 0.64], [-0.64, 0.48, 0.6], [0.6, -0.64, -0.48]])
"""Directions along no axis, which rarely meet an edge."""


def _crossings(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    point: NDArray[np.float64],
    ray: NDArray[np.float64],
) -> int:
    count, start = 0, point
    while (distance := distance_to(model, data, geom, start, ray)) >= 0.0:
        count += 1
        start = start + (distance + 1e-6) * ray  # go on just behind the surface, 1 um
    return count
