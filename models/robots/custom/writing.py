"""Writing of a robot's MJCF from a compiled model: no files, no classes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.source import RobotSpecError, Source, mesh_points
from wayproof.models.robots.custom.spec_file import SpecFile
from wayproof.models.sensors.caster import ROBOT_GROUP

Geoms = mujoco.mjtGeom

SHAPES = {
    int(Geoms.mjGEOM_SPHERE): ("sphere", 1),
    int(Geoms.mjGEOM_CAPSULE): ("capsule", 2),
    int(Geoms.mjGEOM_CYLINDER): ("cylinder", 2),
    int(Geoms.mjGEOM_ELLIPSOID): ("ellipsoid", 3),
    int(Geoms.mjGEOM_BOX): ("box", 3),
}
"""Name and number of lengths of each geom type."""

HULL_DIRECTIONS = 200
"""Number of directions whose farthest points approximate a mesh's convex hull."""

HEAD = f"""<compiler angle="radian" autolimits="true"/>
  <default>
    <geom group="{ROBOT_GROUP}" contype="0" conaffinity="1" condim="3" mass="0"/>
  </default>"""
"""Head of the MJCF: robot geoms meet the world (contype 1) but not one another."""


def numbers(values: Iterable[float]) -> str:
    """Write numbers so that they read back as the same bits."""
    return " ".join(repr(float(value)) for value in values)


class Assets:
    """The meshes of one robot.

    Attributes:
        text: Their elements.
    """

    def __init__(self) -> None:
        """Start without any."""
        self.text = ""
        self._count = 0

    def add(self, points: Array) -> str:
        """Keep the hull of points (n, 3) and return its name."""
        self._count += 1
        name = f"hull_{self._count}"
        self.text += f'<mesh name="{name}" vertex="{numbers(farthest(points).ravel())}"/>'
        return name


def farthest(points: Array) -> Array:  # (m, 3)
    """Return the points (n, 3) farthest along evenly spread directions (Fibonacci's spiral)."""
    return np.asarray(points[np.unique(np.argmax(points @ ball().T, axis=0))])


def ball() -> Array:  # (HULL_DIRECTIONS, 3)
    """Return unit vectors spread evenly."""
    n = np.arange(HULL_DIRECTIONS)
    z = 1.0 - (2.0 * n + 1.0) / HULL_DIRECTIONS
    angle, ring = n * np.pi * (3.0 - np.sqrt(5.0)), np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def inertial(source: Source, bodies: Sequence[int], origin: Array) -> str:
    """Write the `<inertial>` of bodies fixed to one another, base axes, about an origin in it."""
    mass, centre, inertia = rigid_body(source, bodies)
    if not mass > 0.0:
        name = source.model.body(bodies[0]).name
        raise RobotSpecError(f"body '{name}' has a mass of 0 kg, expected above 0")
    xx, yy, zz, xy, xz, yz = (inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return (
        f'<inertial pos="{numbers(centre - origin)}" mass="{mass!r}" '
        f'fullinertia="{numbers((xx, yy, zz, xy, xz, yz))}"/>'
    )


def rigid_body(source: Source, bodies: Sequence[int]) -> tuple[float, Array, Array]:
    """Return mass, centre (3,) and inertia (3, 3) about it of bodies together, base frame."""
    model, data = source.model, source.data
    masses = model.body_mass[bodies]
    mass = float(masses.sum())
    places = np.array([source.place(data.xipos[body]) for body in bodies])
    centre = masses @ places / max(mass, 1e-12)
    inertia = np.zeros((3, 3))
    for body, own, place in zip(bodies, masses, places, strict=True):
        R = source.turn(data.ximat[body].reshape(3, 3))
        arm = place - centre
        inertia += R @ np.diag(model.body_inertia[body]) @ R.T
        inertia += own * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


def geoms(source: Source, body: int, origin: Array, assets: Assets, but: int = -1) -> str:
    """Write the colliding geoms of a moving body, relative to an origin in the base's frame.

    Args:
        source: The MJCF.
        body: Moving body.
        origin: (3,) m.
        assets: Receives the hulls of meshes.
        but: A geom that is left out.
    """
    kept = [geom for geom in source.colliding(body) if geom != but]
    return "".join(_geom(source, geom, origin, assets) for geom in kept)


def _geom(source: Source, geom: int, origin: Array, assets: Assets) -> str:
    model, data = source.model, source.data
    kind = int(model.geom_type[geom])
    position = source.place(data.geom_xpos[geom]) - origin
    R = source.turn(data.geom_xmat[geom].reshape(3, 3))
    if kind == Geoms.mjGEOM_MESH:
        return f'<geom type="mesh" mesh="{assets.add(mesh_points(model, geom) @ R.T + position)}"/>'
    if kind not in SHAPES:
        raise RobotSpecError(f"geom {geom} of type {Geoms(kind).name}, expected a solid one")
    name, lengths = SHAPES[kind]
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, R.ravel())
    size = numbers(model.geom_size[geom, :lengths])
    return f'<geom type="{name}" size="{size}" pos="{numbers(position)}" quat="{numbers(quat)}"/>'


def sensor_sites(spec: SpecFile, origin: Array) -> str:
    """Write the sites of the sensors on the base."""
    sites = ""
    for sensor, mount in zip(spec.sensors, spec.mounts(), strict=True):
        down = ' zaxis="0 0 -1"' if mount.device.by_mujoco else ""
        sites += f'<site name="{sensor.name}" pos="{numbers(sensor.position - origin)}"{down}/>'
    return sites


def rangefinders(spec: SpecFile) -> str:
    """Write MuJoCo's own sensors behind the mounts that are read off them."""
    named = [mount.name for mount in spec.mounts() if mount.device.by_mujoco]
    return "".join(f'<rangefinder name="{name}" site="{name}"/>' for name in named)


def check_size(spec: SpecFile, points: Array, flying: bool) -> None:
    """Refuse a radius or a height that the body (n, 3) exceeds; z up from the ground.

    Raises:
        RobotSpecError: Saying what it reaches.
    """
    reach = float(np.linalg.norm(points[:, : 3 if flying else 2], axis=1).max())
    top = float(np.ptp(points[:, 2]) if flying else points[:, 2].max())
    wrong = [
        f"{name}: got {given:g} m, but the body reaches {found:.3f} m"
        for name, given, found in (("radius", spec.radius, reach), ("height", spec.height, top))
        if given < found
    ]
    if wrong:
        raise RobotSpecError("; ".join(wrong))


def surface(model: mujoco.MjModel, data: mujoco.MjData) -> Array:  # (n, 3)
    """Return points about every geom of a model, world frame, m."""
    places = []
    for geom in range(model.ngeom):
        R = data.geom_xmat[geom].reshape(3, 3)
        places.append(_outline(model, geom) @ R.T + data.geom_xpos[geom])
    return np.concatenate(places)


def outline(source: Source, geom: int) -> Array:  # (n, 3)
    """Return points about a geom of the source in the base's frame, m."""
    R = source.data.geom_xmat[geom].reshape(3, 3)
    placed = _outline(source.model, geom) @ R.T + source.data.geom_xpos[geom]
    return np.array([source.place(point) for point in placed])


def _outline(model: mujoco.MjModel, geom: int) -> Array:  # (n, 3)
    size, kind, way = model.geom_size[geom], int(model.geom_type[geom]), ball()
    if kind == Geoms.mjGEOM_MESH:
        return mesh_points(model, geom)
    if kind == Geoms.mjGEOM_BOX:
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        return np.asarray(corners * size)
    if kind == Geoms.mjGEOM_ELLIPSOID:
        return np.asarray(way * size)
    if kind == Geoms.mjGEOM_SPHERE:
        return np.asarray(way * size[0])
    ends = np.sign(way) * [0.0, 0.0, size[1]]
    if kind == Geoms.mjGEOM_CYLINDER:
        way = way / np.linalg.norm(way[:, :2], axis=1)[:, None] * [1.0, 1.0, 0.0]
    return np.asarray(way * size[0] + ends)
