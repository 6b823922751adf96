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
from wayproof.models.worlds.traffic import ABSENT_POSITION

Array = NDArray[np.float64]

FLOOR = CLASSES.index("floor")
PROBE = "wayproof_probe"
FARTHEST = 2.0
"""Greatest distance that is measured, m."""


class TrueSpace:
    """True geometry of one scene, for scoring; the stack never reads it."""

    def __init__(self, mjcf: str) -> None:
        """Compile a flattened scene, with a point body for measurements.

        Raises:
            ValueError: It is no valid scene.
        """
        spec = mujoco.MjSpec.from_string(mjcf)
        probe = spec.worldbody.add_body(name=PROBE, mocap=True)
        probe.add_geom(size=[1e-6, 0, 0], contype=0, conaffinity=0, group=ROBOT_GROUP)
        with warnings.catch_warnings():  # of masses that no motion is computed from here
            warnings.simplefilter("ignore", UserWarning)
            self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._probe = int(model.body(PROBE).geomadr[0])
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        robot = (model.geom_group == ROBOT_GROUP) & (np.arange(model.ngeom) != self._probe)
        if model.nuser_geom:
            floor = model.geom_user[:, 0] == FLOOR
        else:
            floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._robot = np.flatnonzero(robot & solid)
        self._floor = np.flatnonzero(floor & ~robot)
        self._obstacles = np.flatnonzero(solid & ~robot & ~floor)
        self._moves = model.body_mocapid[model.geom_bodyid] >= 0
        base = int(model.body(ROBOT_PREFIX + "base").jntadr[0])
        self._base = int(model.jnt_qposadr[base])
        self._fromto = np.zeros(6)
        mujoco.mj_kinematics(model, self._data)

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
        return self._nearest([self._probe], np.concatenate([self._obstacles, self._floor]))

    def distance_to(self, point: Array, name: str) -> float:
        """Return the distance of a point (3,) to an obstacle, m, at most `FARTHEST`."""
        self._data.geom_xpos[self._probe] = point
        return self._nearest([self._probe], self._named(name))[0]

    def body_clearance(self, name: str = "") -> float:
        """Return the distance of the placed robot to an obstacle, or the nearest one, m."""
        return self._nearest(self._robot, self._named(name) if name else self._obstacles)[0]

    def body_contact(self) -> tuple[Array, str]:
        """Return the point (3,) of an obstacle nearest to the robot, and its name."""
        distance, name = self._nearest(self._robot, self._obstacles)
        del distance
        return self._touch.copy(), name

    def moves(self, name: str) -> bool:
        """Return whether a named obstacle is a mover."""
        return bool(name) and any(self._moves[geom] for geom in self._named(name))

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
        self, origin: Array, shape: tuple[int, int, int], size: float, moving: bool = False
    ) -> NDArray[np.bool_]:
        """Return which cells of a grid overlap an obstacle.

        Args:
            origin: Corner of the grid, (3,) m.
            shape: (nx, ny, nz).
            size: Edge of a cell, m.
            moving: Whether only movers count.
        """
        grid = np.zeros(shape, np.bool_)
        for geom in self._obstacles:
            if moving and not self._moves[geom]:
                continue
            window, centres = self._window(int(geom), origin, shape, size)
            if len(centres):
                inside = self._distances(int(geom), centres) < 0.49 * size
                grid[window] |= inside.reshape(grid[window].shape)
        return grid

    def borne(self, points: Array) -> NDArray[np.bool_]:
        """Return whether a floor is within 5 cm below points (n, 3): (n,)."""
        held = np.zeros(len(points), np.bool_)
        for geom in self._floor:
            if self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                return np.ones(len(points), np.bool_)
            held |= self._distances(int(geom), points) < 0.05
        return held

    def terrain(self, spots: Array) -> Array | None:
        """Return the height of the ground at spots (n, 2): (n,) m, -inf where none is.

        None where the floor has no height fields.
        """
        kinds = self._model.geom_type[self._floor]
        fields = self._floor[kinds == mujoco.mjtGeom.mjGEOM_HFIELD]
        if not len(fields):
            return None
        level = 0.0 if (kinds == mujoco.mjtGeom.mjGEOM_PLANE).any() else -np.inf
        heights = np.full(len(spots), level)
        for geom in fields:
            above = self._data.geom_xpos[geom][2] + self._model.geom_rbound[geom] + 1.0
            for n, (x, y) in enumerate(spots.tolist()):
                origin, down = np.array([x, y, above]), np.array([0.0, 0.0, -1.0])
                met = mujoco.mj_rayHfield(self._model, self._data, int(geom), origin, down, None)
                if met >= 0.0:
                    heights[n] = max(heights[n], above - met)
        return heights

    def _named(self, name: str) -> NDArray[np.int64]:
        """Return the geoms of a body or geom by name."""
        own = [g for g in self._obstacles if self._name(int(g)) == name]
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

    def _window(
        self, geom: int, origin: Array, shape: tuple[int, int, int], size: float
    ) -> tuple[tuple[slice, ...], Array]:
        """Return the part of a grid in the bounding box of a geom, and its cell centres (n, 3)."""
        model, data = self._model, self._data
        R = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + R @ model.geom_aabb[geom, :3]
        half = np.abs(R) @ model.geom_aabb[geom, 3:]
        with np.errstate(over="ignore"):  # of a geom beyond all numbers, which is then clipped
            low, high = (middle - half - origin) / size, (middle + half - origin) / size
        first = np.clip(np.floor(low) - 1, 0, shape).astype(int)
        end = np.clip(np.ceil(high) + 1, 0, shape).astype(int)
        window = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        cells = np.stack(np.meshgrid(*map(np.arange, first, end), indexing="ij"), axis=-1)
        return window, origin + (cells.reshape(-1, 3) + 0.5) * size

    def _distances(self, geom: int, points: Array) -> Array:
        """Return the distances (n,) of points (n, 3) to a geom, m; at most 0 inside."""
        model, data = self._model, self._data
        kind, size = int(model.geom_type[geom]), model.geom_size[geom]
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        if kind in PRIMITIVES:
            return PRIMITIVES[kind](local, size)
        return np.array([self._measured(geom, point) for point in points])

    def _measured(self, geom: int, point: Array) -> float:
        self._data.geom_xpos[self._probe] = point
        return float(
            mujoco.mj_geomDistance(
                self._model, self._data, self._probe, geom, FARTHEST, self._fromto
            )
        )


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
