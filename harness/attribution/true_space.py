"""True geometry of a log: its scene with the movers placed, for distances and rays."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.classes import CLASSES
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.worlds.movers import ABSENT_POSITION

Array = NDArray[np.float64]

FLOOR = CLASSES.index("floor")
PROBE = "wayproof_probe"
FARTHEST = 2.0
"""Greatest distance that is measured, m."""

TOUCHES = 1e-5
"""Depth from which on a thing is in a cell, m: one whose face is on the side of a cell is not."""

LEVEL_FLOORS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
"""Types of floors that are the ground itself; any other may stand on it, as a ramp or a step."""


class TrueSpace:
    """True geometry of one scene, for scoring; the stack never reads it."""

    def __init__(self, mjcf: str) -> None:
        """Compile a flattened scene, with a point body and a cell for measurements.

        Raises:
            ValueError: It is no valid scene.
        """
        spec = mujoco.MjSpec.from_string(mjcf)
        probe = spec.worldbody.add_body(name=PROBE, mocap=True)
        unseen = {"contype": 0, "conaffinity": 0, "group": ROBOT_GROUP}
        probe.add_geom(size=[1e-6, 0, 0], **unseen)
        probe.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1.0, 1.0, 1.0], **unseen)
        with warnings.catch_warnings():  # of masses that no motion is computed from here
            warnings.simplefilter("ignore", UserWarning)
            self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._probe = int(model.body(PROBE).geomadr[0])
        self._cell = self._probe + 1
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        robot = model.geom_group == ROBOT_GROUP
        if model.nuser_geom:
            floor = model.geom_user[:, 0] == FLOOR
        else:
            floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        ground = floor & np.isin(model.geom_type, LEVEL_FLOORS)
        self._robot = np.flatnonzero(robot & solid)
        self._floor = np.flatnonzero(floor & ~robot)
        self._things = np.flatnonzero(~robot & (solid | floor))
        self._obstacles = np.flatnonzero(~robot & solid & ~floor)
        self._standing = np.flatnonzero(~robot & (solid | floor) & ~ground)
        self._moves = model.body_mocapid[model.geom_bodyid] >= 0
        base = int(model.body(ROBOT_PREFIX + "base").jntadr[0])
        self._base = int(model.jnt_qposadr[base])
        self._fromto = np.zeros(6)
        mujoco.mj_kinematics(model, self._data)

    @property
    def has_ramps(self) -> bool:
        """Whether things of class `floor` stand on the ground: ramps, steps, decks."""
        return bool(np.isin(self._standing, self._floor).any())

    def place_movers(self, truth: pb.Truth, present: bool = True) -> None:
        """Place the movers as in a truth; with `present` False move all away."""
        for mover in truth.movers:
            mocap = int(self._model.body(mover.name).mocapid[0])
            here = present and mover.present
            self._data.mocap_pos[mocap] = mover.position if here else ABSENT_POSITION
            self._data.mocap_quat[mocap] = mover.quaternion
        mujoco.mj_kinematics(self._model, self._data)

    def place_robot(self, position: Array, quaternion: Array) -> None:
        """Place the base of the robot, (3,) m, (4,) w x y z, with its joints at rest."""
        self._data.qpos[self._base : self._base + 7] = [*position, *quaternion]
        mujoco.mj_kinematics(self._model, self._data)

    def distance(self, point: Array) -> tuple[float, str]:
        """Return the distance from a point (3,) to the nearest geom, m, and its name."""
        self._data.geom_xpos[self._probe] = point
        return self._nearest([self._probe], self._things)

    def distance_to(self, point: Array, name: str) -> float:
        """Return the distance of a point (3,) to a thing, m, at most `FARTHEST`."""
        self._data.geom_xpos[self._probe] = point
        return self._nearest([self._probe], self._named(name))[0]

    def body_clearance(self, name: str) -> float:
        """Return the distance of the placed robot to a thing, m."""
        return self._nearest(self._robot, self._named(name))[0]

    def body_contact(self, flies: bool) -> tuple[Array, str]:
        """Return the point (3,) nearest to the robot of what it must not touch, and its name."""
        _, name = self._nearest(self._robot, self._things if flies else self._obstacles)
        return self._touch.copy(), name

    def cast(self, origins: Array, directions: Array) -> Array:
        """Cast rays with MuJoCo; return distances (n,), m, -1 without a hit.

        As for a sensor, the robot itself and transparent geoms are not hit.

        Args:
            origins: (3,) for all, or (n, 3), m.
            directions: (n, 3) unit vectors.
        """
        distances = np.empty(len(directions))
        groups = np.ones(mujoco.mjNGROUP, np.uint8)
        groups[ROBOT_GROUP] = 0
        starts, place = np.unique(origins.reshape(-1, 3), axis=0, return_inverse=True)
        for number, start in enumerate(starts):
            mine = slice(None) if len(starts) == 1 else np.flatnonzero(place == number)
            beams = np.ascontiguousarray(directions[mine])
            met, hit = np.empty(len(beams)), np.empty(len(beams), np.int32)
            mujoco.mj_multiRay(
                self._model, self._data, start, beams.ravel(), groups, 1, -1,
                hit, met, None, len(beams), mujoco.mjMAXVAL,
            )  # fmt: skip
            distances[mine] = met
        return distances

    def occupied(
        self,
        origin: Array,
        shape: tuple[int, int, int],
        size: float,
        moving: bool = False,
        climbed: bool = False,
    ) -> NDArray[np.bool_]:
        """Return which cells of a grid hold a part of a thing that stands on the ground.

        A ramp or a step of class `floor` does; what a body may step over, the caller leaves out.

        Args:
            origin: Corner of the grid, (3,) m.
            shape: (nx, ny, nz).
            size: Edge of a cell, m.
            moving: Whether only movers count.
            climbed: Whether ramps and steps of class `floor` are ground, as of `terrain`.
        """
        grid = np.zeros(shape, np.bool_)
        for geom in self._obstacles if climbed else self._standing:
            if moving and not self._moves[geom]:
                continue
            window, centres = self._window(int(geom), origin, shape, size)
            if len(centres):
                held = self._reaches_into(int(geom), centres, size)
                grid[window] |= held.reshape(grid[window].shape)
        return grid

    def borne(self, points: Array) -> NDArray[np.bool_]:
        """Return whether a floor is within 5 cm below points (n, 3): (n,)."""
        held = np.zeros(len(points), np.bool_)
        for geom in self._floor:
            if self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                return np.ones(len(points), np.bool_)
            held |= self._distances(int(geom), points) < 0.05
        return held

    def terrain(self, spots: Array, climbed: bool = False) -> Array | None:
        """Return the height of the ground at spots (n, 2): (n,) m, -inf where none is.

        None where the floor has no height fields.

        Args:
            spots: Places, m.
            climbed: Whether ramps, steps and decks of class `floor` are ground as well; None only
                where there are none of these, either.
        """
        kinds = self._model.geom_type[self._floor]
        rough = kinds != mujoco.mjtGeom.mjGEOM_PLANE
        if not climbed:
            rough = kinds == mujoco.mjtGeom.mjGEOM_HFIELD
        if not rough.any():
            return None
        planes = self._floor[kinds == mujoco.mjtGeom.mjGEOM_PLANE]
        heights = np.full(len(spots), max(self._data.geom_xpos[planes, 2], default=-np.inf))
        for geom in self._floor[rough]:
            middle, half = self._bounds(int(geom))
            top = float(middle[2] + half[2]) + 1.0
            for n in np.flatnonzero((np.abs(spots - middle[:2]) <= half[:2]).all(axis=1)):
                met = self._met(int(geom), np.array([*spots[n], top]), np.array([0.0, 0.0, -1.0]))
                if met >= 0.0:
                    heights[n] = max(heights[n], top - met)
        return heights

    def _met(self, geom: int, origin: Array, direction: Array) -> float:
        """Return the distance at which a ray meets a geom, m; negative if it does not."""
        model, data = self._model, self._data
        kind = int(model.geom_type[geom])
        if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
            return float(mujoco.mj_rayHfield(model, data, geom, origin, direction, None))
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            return float(mujoco.mj_rayMesh(model, data, geom, origin, direction, None))
        place, turn = data.geom_xpos[geom], data.geom_xmat[geom]
        return float(
            mujoco.mju_rayGeom(place, turn, model.geom_size[geom], origin, direction, kind, None)
        )

    def _named(self, name: str) -> NDArray[np.int64]:
        """Return the geoms of a body or geom by name."""
        own = [g for g in self._things if self._name(int(g)) == name]
        return np.array(own if own else self._obstacles)

    def _name(self, geom: int) -> str:
        """Return the name: of the body of a mover, of the geom of anything else."""
        if self._moves[geom]:
            return str(self._model.body(self._model.geom_bodyid[geom]).name)
        return str(self._model.geom(geom).name) or f"geom {geom}"

    def _nearest(self, mine: object, others: NDArray[np.int64]) -> tuple[float, str]:
        least, name = FARTHEST, ""
        self._touch = np.zeros(3)
        for one in np.asarray(mine):
            for other in others:
                if self._gap(int(one), int(other)) >= least:
                    continue
                distance = mujoco.mj_geomDistance(
                    self._model, self._data, int(one), int(other), least, self._fromto
                )
                if distance < least:
                    least, name = float(distance), self._name(int(other))
                    self._touch = self._fromto[3:].copy()
        return least, name

    def _gap(self, one: int, other: int) -> float:
        """Return a lower bound of the distance between two geoms, from their bounding spheres."""
        model, data = self._model, self._data
        if model.geom_type[other] == mujoco.mjtGeom.mjGEOM_PLANE:
            return -np.inf
        between = float(np.linalg.norm(data.geom_xpos[one] - data.geom_xpos[other]))
        return between - float(model.geom_rbound[one] + model.geom_rbound[other])

    def _bounds(self, geom: int) -> tuple[Array, Array]:
        """Return the middle and the half extents of the box about a geom, world axes, m."""
        model, data = self._model, self._data
        R = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + R @ model.geom_aabb[geom, :3]
        return middle, np.abs(R) @ model.geom_aabb[geom, 3:]

    def _window(
        self, geom: int, origin: Array, shape: tuple[int, int, int], size: float
    ) -> tuple[tuple[slice, ...], Array]:
        """Return the part of a grid in the bounding box of a geom, and its cell centres (n, 3)."""
        middle, half = self._bounds(geom)
        with np.errstate(over="ignore"):  # of a geom beyond all numbers, which is then clipped
            low, high = (middle - half - origin) / size, (middle + half - origin) / size
        first = np.clip(np.floor(low) - 1, 0, shape).astype(int)
        end = np.clip(np.ceil(high) + 1, 0, shape).astype(int)
        window = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        cells = np.stack(np.meshgrid(*map(np.arange, first, end), indexing="ij"), axis=-1)
        return window, origin + (cells.reshape(-1, 3) + 0.5) * size

    def _reaches_into(self, geom: int, centres: Array, size: float) -> NDArray[np.bool_]:
        """Return whether a geom reaches into each cell about centres (n, 3)."""
        model, data = self._model, self._data
        half = 0.5 * size - TOUCHES
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            R = data.geom_xmat[geom].reshape(3, 3)
            return _boxes_overlap(
                (centres - data.geom_xpos[geom]) @ R, half, model.geom_size[geom], R
            )
        held: NDArray[np.bool_] = np.ones(len(centres), np.bool_)
        doubtful = held.copy()
        if int(model.geom_type[geom]) in PRIMITIVES:
            gaps = self._distances(geom, centres)
            held, doubtful = gaps <= half, (gaps > half) & (gaps <= np.sqrt(3.0) * half)
        model.geom_size[self._cell] = half
        held[doubtful] = [
            self._measured(self._cell, geom, one, limit=TOUCHES) <= 0.0 for one in centres[doubtful]
        ]
        return held

    def _distances(self, geom: int, points: Array) -> Array:
        """Return the distances (n,) of points (n, 3) to a geom, m; at most 0 inside."""
        model, data = self._model, self._data
        kind, size = int(model.geom_type[geom]), model.geom_size[geom]
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        if kind in PRIMITIVES:
            return PRIMITIVES[kind](local, size)
        return np.array([self._measured(self._probe, geom, point) for point in points])

    def _measured(self, probe: int, geom: int, point: Array, limit: float = FARTHEST) -> float:
        """Return the distance from a probe at a point (3,) to a geom, m, up to a limit."""
        self._data.geom_xpos[probe] = point
        return float(
            mujoco.mj_geomDistance(self._model, self._data, probe, geom, limit, self._fromto)
        )


def _boxes_overlap(
    local: Array, half: float, extents: Array, R: Array
) -> NDArray[np.bool_]:  # (n,)
    """Return which cells a box reaches into, by the separating axes of two boxes.

    Args:
        local: (n, 3) centres of the cells in the frame of the box, m.
        half: Half the edge of a cell, m.
        extents: (3,) half extents of the box, m.
        R: (3, 3) R_world_box.
    """
    own = np.eye(3)
    across = [np.cross(a, b) for a in own for b in R]
    axes = np.array([*own, *R, *[axis for axis in across if np.linalg.norm(axis) > 1e-9]])
    reach = np.abs(axes) @ extents + half * np.abs(axes @ R.T).sum(axis=1)
    return np.asarray((np.abs(local @ axes.T) <= reach).all(axis=1))


def _box(local: Array, size: Array) -> Array:
    return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - size, 0.0), axis=1))


def _sphere(local: Array, size: Array) -> Array:
    return np.asarray(np.linalg.norm(local, axis=1) - size[0])


def _capsule(local: Array, size: Array) -> Array:
    along = np.maximum(np.abs(local[:, 2]) - size[1], 0.0)
    return np.asarray(np.hypot(np.hypot(local[:, 0], local[:, 1]), along) - size[0])


def _cylinder(local: Array, size: Array) -> Array:
    out = np.maximum(np.hypot(local[:, 0], local[:, 1]) - size[0], 0.0)
    return np.asarray(np.hypot(out, np.maximum(np.abs(local[:, 2]) - size[1], 0.0)))


PRIMITIVES = {
    int(mujoco.mjtGeom.mjGEOM_BOX): _box,
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
}
"""Distance functions by geom type: points (n, 3) in the frame of the geom give (n,), m. MuJoCo
measures other types."""
