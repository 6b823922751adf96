"""Parts: solids with a pose in the world, as every importer returns them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.poses import rotation_matrices

Shape = Literal["box", "cylinder", "capsule", "sphere", "ellipsoid", "mesh", "heights"]

Quaternion = tuple[float, float, float, float]

SIZES: dict[str, int] = {
    "box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "ellipsoid": 3, "mesh": 0, "heights": 4,
}  # fmt: skip
"""Number of lengths of each shape."""

UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles.

    Attributes:
        vertices: (n, 3) m.
        faces: (m, 3) indices, counter-clockwise from outside.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


@dataclass(frozen=True)
class Part:
    """One solid.

    Attributes:
        shape: Name of the shape.
        size: As MuJoCo counts them, m: half extents of a box; radius and half length of a cylinder
            or capsule; radius; half axes; of heights half the extents in x and y, the rise from the
            least to the greatest, and the depth of the ground below the least.
        position: Position of its centre in the world, m; of heights the middle at the least height.
        quaternion: Rotation from its axes to the world's, w x y z.
        kind: Kind of thing, such as `wall`; lower-case letters and underscores.
        mesh: Triangles of shape `mesh`, in the part's own frame.
        heights: Heights of shape `heights`: (ny, nx) from 0 to 1.
        model: Name of the model or body in the file that it is a part of; empty without one.

    Raises:
        ValueError: A length is not positive and finite, or one is missing.
    """

    shape: Shape
    size: tuple[float, ...]
    position: Vector3
    quaternion: Quaternion = UPRIGHT
    kind: str = "structure"
    mesh: Mesh | None = field(default=None, compare=False)
    heights: NDArray[np.float64] | None = field(default=None, compare=False)
    model: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Refuse flat and infinite parts."""
        if len(self.size) != SIZES[self.shape]:
            raise ValueError(
                f"{self.shape}: got {len(self.size)} lengths, expected {SIZES[self.shape]}"
            )
        if not all(0.0 < length < np.inf for length in self.size):
            raise ValueError(f"{self.shape}: got lengths {self.size}, expected positive ones")
        if not np.isfinite([*self.position, *self.quaternion]).all():
            raise ValueError(f"{self.shape}: got a pose that is not finite")

    @property
    def R_world_part(self) -> NDArray[np.float64]:
        """Rotation from the part's axes to the world's, (3, 3)."""
        return rotation_of(self.quaternion)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) low and high corner in the world, m; of slanted round parts a little generous."""
        R, centre = self.R_world_part, np.array(self.position)
        if self.mesh is not None:
            corners = centre + self.mesh.vertices @ R.T
            return np.stack([corners.min(axis=0), corners.max(axis=0)])
        low, high = np.array(_extents(self))
        corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
        placed = centre + corners @ R.T
        return np.stack([placed.min(axis=0), placed.max(axis=0)])


def _extents(part: Part) -> tuple[Vector3, Vector3]:
    """Return corners about the part in its own frame."""
    s = part.size
    if part.shape == "heights":
        return (-s[0], -s[1], -s[3]), (s[0], s[1], s[2])
    half = {
        "box": s,
        "ellipsoid": s,
        "sphere": s * 3,
        "cylinder": (s[0], s[0], s[-1]),
        "capsule": (s[0], s[0], s[0] + s[-1]),
    }[part.shape]
    x, y, z = half
    return (-x, -y, -z), (x, y, z)


def bounds_of(parts: Iterable[Part]) -> NDArray[np.float64]:
    """Return the corners (2, 3) of the box about all parts, m."""
    corners = np.array([part.bounds for part in parts])  # (n, 2, 3)
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def moved(part: Part, position: ArrayLike, R: NDArray[np.float64]) -> Part:
    """Return the part in a frame's outer frame, given its pose in that frame.

    Args:
        part: Part in the inner frame.
        position: (3,) of the inner frame, m.
        R: (3, 3) from the inner to the outer frame.
    """
    place = np.asarray(position, np.float64) + R @ part.position
    if np.array_equal(R, np.eye(3)):
        return replace(part, position=vector(place))
    turned = quaternion_of(R @ part.R_world_part)
    return replace(part, position=vector(place), quaternion=turned)


def vector(values: ArrayLike) -> Vector3:
    """Return an array of three as plain numbers."""
    x, y, z = np.asarray(values, np.float64).tolist()
    return x, y, z


def rotation_of(quaternion: Quaternion) -> NDArray[np.float64]:  # (3, 3)
    """Return the rotation of a quaternion w x y z, which need not have unit length."""
    unit = np.array(quaternion) / np.linalg.norm(quaternion)
    rotation: NDArray[np.float64] = rotation_matrices(unit[None])[0]
    return rotation


def quaternion_of(R: NDArray[np.float64]) -> Quaternion:
    """Return the quaternion w x y z of a rotation matrix (3, 3), w at least 0 (Shepperd 1978)."""
    squares = np.array([np.trace(R), R[0, 0], R[1, 1], R[2, 2]])
    i = int(np.argmax(squares))
    if i == 0:
        q = np.array([1.0 + squares[0], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        a, b, c = i - 1, i % 3, (i + 1) % 3
        q = np.empty(4)
        q[0] = R[c, b] - R[b, c]
        q[1 + a] = 1.0 + R[a, a] - R[b, b] - R[c, c]
        q[1 + b], q[1 + c] = R[a, b] + R[b, a], R[a, c] + R[c, a]
    q /= np.linalg.norm(q) * (1.0 if q[0] >= 0.0 else -1.0)
    w, x, y, z = q.tolist()
    return w, x, y, z


def turned_by(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:  # (3, 3)
    """Return the rotation about the fixed axes x, then y, then z, rad."""
    (a, b, c), (s, t, u) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [c * b, c * t * s - u * a, c * t * a + u * s],
            [u * b, u * t * s + c * a, u * t * a - c * s],
            [-t, b * s, b * a],
        ]
    )


def axes_of(normal: NDArray[np.float64]) -> NDArray[np.float64]:  # (3, 3)
    """Return a rotation whose third column is a normal and whose first is level."""
    side = np.cross((0.0, 0.0, 1.0), normal)
    length = float(np.linalg.norm(side))
    x = side / length if length > 1e-12 else np.array([1.0, 0.0, 0.0])
    return np.column_stack([x, np.cross(normal, x), normal])
