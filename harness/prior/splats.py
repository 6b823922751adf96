"""3D Gaussian splats as a prior map: integer votes for occupied cells.

Each Gaussian votes in the cells within three standard deviations, after it is blurred by the size
of a cell, so that a flat one is not lost between two. A vote is -ln(1 - p) in whole steps, p being
the opacity times the Gaussian's value in 256 steps, so that the sum of the votes of a cell is that
of 1 - prod(1 - p), and does not depend on the order of the Gaussians. A
splat votes occupied alone: where nobody looked there are no Gaussians either.

The file is that of Kerbl et al. 2023 ("3D Gaussian Splatting for Real-Time Radiance Field
Rendering", SIGGRAPH): positions, logarithms of scales, quaternions w x y z, logits of opacities.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.prior.grid import Placement
from wayproof.maps import OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window
from wayproof.maps.elementary import exponentials, sines_cosines
from wayproof.models.world_files import WorldFileError

Array = NDArray[np.float64]

MOST_GAUSSIANS = 5_000_000
MAX_HEADER = 1 << 16  # bytes

NEEDED = (
    *("x", "y", "z", "scale_0", "scale_1", "scale_2"),
    *("rot_0", "rot_1", "rot_2", "rot_3", "opacity"),
)
"""Properties of a vertex that are read."""

TYPES = {
    **{"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8"},
    **{"uchar": "u1", "uint8": "u1", "char": "i1", "int8": "i1"},
    **{"short": "<i2", "int16": "<i2", "ushort": "<u2", "uint16": "<u2"},
    **{"int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4"},
}
"""Types of a property as numpy has them."""

DEVIATIONS = 3.0
"""Standard deviations within which a Gaussian votes."""

LARGEST_DEVIATION = 1.0
"""Greatest standard deviation of a Gaussian that votes, m: larger ones are sky and haze."""

OPAQUE = 255
"""Opacity in whole steps."""

STEPS_OF_SQUARE = 32
"""Steps of a squared distance in deviations, in the table of the Gaussian's values."""

STEPS_OF_VOTE = 64
"""Steps of -ln(1 - p) to a unit."""

OCCUPIED_VOTES = 44
"""Votes from which a cell is occupied: ln 2 in steps, p = 0.5."""

CHUNK = 1 << 19
"""Cells that are looked at together."""

UPS = {"z": (0, 1, 2), "-z": (0, -1, -2), "y": (0, -2, 1), "-y": (0, 2, -1)}
"""Axes of a file along the world's x, y and z, by the axis that points up; -k: against axis k."""


@functools.cache
def votes_of_shares() -> NDArray[np.int32]:
    """Return -ln(1 - p) in steps by p in 256ths; the last is that of p = 0.996."""
    remaining = np.maximum(1.0 - np.arange(256.0) / 256.0, 0.004)
    # The logarithm as the power that gives it: found by bisection on exact exponentials.
    low, high = np.zeros(256), np.full(256, 8.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = exponentials(-middle) > remaining
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.rint(low * STEPS_OF_VOTE).astype(np.int32)


class Gaussians(NamedTuple):
    """Gaussians of a splat, in its own frame and unit.

    Attributes:
        means: (n, 3) positions.
        deviations: (n, 3) standard deviations along their axes.
        quaternions: (n, 4) orientations, w x y z, of any length but 0.
        opacities: (n,) 0 to 1.
    """

    means: Array
    deviations: Array
    quaternions: Array
    opacities: Array


def states_by(votes: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Return the states (nx, ny, nz) of cells by their votes: occupied or unknown."""
    states: NDArray[np.uint8] = np.where(
        votes >= OCCUPIED_VOTES, np.uint8(OCCUPIED), np.uint8(UNKNOWN)
    )
    return states


def read_splat(path: Path) -> Gaussians:
    """Read a binary `.ply` of Gaussians.

    Raises:
        WorldFileError: It is none.
    """
    with path.open("rb") as file:
        head = file.read(MAX_HEADER).partition(b"end_header\n")
        lines = head[0].decode("ascii", "replace").splitlines()
        count, record = _layout(path, lines)
        if not head[1]:
            raise WorldFileError(path, "no 'end_header'")
        file.seek(len(head[0]) + len(head[1]))
        data = file.read(count * record.itemsize)
    if len(data) != count * record.itemsize:
        raise WorldFileError(path, f"ends after {len(data)} of {count * record.itemsize} bytes")
    table = np.frombuffer(data, record, count)

    def stack(*names: str) -> Array:
        return np.stack([table[name].astype(np.float64) for name in names], axis=1)

    logits = np.clip(stack("opacity")[:, 0], -50.0, 50.0)
    scales = np.clip(stack("scale_0", "scale_1", "scale_2"), -50.0, 20.0)
    return Gaussians(
        stack("x", "y", "z"),
        exponentials(scales.ravel()).reshape(-1, 3),
        stack("rot_0", "rot_1", "rot_2", "rot_3"),
        1.0 / (1.0 + exponentials(-logits)),
    )


def _layout(path: Path, lines: list[str]) -> tuple[int, np.dtype[np.void]]:
    """Return the number of vertices and the layout of each, by the head of a file."""
    words = [line.split() for line in lines if line.split()]
    if not words or words[0] != ["ply"]:
        raise WorldFileError(path, "got no 'ply' in the first line, expected a splat", 1)
    if ["format", "binary_little_endian", "1.0"] not in words:
        raise WorldFileError(path, "expected 'format binary_little_endian 1.0'")
    elements = [line for line in words if line[0] == "element"]
    if not elements or elements[0][1:2] != ["vertex"] or not elements[0][-1].isdecimal():
        raise WorldFileError(path, "expected 'element vertex N' before any other element")
    count = int(elements[0][-1])
    if not 1 <= count <= MOST_GAUSSIANS:
        raise WorldFileError(path, f"{count} Gaussians, expected 1 to {MOST_GAUSSIANS}")
    first = words.index(elements[0])
    end = words.index(elements[1]) if len(elements) > 1 else len(words)
    properties = [line for line in words[first:end] if line[0] == "property"]
    fields = [
        (line[2], TYPES[line[1]]) for line in properties if len(line) == 3 and line[1] in TYPES
    ]
    names = [name for name, _ in fields]
    missing = [name for name in NEEDED if name not in names]
    if missing:
        raise WorldFileError(
            path, f"no property {', '.join(missing)}: no 3D Gaussian Splatting file"
        )
    if len(fields) != len(properties) or len(set(names)) != len(names):
        raise WorldFileError(path, "a list, an unknown type or a name twice among its properties")
    return count, np.dtype(fields)


def poll(
    splat: Gaussians, window: Window, placement: Placement, scale: float = 1.0, up: str = "z"
) -> NDArray[np.int32]:
    """Count the votes (nx, ny, nz) of a splat in the cells of a window.

    Gaussians with a number that is not finite, without opacity or of more than a metre do not vote.

    Args:
        splat: Splat in its own frame and unit.
        window: The cells.
        placement: Pose of the splat in the world, after its axes are turned and its unit is m.
        scale: Metres in a unit of the splat.
        up: Axis of the splat that points up: a key of `UPS`.
    """
    finite = np.isfinite(np.column_stack(splat)).all(axis=1)
    finite &= np.square(splat.quaternions).sum(axis=1) > 0.0
    deviations = splat.deviations * scale
    opacities = np.rint(np.where(finite, splat.opacities, 0.0) * OPAQUE).astype(np.int64)
    small = deviations.max(axis=1) <= LARGEST_DEVIATION
    used = np.flatnonzero(finite & (opacities > 0) & small)
    means, covariances = _in_world(
        Gaussians(*(part[used] for part in splat))._replace(deviations=deviations[used]),
        placement,
        scale,
        up,
        cell=window.resolution,
    )
    votes = np.zeros(window.shape, np.int32)
    _vote(votes, means, covariances, opacities[used], window)
    return votes


def _in_world(
    splat: Gaussians, placement: Placement, scale: float, up: str, cell: float
) -> tuple[Array, Array]:
    """Read positions (n, 3), m, and covariances (n, 6): xx, yy, zz, xy, xz, yz, m^2, blurred.

    Without products of matrices, whose last bits depend on the processor.
    """
    turn = _turned(placement.yaw, up)
    local = splat.means * scale
    offset = placement.x, placement.y, placement.z
    means = np.stack([_row(turn, k, local) + offset[k] for k in range(3)], axis=1)
    own = _rotations(splat.quaternions)  # [row][column] (n,)
    R = [[_along(turn, i, [own[k][j] for k in range(3)]) for j in range(3)] for i in range(3)]
    squares = np.square(splat.deviations)
    blur = cell * cell / 12.0

    def entry(i: int, j: int) -> Array:
        total = R[i][0] * R[j][0] * squares[:, 0]
        total = total + R[i][1] * R[j][1] * squares[:, 1]
        total = total + R[i][2] * R[j][2] * squares[:, 2]
        return total + blur if i == j else total

    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return means, np.stack([entry(i, j) for i, j in pairs], axis=1)


def _turned(yaw: float, up: str) -> list[list[float]]:
    """Return the rotation from a splat's axes to the world's: up first, then the yaw."""
    sines, cosines = sines_cosines(np.array([yaw]))
    c, s = float(cosines[0]), float(sines[0])
    upright = [[0.0, 0.0, 0.0] for _ in range(3)]
    for row, axis in enumerate(UPS[up]):
        upright[row][abs(axis)] = -1.0 if axis < 0 else 1.0
    x, y, z = upright
    return [
        [c * a - s * b for a, b in zip(x, y, strict=True)],
        [s * a + c * b for a, b in zip(x, y, strict=True)],
        z,
    ]


def _row(turn: list[list[float]], k: int, points: Array) -> Array:
    return _along(turn, k, [points[:, axis] for axis in range(3)])


def _along(turn: list[list[float]], k: int, parts: list[Array]) -> Array:
    x, y, z = parts
    total: Array = turn[k][0] * x + turn[k][1] * y
    return total + turn[k][2] * z


def _rotations(quaternions: Array) -> list[list[Array]]:
    """Return the rotation matrices of quaternions (n, 4), w x y z, entry by entry (n,)."""
    w, x, y, z = (quaternions / np.sqrt(np.square(quaternions).sum(axis=1))[:, None]).T
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]


def _vote(
    votes: NDArray[np.int32],
    means: Array,
    covariances: Array,
    opacities: NDArray[np.int64],
    window: Window,
) -> None:
    """Add the votes of Gaussians."""
    size = window.resolution
    reach = DEVIATIONS * np.sqrt(covariances[:, :3])
    first = np.floor((means - reach - window.origin) / size).astype(np.int64)
    end = np.floor((means + reach - window.origin) / size).astype(np.int64) + 1
    first, end = np.clip(first, 0, window.shape), np.clip(end, 0, window.shape)
    shapes = end - first
    counts = shapes[:, 0] * shapes[:, 1] * shapes[:, 2]
    inverses = _inverses(covariances)
    flat = votes.reshape(-1)
    _, ny, nz = window.shape
    for part in _chunks(np.flatnonzero(counts), counts):
        index = np.repeat(part, counts[part])
        begins = np.cumsum(counts[part]) - counts[part]
        place = np.arange(len(index)) - np.repeat(begins, counts[part])
        x, rest = np.divmod(place, shapes[index, 1] * shapes[index, 2])
        y, z = np.divmod(rest, shapes[index, 2])
        cells = np.stack([x, y, z], axis=1) + first[index]
        dx, dy, dz = (window.origin + (cells + 0.5) * size - means[index]).T
        xx, yy, zz, xy, xz, yz = inverses[index].T
        squared = dx * dx * xx + dy * dy * yy + dz * dz * zz
        squared = squared + 2.0 * (dx * dy * xy + dx * dz * xz + dy * dz * yz)
        near = squared < DEVIATIONS * DEVIATIONS
        steps = (np.maximum(squared[near], 0.0) * STEPS_OF_SQUARE).astype(np.int64)
        shares = opacities[index[near]] * _values()[steps] // OPAQUE  # of 65536
        where = (cells[near, 0] * ny + cells[near, 1]) * nz + cells[near, 2]
        np.add.at(flat, where, votes_of_shares()[np.minimum(shares, 65535) >> 8])


@functools.cache
def _values() -> NDArray[np.int64]:
    """Return exp(-m^2 / 2) in 65536ths, by the squared distance m^2 in steps."""
    squares = np.arange(DEVIATIONS * DEVIATIONS * STEPS_OF_SQUARE + 1.0) / STEPS_OF_SQUARE
    values: NDArray[np.int64] = np.rint(65536.0 * exponentials(-0.5 * squares)).astype(np.int64)
    return values


def _chunks(chosen: NDArray[np.int64], counts: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Split Gaussians into parts of some hundred thousand cells; the split changes no vote."""
    ends = np.cumsum(counts[chosen])
    begin = 0
    while begin < len(chosen):
        before = int(ends[begin - 1]) if begin else 0
        end = max(int(np.searchsorted(ends, before + CHUNK, side="right")), begin + 1)
        yield chosen[begin:end]
        begin = end


def _inverses(covariances: Array) -> Array:
    """Return inverses of symmetric matrices (n, 6), as xx, yy, zz, xy, xz, yz."""
    a, b, c, d, e, f = covariances.T  # [[a d e] [d b f] [e f c]]
    xx, yy, zz = b * c - f * f, a * c - e * e, a * b - d * d
    xy, xz, yz = e * f - d * c, d * f - b * e, d * e - a * f
    determinant = a * xx + d * xy + e * xz
    inverses: Array = np.stack([xx, yy, zz, xy, xz, yz], axis=1) / determinant[:, None]
    return inverses
