"""Compiled kernels of the distance field: one exact pass per axis, over blocks of rows.

A plane of constant x is cut into blocks of a few rows along y; a row holds the cells along z.
Blocks are what is recomputed or left. The cells of a block are cut into units, and those of one
number lie side by side for all planes, so that the pass along x finds four planes at once.

Arrays of cells are flat, and told by an unsigned place: a slice of an array would have its
references counted, which took 40 % of the time.

All kernels live in this file because a cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import inlined, kernel
from wayproof.maps.kernels.intrinsics import Queue, prefetch, take

WORD_BITS = 64
MAX_REACH = 181  # cells; twice its square still fits 16 bits
FAR = 32767  # above every squared distance; the greatest of them added, it still fits 16 bits
LINE = 32  # cells of a cache line
SHARES = 4  # each thread takes such a part of what is left for it
UNIT = 128  # cells of a block that lie together: beside those of the next plane
LONGEST_STEP = 128  # of the powers of two, the last below the greatest reach

BYTE = np.uint64(0xFF)
B01 = np.uint64(0x0101010101010101)
UNSET = np.array(
    [sum(0xFF << (8 * k) for k in range(8) if not byte >> k & 1) for byte in range(256)], np.uint64
)

Squares = tuple[np.uint16, np.uint16, np.uint16, np.uint16]


@kernel
def differ(
    cells: NDArray[np.uint64],  # from a place on
    first: int,
    flip: np.uint64,  # all ones where the cells told are those that are not blocked
    inside: NDArray[np.uint64],  # (block_rows * words,) the bits that are cells of the window
    known: NDArray[np.uint64],  # from a place on
    at: int,
    words: int,
) -> bool:
    """Whether any of so many words of cells are not as they are known."""
    source, old, found = np.uint64(first), np.uint64(at), np.uint64(0)
    for k in range(np.uint64(words)):
        found |= ((cells[source + k] ^ flip) & inside[k]) ^ known[old + k]
    return bool(found != np.uint64(0))


@kernel
def note_changes(
    cells: NDArray[np.uint64],  # (ky * words,) the new cells of a plane's columns
    rows: tuple[int, int],  # first and one past the last of them to look at
    y0: int,  # where the first of all lies in the window
    flip: np.uint64,  # all ones where the cells told are those that are not blocked
    inside: NDArray[np.uint64],  # (block_rows * words,) the bits that are cells of the window
    block_rows: int,
    words: int,  # of a column
    known: NDArray[np.uint64],  # (ny * words,) in, out
    changes: NDArray[np.int64],  # (blocks, 2) out: first and last changed column of each block
) -> bool:
    """Take over the new cells of a plane; whether any changed."""
    found = False
    for b in range(changes.shape[0]):
        changes[b, 0], changes[b, 1] = -1, -1
        low, high = b * block_rows, (b + 1) * block_rows
        low, high = max(low, y0 + rows[0]), min(high, y0 + rows[1])
        first, at, count = (low - y0) * words, low * words, (high - low) * words
        if count <= 0 or not differ(cells, first, flip, inside, known, at, count):
            continue
        for k in range(count):
            word = (cells[first + k] ^ flip) & inside[k]
            if word != known[at + k]:
                known[at + k] = word
                y = low + k // words
                if changes[b, 0] < 0:
                    changes[b, 0] = y
                changes[b, 1] = y
        found = True
    return found


@kernel
def find_pending(
    changes: NDArray[np.int64],  # (blocks, 2)
    reach: int,
    block_rows: int,
    farthest: NDArray[np.uint16],  # (blocks,) greatest value of each block of the section
    x: int,
    pending: NDArray[np.bool_],  # (blocks, nx) in, out
    least_bound: NDArray[np.uint16],  # (blocks, nx) in, out
) -> None:
    """Find the blocks of rows of a plane that its changed columns may change, and by how little.

    A change at distance j along y brings or takes away values of j^2 or more. It matters only to a
    block that holds as much: less, and nothing there was attained through the changed column, nor
    can be. What a block holds is not known while an earlier change is pending.
    """
    blocks = changes.shape[0]
    below = -reach  # nearest changed column
    for b in range(blocks):
        j = 0 if changes[b, 0] >= 0 else b * block_rows - below
        if j < reach and (pending[b, x] or j * j <= farthest[b]):
            pending[b, x] = True
            least_bound[b, x] = min(least_bound[b, x], np.uint16(j * j))
        below = changes[b, 1] if changes[b, 1] >= 0 else below
    above = blocks * block_rows + reach
    for b in range(blocks - 1, -1, -1):
        j = above - (b + 1) * block_rows + 1
        if j < reach and (pending[b, x] or j * j <= farthest[b]):
            pending[b, x] = True
            least_bound[b, x] = min(least_bound[b, x], np.uint16(j * j))
        above = changes[b, 0] if changes[b, 0] >= 0 else above


@kernel
def lower(
    target: NDArray[np.uint16],  # (n,) in, out
    sources: NDArray[np.uint16],
    at: int,  # where those at no distance begin
    pitch: int,  # from there to the next ones on either side
    j: int,
    reach: int,
) -> int:
    """Lower each element to what leads through the sources at distances j to j + 3.

    Eight sources at once, because loading and storing the target, and calling, would cost most of
    the time. What is farther than `reach` is taken as that far, and changes nothing.

    Returns:
        The greatest element.
    """
    e, f, g = min(j + 1, reach), min(j + 2, reach), min(j + 3, reach)
    first, second = np.uint16(j * j), np.uint16(e * e)
    third, fourth = np.uint16(f * f), np.uint16(g * g)
    step, below, above = np.uint64(pitch), np.uint64(at - j * pitch), np.uint64(at + j * pitch)
    below2, above2 = below - step, above + step
    below3, above3 = below2 - step, above2 + step
    below4, above4 = below3 - step, above3 + step
    greatest = np.uint16(0)
    for k in range(np.uint64(target.shape[0])):
        a = np.uint16(min(sources[below + k], sources[above + k]) + first)
        b = np.uint16(min(sources[below2 + k], sources[above2 + k]) + second)
        c = np.uint16(min(sources[below3 + k], sources[above3 + k]) + third)
        d = np.uint16(min(sources[below4 + k], sources[above4 + k]) + fourth)
        least = min(target[k], min(min(a, b), min(c, d)))
        target[k] = least
        greatest = max(greatest, least)
    return int(greatest)


@inlined
def through(
    one: np.uint16, two: np.uint16, three: np.uint16, four: np.uint16, squares: Squares
) -> np.uint16:
    """The least that leads through sources at four distances, each the nearer one of two sides."""
    first, second = np.uint16(one + squares[0]), np.uint16(two + squares[1])
    third, fourth = np.uint16(three + squares[2]), np.uint16(four + squares[3])
    return np.uint16(min(min(first, second), min(third, fourth)))


@kernel
def lower_planes(
    target: NDArray[np.uint16],  # four units from a place on: in, out
    to: int,
    sources: NDArray[np.uint16],
    at: int,  # where that of the first plane at no distance begins; others before and after it
    j: int,
    reach: int,
) -> int:
    """Lower units of four successive planes to what leads through those at distances j to j + 3.

    As `lower`, in a third of the time: of the 32 sources of four planes 14 differ, and each is
    loaded once. The length of a unit is known when this is compiled: told as an argument, it takes
    three times as long.
    """
    e, f, g = min(j + 1, reach), min(j + 2, reach), min(j + 3, reach)
    squares = np.uint16(j * j), np.uint16(e * e), np.uint16(f * f), np.uint16(g * g)
    one, above, below = np.uint64(UNIT), np.uint64(at + j * UNIT), np.uint64(at - (j + 3) * UNIT)
    two, three, four = np.uint64(2 * UNIT), np.uint64(3 * UNIT), np.uint64(4 * UNIT)
    five, six = np.uint64(5 * UNIT), np.uint64(6 * UNIT)
    first, greatest = np.uint64(to), np.uint16(0)
    for k in range(np.uint64(UNIT)):
        u, d, t = above + k, below + k, first + k
        u0, u1, u2, u3 = sources[u], sources[u + one], sources[u + two], sources[u + three]
        u4, u5, u6 = sources[u + four], sources[u + five], sources[u + six]
        d0, d1, d2, d3 = sources[d], sources[d + one], sources[d + two], sources[d + three]
        d4, d5, d6 = sources[d + four], sources[d + five], sources[d + six]
        t0 = through(min(u0, d3), min(u1, d2), min(u2, d1), min(u3, d0), squares)
        t1 = through(min(u1, d4), min(u2, d3), min(u3, d2), min(u4, d1), squares)
        t2 = through(min(u2, d5), min(u3, d4), min(u4, d3), min(u5, d2), squares)
        t3 = through(min(u3, d6), min(u4, d5), min(u5, d4), min(u6, d3), squares)
        t0, t1 = min(target[t], t0), min(target[t + one], t1)
        t2, t3 = min(target[t + two], t2), min(target[t + three], t3)
        target[t], target[t + one], target[t + two], target[t + three] = t0, t1, t2, t3
        greatest = max(greatest, max(max(t0, t1), max(t2, t3)))
    return int(greatest)


@kernel
def copy_block(target: NDArray[np.uint16], sources: NDArray[np.uint16], at: int) -> int:
    """Copy from a place, and return the greatest element."""
    first, greatest = np.uint64(at), np.uint16(0)
    for k in range(np.uint64(target.shape[0])):
        target[k] = sources[first + k]
        greatest = max(greatest, target[k])
    return int(greatest)


@kernel
def fill(target: NDArray[np.uint16], value: int) -> None:
    """Set every element; a slice assignment does the same and takes a second to compile."""
    for k in range(target.shape[0]):
        target[k] = value


@kernel
def keep_unit(
    result: NDArray[np.uint16],  # from a place on
    at: int,
    cells: int,
    kept: NDArray[np.uint16],  # out from a place on
    to: int,
) -> int:
    """Keep a part of a result; return its least element."""
    source, first, least = np.uint64(at), np.uint64(to), np.uint16(FAR)
    for k in range(np.uint64(cells)):
        kept[first + k] = result[source + k]
        least = min(least, result[source + k])
    return int(least)


@kernel
def measure_rows(
    known: NDArray[np.uint64],  # (ny * words,)
    words: int,  # of a column
    y: int,  # first row of the block; rows beyond the last one hold nothing
    reach: int,
    nz: int,
    block_rows: int,
    work: NDArray[np.uint8],  # (2, pad + block_rows * pitch + pad) scratch
    eights: NDArray[np.uint64],  # (2, ...) the same memory
    distances: NDArray[np.uint8],  # out from a place on
    at: int,
) -> bool:
    """Distance along z to the nearest blocked cell, at most reach; whether there is any.

    Distances along a line come from doubling: after steps of 1, 2, 4, ..., 2^m each cell knows the
    nearest within 2^(m+1) - 1. All rows are done as one line, kept apart by `reach` cells.
    """
    pitch = (work.shape[1] - 2 * LONGEST_STEP) // block_rows
    far, nothing = np.uint64(reach) * B01, np.uint64(0)
    for k in range(eights.shape[1]):
        eights[0, k] = far
        eights[1, k] = far
    united = nothing
    for row in range(min(block_rows, known.shape[0] // words - y)):
        for w in range(words):
            word = known[(y + row) * words + w]
            united |= word
            place = (LONGEST_STEP + row * pitch + w * WORD_BITS) >> 3
            for k in range(min(8, (nz - w * WORD_BITS + 7) >> 3)):
                eights[0, place + k] = UNSET[word & BYTE] & far
                word >>= np.uint64(8)
    source, target, step = int(np.int64(0)), int(np.int64(1)), 1
    while step < reach and united != nothing:
        apart, most = np.uint64(step), np.uint8(255 - step)
        for k in range(np.uint64(LONGEST_STEP), np.uint64(work.shape[1] - LONGEST_STEP)):
            nearer = min(work[source, k - apart], work[source, k + apart])
            through = np.uint8(min(nearer, most) + np.uint8(step))
            work[target, k] = min(work[source, k], through)
        source, target = target, source
        step *= 2
    for row in range(block_rows):
        first, to = np.uint64(LONGEST_STEP + row * pitch), np.uint64(at + row * nz)
        for k in range(np.uint64(nz)):
            distances[to + k] = work[source, first + k]
    return bool(united != nothing)


@kernel
def square(
    distances: NDArray[np.uint8],
    at: int,
    cells: int,
    squared: NDArray[np.uint16],  # out from a place on
    to: int,
) -> None:
    """Square the distances from a place on."""
    source, target = np.uint64(at), np.uint64(to)
    for k in range(np.uint64(cells)):
        distance = np.uint16(distances[source + k])
        squared[target + k] = np.uint16(distance * distance)


@kernel
def blocks_around(reach: int, block_rows: int) -> int:
    """Blocks on either side of one that sources may lie in: of four distances at once."""
    return int(-(-(reach + 3) // block_rows))


@kernel
def planes_around(reach: int) -> int:
    """Planes on either side of one that sources may lie in: of four planes and distances at once.

    A distance less than the reach, three more, and three planes beside.
    """
    return reach + 5


@kernel
def take_part(queue: Queue, count: int, threads: int) -> tuple[int, int]:
    """Take the next of so many items: many at first, and ever fewer, so that all end together.

    Guided self-scheduling (Polychronopoulos & Kuck 1987). Neighbours are taken together, as they
    share cache lines.

    Returns:
        The first, and one past the last; equal where none is left.
    """
    some = max(1, (count - queue[0]) // (SHARES * threads))
    first = take(queue, some)
    return min(first, count), min(first + some, count)


@inlined
def take_plane(
    x: int,
    cells: NDArray[np.uint64],  # (kx, ky * words) new ones
    rows: tuple[int, int],  # first and one past the last row of them to look at
    corner: tuple[int, int],  # where the first column of them lies in the window
    flip: np.uint64,  # all ones where the cells told are those that are not blocked
    inside: NDArray[np.uint64],  # (block_rows * words,) the bits that are cells of the window
    reach: int,
    block_rows: int,
    words: int,  # of a column
    farthest: NDArray[np.uint16],  # (nx, blocks) greatest value of each block of the sections
    known: NDArray[np.uint64],  # (nx, ny * words) in, out
    unmeasured: NDArray[np.bool_],  # (nx, blocks) in, out: whether distances along z are outdated
    pending: NDArray[np.bool_],  # (blocks, nx) in, out: whether a section is outdated
    least_bound: NDArray[np.uint16],  # (blocks, nx) in, out: values less than it do not change
    changes: NDArray[np.int64],  # (blocks, 2) scratch
) -> None:
    """Take over the new cells of a plane, and note what they make outdated."""
    new = cells[x - corner[0]]
    if note_changes(new, rows, corner[1], flip, inside, block_rows, words, known[x], changes):
        for b in range(changes.shape[0]):
            unmeasured[x, b] |= changes[b, 0] >= 0
        find_pending(changes, reach, block_rows, farthest[x], x, pending, least_bound)


@kernel
def find_stale(
    reach: int,
    farthest: NDArray[np.uint16],  # (blocks, nx) greatest value of each block of the field
    least_bound: NDArray[np.uint16],  # (blocks, nx) of the sections; no change afterwards
    stale: NDArray[np.bool_],  # (blocks, nx) in, out
    reached: NDArray[np.uint16],  # (nx,) scratch
) -> None:
    """Find the blocks of the field that changes of the sections may change, as along y."""
    for b in range(stale.shape[0]):
        if not spread_changes(least_bound[b], reach, reached):
            continue
        for x in range(reached.shape[0]):
            stale[b, x] |= reached[x] <= farthest[b, x]
            least_bound[b, x] = FAR


@inlined
def update_plane(
    x: int,
    needed: NDArray[np.bool_],  # (blocks, nx)
    reach: int,
    nz: int,
    block_rows: int,
    words: int,  # of a column
    known: NDArray[np.uint64],  # (ny * words,)
    unmeasured: NDArray[np.bool_],  # (nx, blocks) in, out
    distances: NDArray[np.uint8],  # (nx * blocks * cells,) along z, in, out
    holds_any: NDArray[np.bool_],  # (nx, blocks) whether any cell is blocked, in, out
    sections: NDArray[np.uint16],  # (blocks * units * (around + nx + around) * UNIT,) in, out
    farthest: NDArray[np.uint16],  # (nx, blocks) in, out: greatest value of each block of them
    nearest: NDArray[np.uint16],  # (blocks, units, around + nx + around) out: least value
    pending: NDArray[np.bool_],  # (blocks, nx) in, out
    along: NDArray[np.uint16],  # ((blocks + 2 around) * cells,) scratch; reach^2 on either side
    work: NDArray[np.uint8],  # (2, 2 * LONGEST_STEP + block_rows * pitch) scratch
    eights: NDArray[np.uint64],  # the same memory
    result: NDArray[np.uint16],  # (block_rows * nz,) scratch
    squared: NDArray[np.int64],  # (blocks,) in, out: the plane whose squares a block holds
) -> None:
    """Find the squared distance within a plane where it is needed.

    Beyond the window nothing is blocked: its border comes at the end.
    """
    (blocks, units, all_planes), cells = nearest.shape, result.shape[0]
    around, plane = blocks_around(reach, block_rows), planes_around(reach) + x
    for b in range(blocks):
        if not needed[b, x]:
            continue
        for unit in range(units):
            ask_for(sections, ((b * units + unit) * all_planes + plane) * UNIT, UNIT)
        any_near = False
        for c in range(max(0, b - around), min(blocks, b + around + 1)):
            at = (x * blocks + c) * cells
            if unmeasured[x, c]:
                rows = c * block_rows
                holds_any[x, c] = measure_rows(
                    known, words, rows, reach, nz, block_rows, work, eights, distances, at
                )
                unmeasured[x, c] = False
            any_near |= holds_any[x, c]
            if squared[c] != x:
                squared[c] = x
                square(distances, at, cells, along, (c + around) * cells)
        first = (b + around) * cells
        greatest = copy_block(result, along, first)
        j, most = 1, min(reach, known.shape[0] // words) if any_near else 0
        while j < most and j * j < greatest:
            greatest = lower(result, along, first, nz, j, reach)
            j += 4
        farthest[x, b] = greatest
        for unit in range(units):
            to, first = ((b * units + unit) * all_planes + plane) * UNIT, unit * UNIT
            some = min(UNIT, cells - first)
            nearest[b, unit, plane] = keep_unit(result, first, some, sections, to)
        pending[b, x] = False


@kernel
def update_sections(
    queue: Queue,  # of the planes
    threads: int,
    planes: NDArray[np.int64],  # (k,)
    steps: tuple[bool, bool],  # whether to take over new cells, and whether to find distances
    cells: NDArray[np.uint64],  # (kx, ky * words) new ones
    rows: tuple[int, int],  # first and one past the last row of them to look at
    corner: tuple[int, int],  # where the first column of them lies in the window
    flip: np.uint64,  # all ones where the cells told are those that are not blocked
    inside: NDArray[np.uint64],  # (block_rows * words,) the bits that are cells of the window
    needed: NDArray[np.bool_],  # (blocks, nx)
    reach: int,
    nz: int,
    block_rows: int,
    known: NDArray[np.uint64],  # (nx, ny * words) in, out
    unmeasured: NDArray[np.bool_],  # (nx, blocks) in, out: whether distances along z are outdated
    distances: NDArray[np.uint8],  # (nx * blocks * cells,) along z, in, out
    holds_any: NDArray[np.bool_],  # (nx, blocks) whether any cell is blocked, in, out
    sections: NDArray[np.uint16],  # (blocks * units * (around + nx + around) * UNIT,) in, out
    farthest: NDArray[np.uint16],  # (nx, blocks) in, out: greatest value of each block of them
    nearest: NDArray[np.uint16],  # (blocks, units, around + nx + around) in, out: least value
    pending: NDArray[np.bool_],  # (blocks, nx) in, out: whether a section is outdated
    least_bound: NDArray[np.uint16],  # (blocks, nx) in, out: values less than it do not change
    changes: NDArray[np.int64],  # (blocks, 2) scratch
    along: NDArray[np.uint16],  # ((blocks + 2 around) * cells,) scratch
    work: NDArray[np.uint8],  # (2, 2 * LONGEST_STEP + block_rows * pitch) scratch
    eights: NDArray[np.uint64],  # the same memory
    result: NDArray[np.uint16],  # (block_rows * nz,) scratch
    squared: NDArray[np.int64],  # (blocks,) scratch: the plane whose squares a block holds
) -> None:
    """Take over new cells, find the squared distances within planes, or both, plane by plane."""
    words = inside.shape[0] // block_rows
    first, end = take_part(queue, planes.shape[0], threads)
    if first < end and steps[1]:
        fill(along, reach * reach)
        for b in range(squared.shape[0]):
            squared[b] = -1
    while first < end:
        for i in range(first, end):
            x = planes[i]
            if steps[0]:
                take_plane(
                    x,
                    cells,
                    rows,
                    corner,
                    flip,
                    inside,
                    reach,
                    block_rows,
                    words,
                    farthest,
                    known,
                    unmeasured,
                    pending,
                    least_bound,
                    changes,
                )
            if steps[1]:
                update_plane(
                    x,
                    needed,
                    reach,
                    nz,
                    block_rows,
                    words,
                    known[x],
                    unmeasured,
                    distances,
                    holds_any,
                    sections,
                    farthest,
                    nearest,
                    pending,
                    along,
                    work,
                    eights,
                    result,
                    squared,
                )
        first, end = take_part(queue, planes.shape[0], threads)


@kernel
def spread_changes(
    least_change: NDArray[np.uint16],  # (nx,) of a row of blocks
    reach: int,
    reached: NDArray[np.uint16],  # (nx,) out
) -> bool:
    """The least value that each block may lose or get from the changes around; whether any may."""
    nx, found = least_change.shape[0], False
    for x in range(nx):
        reached[x] = least_change[x]
        found |= least_change[x] != FAR
    if not found:
        return False
    for j in range(1, reach):
        farther, step = np.uint16(j * j), np.uint64(j)
        for x in range(step, np.uint64(nx)):
            reached[x] = min(reached[x], np.uint16(least_change[x - step] + farther))
        for x in range(np.uint64(max(nx - j, 0))):
            reached[x] = min(reached[x], np.uint16(least_change[x + step] + farther))
    return True


@kernel
def border_distance(position: int, cells: int, reach: int) -> int:
    """Cells to the nearest one outside along an axis, at most reach; an axis of one has none."""
    return min(position + 1, cells - position, reach) if cells > 1 else reach


@kernel
def list_bounds(
    rows: tuple[int, int],  # first and one past the last of a block
    shape: tuple[int, int, int],
    reach: int,
    bounds: NDArray[np.uint16],  # (units * UNIT,) out
) -> None:
    """Squared distances along y and z to what lies outside; 0 where a block has no cells."""
    _, ny, nz = shape
    fill(bounds, 0)
    for y in range(rows[0], min(rows[1], ny)):
        across, first = border_distance(y, ny, reach), (y - rows[0]) * nz
        for z in range(nz):
            least = min(border_distance(z, nz, reach), across)
            bounds[first + z] = least * least


@kernel
def ask_for(cells: NDArray[np.uint16], at: int, count: int) -> None:
    """Ask for cells that will be written, while they are worked out: see `prefetch`."""
    for k in range(np.uint64(at), np.uint64(at + count), np.uint64(LINE)):
        prefetch(cells, np.uint64(k))


@kernel
def take_planes(
    target: NDArray[np.uint16],  # four units from a place on: out
    to: int,
    sections: NDArray[np.uint16],  # likewise
    at: int,
    bounds: NDArray[np.uint16],  # one unit from a place on
    bound: int,
    limits: NDArray[np.uint16],  # (4,) of each plane
) -> int:
    """Copy units of four planes, cut off at bounds and limits; return the greatest element."""
    greatest, least_of = np.uint16(0), np.uint64(bound)
    for plane in range(4):
        first, source = np.uint64(to + plane * UNIT), np.uint64(at + plane * UNIT)
        limit = limits[plane]
        for k in range(np.uint64(UNIT)):
            least = min(sections[source + k], min(bounds[least_of + k], limit))
            target[first + k] = least
            greatest = max(greatest, least)
    return int(greatest)


@kernel
def least_around(nearest: NDArray[np.uint16], at: int, j: int) -> int:
    """The least of what four successive planes find at distances j to j + 3."""
    least = np.uint16(FAR)
    for k in range(7):
        least = min(least, min(nearest[at + j + k], nearest[at - j - 3 + k]))
    return int(least)


@kernel
def update_planes(
    b: int,
    x: int,  # first of four planes
    reach: int,
    most: int,  # distance along x up to which to look
    sections: NDArray[np.uint16],
    nearest: NDArray[np.uint16],  # (blocks, units, around + nx + around)
    bounds: NDArray[np.uint16],  # (units * UNIT,)
    limits: NDArray[np.uint16],  # (4,) greatest value of each plane, 0 where it is not asked for
    result: NDArray[np.uint16],  # (units * 4 * UNIT,) out
) -> None:
    """The squared distance in a block of four planes, from the sections around."""
    _, units, all_planes = nearest.shape
    plane = planes_around(reach) + x
    for unit in range(units):
        at, to = ((b * units + unit) * all_planes + plane) * UNIT, unit * 4 * UNIT
        greatest = take_planes(result, to, sections, at, bounds, unit * UNIT, limits)
        j = int(np.int64(1))  # a plain 1 would be compiled for itself
        while j < most and j * j < greatest:
            if least_around(nearest[b, unit], plane, j) + j * j < greatest:
                greatest = lower_planes(result, to, sections, at, j, reach)
            j += 4


@kernel
def write_block(
    result: NDArray[np.uint16],  # (units * 4 * UNIT,)
    plane: int,  # which of the four
    squared: NDArray[np.uint16],  # out from a place on
    to: int,
    cells: int,
) -> int:
    """Write the cells of a block; return the greatest."""
    first, greatest = np.uint64(to), np.uint16(0)
    for unit in range(result.shape[0] // (4 * UNIT)):
        at = np.uint64((4 * unit + plane) * UNIT)
        for k in range(np.uint64(max(0, min(UNIT, cells - unit * UNIT)))):
            squared[first + k] = result[at + k]
            greatest = max(greatest, result[at + k])
        first += np.uint64(UNIT)
    return int(greatest)


@kernel
def update_field(
    queue: Queue,  # of the rows of blocks
    threads: int,
    wanted: NDArray[np.bool_],  # (blocks, nx)
    shape: tuple[int, int, int],  # (nx, ny, nz)
    sections: NDArray[np.uint16],  # (blocks * units * (around + nx + around) * UNIT,)
    nearest: NDArray[np.uint16],  # (blocks, units, around + nx + around)
    reach: int,
    block_rows: int,
    farthest: NDArray[np.uint16],  # (blocks, nx) out: greatest value of each block of the field
    stale: NDArray[np.bool_],  # (blocks, nx) in, out
    squared: NDArray[np.uint16],  # (nx * ny * nz,) out
    result: NDArray[np.uint16],  # (units * 4 * UNIT,) scratch
    bounds: NDArray[np.uint16],  # (units * UNIT,) scratch
    limits: NDArray[np.uint16],  # (4,) scratch
) -> None:
    """The squared distance in wanted blocks that are stale, from the sections around.

    What lies outside the window is blocked: the nearest such cell is straight across a border.
    Four planes at once, of which only those that are wanted and stale are written.
    """
    (blocks, nx), (_, ny, nz) = wanted.shape, shape
    begin, end = take_part(queue, blocks, threads)
    while begin < end:
        for b in range(begin, end):
            first, cells = b * block_rows, min(block_rows, ny - b * block_rows) * nz
            listed = False
            for x in range(nx):
                if not (stale[b, x] and wanted[b, x]):
                    continue
                if not listed:
                    listed = True
                    list_bounds((first, first + block_rows), shape, reach, bounds)
                for i in range(x, x + 4):
                    now = i < nx and stale[b, i] and wanted[b, i]
                    limits[i - x] = border_distance(i, nx, reach) ** 2 if now else 0
                    if now:
                        ask_for(squared, (i * ny + first) * nz, cells)
                update_planes(
                    b, x, reach, min(reach, nx), sections, nearest, bounds, limits, result
                )
                for i in range(x, min(x + 4, nx)):
                    if limits[i - x] != 0:
                        to = (i * ny + first) * nz
                        farthest[b, i] = write_block(result, i - x, squared, to, cells)
                        stale[b, i] = False
        begin, end = take_part(queue, blocks, threads)
