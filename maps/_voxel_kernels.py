"""Compiled kernels of the voxel map: beams through cells, and cells by blocks.

All of them live in this file because a cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

# Bits of a cell's mark. The first two last for one sweep, the third until the next decay tick.
CROSSED = 1
HIT = 2
FRESH = 4

# What became of a beam.
RETURNED = 0
CLEARED = 1
DROPPED = 2
TOO_NEAR = 3

NO_RETURN_MM = 65535
DROPPED_MM = 0

BLOCK = 16  # cells along a block's edge
SUBCELL_BITS = 9
SUBCELLS = 1 << SUBCELL_BITS  # positions per cell and axis: 0.2 mm at 10 cm
HALVES = 2 * SUBCELLS  # a position is the middle of its sub-cell, hence odd in this unit
NEVER = 1 << 62
MAX_BEAM_CELLS = 2047  # (2047 * SUBCELLS)^3 * 2 stays below NEVER


@kernel
def place_beams(
    origins: NDArray[np.float64],  # (m, 3) m from the map's corner
    moments: NDArray[np.int32],  # (n,) which of them a beam leaves from
    directions: NDArray[np.float64],  # (n, 3) unit
    ranges_mm: NDArray[np.uint16],  # (n,)
    nearest_mm: int,
    farthest_mm: int,
    resolution: float,
    marks: NDArray[np.uint8],  # (nx, ny, nz)
    ends: NDArray[np.int64],  # (n, 3) out: end of each beam in sub-cells
    fates: NDArray[np.uint8],  # (n,) out
) -> None:
    """Quantise the end of every beam, and mark the cells that hold a return."""
    scale = SUBCELLS / resolution
    nx, ny, nz = marks.shape
    for i in range(ranges_mm.shape[0]):
        millimetres = int(ranges_mm[i])
        if millimetres == DROPPED_MM:
            fates[i] = DROPPED
            continue
        if millimetres < nearest_mm:
            fates[i] = TOO_NEAR
            continue
        fates[i] = RETURNED
        if millimetres == NO_RETURN_MM or millimetres > farthest_mm:
            fates[i] = CLEARED
            millimetres = farthest_mm
        for axis in range(3):
            end = origins[moments[i], axis] + directions[i, axis] * (millimetres / 1000.0)
            ends[i, axis] = np.int64(np.floor(end * scale))
        if fates[i] == RETURNED:
            x = ends[i, 0] >> SUBCELL_BITS
            y = ends[i, 1] >> SUBCELL_BITS
            z = ends[i, 2] >> SUBCELL_BITS
            if 0 <= x < nx and 0 <= y < ny and 0 <= z < nz:
                marks[x, y, z] |= HIT


@kernel
def face_times(start: int, end: int, others: int) -> tuple[int, int]:
    """Along one axis, when a beam meets the first face, and the time from face to face.

    Times are integers over the common denominator 2 |dx| |dy| |dz| in sub-cells; `others` is the
    product of the two other extents.
    """
    inside = 2 * (start & (SUBCELLS - 1)) + 1  # half sub-cells, odd: never on a face
    if start == end:
        return NEVER, 0
    return (HALVES - inside if end > start else inside) * others, HALVES * others


@kernel
def first_axis(times: tuple[int, int, int]) -> int:
    """The axis whose time is least; through an edge or a corner the order is x, y, z."""
    if times[0] <= times[1] and times[0] <= times[2]:
        return 0
    return 1 if times[1] <= times[2] else 2


@kernel
def faces_before(first: int, pitch: int, time: int, ties: bool) -> int:
    """Number of faces at first, first + pitch, ... before `time` (or at it, if `ties`)."""
    limit = time if ties else time - 1
    return 0 if limit < first else (limit - first) // pitch + 1


@kernel
def time_of_leaving(cell: int, last: int, cells: int, first: int, pitch: int) -> int:
    """When a beam from `cell` to `last` leaves a row of cells through its end; or NEVER."""
    faces = cells - 1 - cell if last > cell else cell  # that it can meet and still be inside
    return first + faces * pitch if abs(last - cell) > faces else NEVER


@kernel
def march(
    flat: NDArray[np.uint8],
    cell: int,
    cells: int,
    jumps: tuple[int, int, int],
    times: tuple[int, int, int],
    pitches: tuple[int, int, int],
) -> None:
    """Mark `cells` cells from `cell` on, in the order that the beam meets their faces."""
    jump_x, jump_y, jump_z = jumps
    time_x, time_y, time_z = times
    pitch_x, pitch_y, pitch_z = pitches
    for _ in range(cells):
        flat[cell] |= CROSSED
        # Tried: selects in place of branches; 40 % slower.
        if time_x <= time_y and time_x <= time_z:
            cell += jump_x
            time_x += pitch_x
        elif time_y <= time_z:
            cell += jump_y
            time_y += pitch_y
        else:
            cell += jump_z
            time_z += pitch_z


@kernel
def cross_cells(
    marks: NDArray[np.uint8],  # (nx, ny, nz)
    start: NDArray[np.int64],  # (3,) sub-cells
    end: NDArray[np.int64],  # (3,) sub-cells
    returned: bool,
    floor_layer: int,
) -> None:
    """Mark the cells that one beam crosses; all but the last one, if the beam `returned`.

    The traversal of Amanatides & Woo (1987, "A fast voxel traversal algorithm for ray tracing"),
    exact in integers. An end is the middle of its sub-cell, so that it never lies on a face.
    """
    nx, ny, nz = marks.shape
    x, y, z = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    last_x, last_y, last_z = end[0] >> SUBCELL_BITS, end[1] >> SUBCELL_BITS, end[2] >> SUBCELL_BITS
    dx, dy, dz = abs(end[0] - start[0]), abs(end[1] - start[1]), abs(end[2] - start[2])
    dx, dy, dz = max(dx, 1), max(dy, 1), max(dz, 1)
    time_x, pitch_x = face_times(start[0], end[0], dy * dz)
    time_y, pitch_y = face_times(start[1], end[1], dz * dx)
    time_z, pitch_z = face_times(start[2], end[2], dx * dy)
    step_x = 1 if last_x > x else -1
    step_y = 1 if last_y > y else -1
    step_z = 1 if last_z > z else -1
    steps = abs(last_x - x) + abs(last_y - y) + abs(last_z - z)
    onto_floor = returned and last_z == floor_layer and z > floor_layer

    # A beam from outside goes unmarked until it enters the map.
    while not (0 <= x < nx and 0 <= y < ny and 0 <= z < nz):
        if steps == 0:
            return
        steps -= 1
        axis = first_axis((time_x, time_y, time_z))
        if axis == 0:
            x, time_x = x + step_x, time_x + pitch_x
        elif axis == 1:
            y, time_y = y + step_y, time_y + pitch_y
        else:
            z, time_z = z + step_z, time_z + pitch_z

    # It stops at its end, or where it leaves the map.
    cells = steps if returned else steps + 1
    stop_x = time_of_leaving(x, last_x, nx, time_x, pitch_x)
    stop_y = time_of_leaving(y, last_y, ny, time_y, pitch_y)
    stop_z = time_of_leaving(z, last_z, nz, time_z, pitch_z)
    # One that ends in the floor does not erase the floor on its last, grazing stretch.
    if onto_floor and stop_z == NEVER:
        if z == floor_layer:
            return
        stop_z = time_z + (z - floor_layer - 1) * pitch_z
    times, pitches = (time_x, time_y, time_z), (pitch_x, pitch_y, pitch_z)
    stops = (stop_x, stop_y, stop_z)
    axis = first_axis(stops)
    if stops[axis] != NEVER:
        cells = 1
        for other in range(3):
            cells += faces_before(times[other], pitches[other], stops[axis], other < axis)

    jumps = (step_x * ny * nz, step_y * nz, step_z)
    march(marks.reshape(marks.size), (x * ny + y) * nz + z, cells, jumps, times, pitches)


@kernel
def cross_beams(
    marks: NDArray[np.uint8],  # (nx, ny, nz)
    starts: NDArray[np.int64],  # (m, 3)
    moments: NDArray[np.int32],  # (n,)
    ends: NDArray[np.int64],  # (n, 3)
    fates: NDArray[np.uint8],  # (n,)
    floor_layer: int,
) -> None:
    """Mark the cells that the beams of a sweep cross."""
    for i in range(fates.shape[0]):
        if fates[i] <= CLEARED:
            cross_cells(marks, starts[moments[i]], ends[i], fates[i] == RETURNED, floor_layer)


@kernel
def apply_marks(
    log_odds: NDArray[np.int16],  # (nx, ny, nz)
    marks: NDArray[np.uint8],  # (nx, ny, nz)
    steps: NDArray[np.int32],  # (hit, miss, low, high) in thousandths
    block_box: NDArray[np.int64],  # (2, 3) first and one past the last block to look at
    time_ns: int,
    observed_ns: NDArray[np.int64],  # (bx, by, bz)
    dirty: NDArray[np.bool_],  # (bx, by, bz)
    alive: NDArray[np.bool_],  # (bx, by, bz)
) -> int:
    """Update each marked cell once, a hit before a crossing; return how many were marked."""
    nx, ny, nz = log_odds.shape
    hit, miss, low, high = steps[0], steps[1], steps[2], steps[3]
    total = 0
    for bx in range(block_box[0, 0], block_box[1, 0]):
        for by in range(block_box[0, 1], block_box[1, 1]):
            for bz in range(block_box[0, 2], block_box[1, 2]):
                updated = np.int32(0)
                changed = np.int32(0)
                held = np.int32(0)
                first_z = bz * BLOCK
                last_z = min(first_z + BLOCK, nz)
                for x in range(bx * BLOCK, min(bx * BLOCK + BLOCK, nx)):
                    for y in range(by * BLOCK, min(by * BLOCK + BLOCK, ny)):
                        cells = log_odds[x, y, first_z:last_z]
                        bits = marks[x, y, first_z:last_z]
                        for z in range(cells.shape[0]):
                            mark = np.int32(bits[z])
                            old = np.int32(cells[z])
                            new = min(old + hit, high) if mark & HIT else max(old - miss, low)
                            new = new if mark & (HIT | CROSSED) else old
                            seen = np.int32(1) if mark & (HIT | CROSSED) else np.int32(0)
                            cells[z] = new
                            bits[z] = (mark & FRESH) | (seen * FRESH)
                            updated += seen
                            changed |= new ^ old
                            held |= new
                if updated > 0:
                    total += int(updated)
                    observed_ns[bx, by, bz] = max(observed_ns[bx, by, bz], time_ns)
                    alive[bx, by, bz] = held != 0
                    if changed != 0:
                        dirty[bx, by, bz] = True
    return total


@kernel
def decay_cells(
    log_odds: NDArray[np.int16],  # (nx, ny, nz)
    marks: NDArray[np.uint8],  # (nx, ny, nz)
    factor: int,  # what remains after one tick, in 1/65536
    dirty: NDArray[np.bool_],  # (bx, by, bz)
    alive: NDArray[np.bool_],  # (bx, by, bz)
) -> None:
    """One decay tick: move every cell that is not fresh toward zero; nothing is fresh after it."""
    nx, ny, nz = log_odds.shape
    remains = np.int32(factor)
    for bx, by, bz in np.ndindex(alive.shape):
        if not alive[bx, by, bz]:
            continue
        changed = np.int32(0)
        held = np.int32(0)
        first_z = bz * BLOCK
        last_z = min(first_z + BLOCK, nz)
        for x in range(bx * BLOCK, min(bx * BLOCK + BLOCK, nx)):
            for y in range(by * BLOCK, min(by * BLOCK + BLOCK, ny)):
                cells = log_odds[x, y, first_z:last_z]
                bits = marks[x, y, first_z:last_z]
                for z in range(cells.shape[0]):
                    old = np.int32(cells[z])
                    scaled = old * remains
                    # The shift rounds down; 65535 more makes a negative one round up, to zero.
                    faded = (scaled + (np.int32(65535) if old < 0 else np.int32(0))) >> 16
                    new = old if bits[z] & FRESH else faded
                    cells[z] = new
                    bits[z] = 0
                    changed |= new ^ old
                    held |= new
        alive[bx, by, bz] = held != 0
        if changed != 0:
            dirty[bx, by, bz] = True


@kernel
def cell_states(
    log_odds: NDArray[np.int16],  # (n,)
    states: NDArray[np.uint8],  # (n,) out
) -> None:
    """The sign of the log-odds is the state: 0 unknown, 1 free, 2 occupied."""
    for i in range(log_odds.shape[0]):
        states[i] = (log_odds[i] < 0) + 2 * (log_odds[i] > 0)


@kernel
def pack_blocks(
    log_odds: NDArray[np.int16],  # (nx, ny, nz)
    blocks: NDArray[np.int64],  # (k, 3)
    packed: NDArray[np.int16],  # (k * (BLOCK + 1) * BLOCK * BLOCK,) out
    ends: NDArray[np.int64],  # (k,) out: one past each block's last word
) -> None:
    """Write blocks one after another, a run of equal cells along z in two words, not sixteen.

    Most runs are, in open or unknown space, and hashing the bytes is what a version costs. A run
    starts with 1 (one value follows) or 0 (each cell follows), so no two contents look the same.
    """
    nx, ny, nz = log_odds.shape
    word = 0
    for i in range(blocks.shape[0]):
        bx, by, bz = blocks[i]
        for x in range(bx * BLOCK, min(bx * BLOCK + BLOCK, nx)):
            for y in range(by * BLOCK, min(by * BLOCK + BLOCK, ny)):
                run = log_odds[x, y, bz * BLOCK : min(bz * BLOCK + BLOCK, nz)]
                differ = np.int16(0)
                for z in range(run.shape[0]):
                    differ |= run[z] ^ run[0]
                packed[word] = 1 if differ == 0 else 0
                length = 1 if differ == 0 else run.shape[0]
                for z in range(length):
                    packed[word + 1 + z] = run[z]
                word += 1 + length
        ends[i] = word
