"""Kernels of the search over a coarse lattice: exact integer costs-to-go, spread from the goal.

A lattice cell is a block of grid cells, entered at the centre of its middle one. A step leads
straight from one centre to a neighbour's; it always touches the same grid cells relative to where
it begins, and is free if all of them are. So gaps much narrower than a block are found. Costs
are integers, so the cost-to-go of a cell has one value, whatever the order of the search.

Best-first search after Hart, Nilsson, Raphael, "A Formal Basis for the Heuristic Determination of
Minimum Cost Paths", IEEE TSSC 1968, with the bucket queue of Dial, "Algorithm 360: Shortest-path
forest with topological ordering", CACM 1969.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners._jit import kernel

UNSEEN = 0
"""Rate of a lattice cell whose grid cells have not been looked at; 0, so that memory is lazy."""

BLOCKED = -1

FREE_RATE = 8
"""Rate of a cell where nothing is near: costs are told to one part in eight of length."""

LARGEST_RATE = 64 * FREE_RATE
"""Nearness beyond this costs no more: it bounds the queue."""

STEPS = (12, 17, 21)
"""Length of a step along one, two and three axes: 1, 2^0.5 and 3^0.5 to 1 %, in integers."""

LARGEST_FACTOR = 4
"""Grid cells to a lattice cell: the 64 cells of a block have a bit each."""

NEW, OPEN, CLOSED, FORGOTTEN = 0, 1, 2, 3
UNKNOWN_KEY = 2**62
UNKNOWN_COST = 2**30
KEY, OPENED, EXPANDED = 0, 1, 2  # places in Lattice.now

Place = tuple[int, int, int]  # of a lattice cell along the axes, border included
Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]
Longs = NDArray[np.int64]


class Lattice(NamedTuple):
    """A lattice over a distance field and the state of one search on it.

    The arrays by cell are flat and have a border of one blocked cell all around.
    """

    field: NDArray[np.uint16]  # (nx, ny, nz) squared cell distances
    cells: NDArray[np.uint16]  # (nx * ny * nz,) the same, flat
    threshold: int  # a grid cell is forbidden at or below it
    factor: Longs  # (3,) grid cells to a lattice cell
    shape: Longs  # (3,) lattice cells, border included
    rate_by_distance: Integers  # (t,) cost per length by squared distance
    ways: Longs  # (m, 3) steps to the neighbours
    offsets: Longs  # (m,) flat offsets to them
    steps: Integers  # (m,) lengths of the steps to them
    touched: Longs  # (m, k) flat offsets of the grid cells that each step touches
    counts: Longs  # (m,) how many they are
    blocks: Longs  # (m, 8) flat offsets of the lattice cells that each step touches
    bits: Longs  # (m, 8) the bits of their masks that it needs; neither if no masks are kept
    rate: Integers  # (n,) cost per length, UNSEEN or BLOCKED
    mask: Longs  # (n,) which of a block's grid cells are free, bit by bit; (0,) if not kept
    state: Bytes  # (n,)
    cost: Integers  # (n,) cost-to-go of an open or closed cell
    via: Bytes  # (n,) way from the neighbour towards the goal that this cost is due to
    key: Integers  # (n,) by which an open cell is queued: its cost and an estimate of the rest
    head: Integers  # (b,) first cell of each bucket, -1 if none; b is a power of two
    after: Integers  # (n,) next cell in the same bucket
    before: Integers  # (n,) previous cell in the same bucket
    least: Integers  # (columns,) what any way from a column to the target costs at least
    now: Longs  # (3,) key in progress, open cells, expansions


@kernel
def place_of(shape: Longs, cell: int) -> Place:
    """Where a lattice cell lies along the axes."""
    column = cell // shape[2]
    return column // shape[1], column % shape[1], cell - column * shape[2]


@kernel
def in_border(shape: Longs, place: Place) -> bool:
    """Whether a lattice cell lies in the border."""
    i, j, k = place
    outer = i == 0 or j == 0 or k == 0
    return bool(outer or i == shape[0] - 1 or j == shape[1] - 1 or k == shape[2] - 1)


@kernel
def middle_of(factor: Longs, place: Place) -> tuple[int, int, int]:
    """The grid cell in the middle of a lattice cell that does not lie in the border."""
    i, j, k = place
    x, y, z = (i - 1) * factor[0], (j - 1) * factor[1], (k - 1) * factor[2]
    return x + (factor[0] >> 1), y + (factor[1] >> 1), z + (factor[2] >> 1)


@kernel
def grid_index(field: NDArray[np.uint16], factor: Longs, place: Place) -> int:
    """Flat index of the grid cell in the middle of a lattice cell."""
    x, y, z = middle_of(factor, place)
    return int((x * field.shape[1] + y) * field.shape[2] + z)


@kernel
def middle_rate(
    field: NDArray[np.uint16],
    threshold: int,
    factor: Longs,
    shape: Longs,
    rate_by_distance: Integers,
    place: Place,
) -> int:
    """Rate of a lattice cell by its middle grid cell."""
    if in_border(shape, place):
        return BLOCKED
    x, y, z = middle_of(factor, place)
    value = int(field[np.uint64(x), np.uint64(y), np.uint64(z)])
    if value <= threshold:
        return BLOCKED
    return int(rate_by_distance[np.uint64(min(value, len(rate_by_distance) - 1))])


@kernel
def block_mask(
    field: NDArray[np.uint16], threshold: int, factor: Longs, shape: Longs, place: Place
) -> int:
    """Which grid cells of a lattice cell are free, bit by bit; a block has at most 64."""
    mask = 0
    if in_border(shape, place):
        return mask
    x, y, z = (place[0] - 1) * factor[0], (place[1] - 1) * factor[1], (place[2] - 1) * factor[2]
    for u in range(x, x + factor[0]):
        for v in range(y, y + factor[1]):
            # As unsigned indices none is taken for one from behind.
            row = field[np.uint64(u), np.uint64(v)]
            if factor[2] == LARGEST_FACTOR:  # written out: most of a change is looked at here
                a, b = row[np.uint64(z)], row[np.uint64(z + 1)]
                c, d = row[np.uint64(z + 2)], row[np.uint64(z + 3)]
                ends = int(a > threshold) << 3 | int(d > threshold)
                mask = mask << 4 | ends | int(b > threshold) << 2 | int(c > threshold) << 1
                continue
            for w in range(z, z + factor[2]):
                mask = (mask << 1) | int(row[np.uint64(w)] > threshold)
    return mask


@kernel
def look(lattice: Lattice, cell: int) -> int:
    """Rate of a lattice cell, which is looked up once."""
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    if lattice.rate[cell] == UNSEEN:
        place = place_of(lattice.shape, cell)
        lattice.rate[cell] = middle_rate(
            field, threshold, factor, lattice.shape, lattice.rate_by_distance, place
        )
        if len(lattice.mask) > 0:
            lattice.mask[cell] = block_mask(field, threshold, factor, lattice.shape, place)
    rate: int = lattice.rate[cell]
    return rate


@kernel
def note_looked_at(
    rate: Integers, shape: Longs, factor: Longs, block_bits: int, looked_at: NDArray[np.bool_]
) -> None:
    """Note the blocks of the field that hold what was looked at.

    A step touches grid cells of lattice cells alone that were looked at: its ends, and those beside
    it, which are neighbours along fewer axes.

    Args:
        rate: Of the lattice cells, UNSEEN where none looked.
        shape: Lattice cells along the axes, border included.
        factor: Grid cells to a lattice cell.
        block_bits: Two to the power of this are the rows of a block.
        looked_at: Shape (blocks, nx), true where any row of the block was looked at.
    """
    nx, last = looked_at.shape[1], looked_at.shape[0] - 1
    for i in range(1, shape[0] - 1):
        for j in range(1, shape[1] - 1):
            column, seen = (i * shape[1] + j) * shape[2], False
            for k in range(shape[2]):
                seen |= rate[column + k] != UNSEEN
            if not seen:
                continue
            x, y = (i - 1) * factor[0], (j - 1) * factor[1]
            end = min((y + factor[1] - 1) >> block_bits, last)
            for b in range(y >> block_bits, end + 1):
                for plane in range(x, min(x + factor[0], nx)):
                    looked_at[b, plane] = True


@kernel
def step_free(
    cells: NDArray[np.uint16], threshold: int, index: int, touched: Longs, counts: Longs, way: int
) -> bool:
    """Whether all grid cells that a step from a grid cell touches are free.

    Tables are handed over whole: of a row the references would be counted.
    """
    for n in range(np.uint64(counts[way])):
        if cells[np.uint64(index + touched[way, n])] <= threshold:
            return False
    return True


@kernel
def step_free_by_mask(mask: Longs, cell: int, blocks: Longs, bits: Longs, way: int) -> bool:
    """The same, told by the masks of the lattice cells, which are fewer to read."""
    for n in range(np.uint64(blocks.shape[1])):
        if mask[np.uint64(cell + blocks[way, n])] & bits[way, n] != bits[way, n]:
            return False
    return True


@kernel
def estimate(lattice: Lattice, cell: int, target: int) -> int:
    """Least cost between two cells as far as it is known: never more than it costs."""
    if target < 0:
        return 0
    shape = lattice.shape
    return rest_between(shape, lattice.least, place_of(shape, cell), place_of(shape, target))


@kernel
def rest_between(shape: Longs, least: Integers, a: Place, b: Place) -> int:
    """Least cost between two places if all were free, or from the column of the first at least."""
    rest = least_cost(a[0] - b[0], a[1] - b[1], a[2] - b[2])
    return max(rest, int(least[np.uint64(a[0] * shape[1] + a[1])]))


@kernel
def least_cost(x: int, y: int, z: int) -> int:
    """Of so many cells along the axes, if all are free."""
    x, y, z = abs(x), abs(y), abs(z)
    most, least = max(x, y, z), min(x, y, z)
    middle = x + y + z - most - least
    length = STEPS[2] * least + STEPS[1] * (middle - least) + STEPS[0] * (most - middle)
    cost: int = 2 * FREE_RATE * length
    return cost


@kernel
def put(lattice: Lattice, cell: int, cost: int, key: int) -> None:
    """Open a cell: into the bucket of its key, last in, first out."""
    insert(lattice.head, lattice.after, lattice.before, lattice.key, cell, key)
    lattice.state[cell] = OPEN
    lattice.cost[cell] = cost
    lattice.now[OPENED] += 1


@kernel
def bucket_of(head: Integers, key: int) -> np.uint64:
    """The bucket of a key; others whose keys differ by rounds of the queue may be in it, too."""
    return np.uint64(key) & np.uint64(len(head) - 1)


@kernel
def insert(
    head: Integers, after: Integers, before: Integers, keys: Integers, cell: int, key: int
) -> None:
    """Put a cell first into the bucket of its key."""
    at, bucket = np.uint64(cell), bucket_of(head, key)
    first = head[bucket]
    keys[at] = key
    after[at] = first
    before[at] = -1
    if first >= 0:
        before[np.uint64(first)] = cell
    head[bucket] = cell


@kernel
def remove(head: Integers, after: Integers, before: Integers, keys: Integers, cell: int) -> None:
    """Take a cell out of its bucket."""
    at = np.uint64(cell)
    if before[at] >= 0:
        after[np.uint64(before[at])] = after[at]
    else:
        head[bucket_of(head, keys[at])] = after[at]
    if after[at] >= 0:
        before[np.uint64(after[at])] = before[at]


@kernel
def spread(lattice: Lattice, until: int, target: int, budget: int, beyond: int) -> bool:
    """Close cells in the order of their keys until a given one is closed, and all `beyond` says.

    Args:
        lattice: With the cells open that the search goes on from.
        until: The cell to close.
        target: The cell that the search is drawn to, or -1: then all cells nearer to the goal are
            closed before it.
        budget: Most cells to close.
        beyond: All cells whose keys are less than its cost and this are closed, too. From 1 on
            these are all cells of all its cheapest ways.

    Returns:
        Whether that is done; if not, the budget is spent or no cell is open.
    """
    # Arrays are taken out of the tuple here: taken out in the loop they are counted each time.
    field, threshold, cells = lattice.field, lattice.threshold, lattice.cells
    factor, shape = lattice.factor, lattice.shape
    rate_by_distance, offsets, steps = lattice.rate_by_distance, lattice.offsets, lattice.steps
    ways, touched, counts, rate = lattice.ways, lattice.touched, lattice.counts, lattice.rate
    blocks, bits = lattice.blocks, lattice.bits
    mask, state, cost, via = lattice.mask, lattice.state, lattice.cost, lattice.via
    head, after, before, keys = lattice.head, lattice.after, lattice.before, lattice.key
    key, opened, closed = lattice.now[KEY], lattice.now[OPENED], 0
    least, aim = lattice.least, place_of(shape, max(target, 0))
    while opened > 0 and closed < budget:
        if state[until] == CLOSED and key >= cost[until] + beyond:
            break
        cell = int(head[bucket_of(head, key)])
        while cell >= 0 and keys[np.uint64(cell)] != key:
            cell = int(after[np.uint64(cell)])  # of a later round of the queue
        if cell < 0:
            key += 1
            continue
        remove(head, after, before, keys, cell)
        here = np.uint64(cell)
        state[here] = CLOSED
        opened -= 1
        closed += 1
        i, j, k = place_of(shape, cell)
        index = grid_index(field, factor, (i, j, k))
        for way in range(np.uint64(len(offsets))):
            other = cell + offsets[way]
            at = np.uint64(other)
            place = (i + ways[way, 0], j + ways[way, 1], k + ways[way, 2])
            if rate[at] == UNSEEN:
                rate[at] = middle_rate(field, threshold, factor, shape, rate_by_distance, place)
                if len(mask) > 0:
                    mask[at] = block_mask(field, threshold, factor, shape, place)
            if rate[at] < 0:
                continue
            through = cost[here] + steps[way] * (rate[here] + rate[at])
            # After a repair a closed cell can be too dear; otherwise none is ever opened again.
            if state[at] != NEW and through >= cost[at]:
                continue
            if len(mask) > 0:  # the sides are neighbours along fewer axes: looked at before
                if not step_free_by_mask(mask, cell, blocks, bits, way):
                    continue
            elif not step_free(cells, threshold, index, touched, counts, way):
                continue
            if state[at] == OPEN:
                remove(head, after, before, keys, other)
                opened -= 1
            rest = rest_between(shape, least, place, aim) if target >= 0 else 0
            insert(head, after, before, keys, other, through + rest)
            opened += 1
            state[at] = OPEN
            cost[at] = through
            via[at] = way
    lattice.now[KEY], lattice.now[OPENED] = key, opened
    lattice.now[EXPANDED] += closed
    return bool(state[until] == CLOSED and (opened == 0 or key >= cost[until] + beyond))


@kernel
def best_rate(
    field: NDArray[np.uint16],
    threshold: int,
    factor: Longs,
    shape: Longs,
    rate_by_distance: Integers,
    i: int,
    j: int,
) -> int:
    """Least rate of a column's lattice cells, BLOCKED if none is free."""
    least, last = LARGEST_RATE + 1, len(rate_by_distance) - 1
    if in_border(shape, (i, j, 1)):
        return BLOCKED
    x, y, z = middle_of(factor, (i, j, 1))
    row = field[np.uint64(x), np.uint64(y)]
    for at in range(np.uint64(z), np.uint64(len(row)), np.uint64(factor[2])):
        value = int(row[at])
        if value > threshold:
            least = min(least, int(rate_by_distance[np.uint64(min(value, last))]))
    return least if least <= LARGEST_RATE else BLOCKED


@kernel
def bound_columns(lattice: Lattice, goal: int, target: int) -> bool:
    """Find what it costs at least to get from each column of the lattice to a target cell.

    Where each column is as cheap as its cheapest cell, and up and down cost nothing, a way in the
    plane costs no more than any way above it (an abstraction of the search, after Holte et al.,
    "Hierarchical A*", AAAI 1996). It is searched from the target's column until the goal's is
    closed: closed columns are told their cost, others the least that it still can be. So the bound
    falls by no more than it costs from step to step, as A* asks for.

    Args:
        lattice: In space, without masks; `least` is written.
        goal: Cell from which the lattice is searched.
        target: Cell to which.

    Returns:
        Whether there is a way in the plane; where there is none, there is none in space.
    """
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    shape, table, looked_at = lattice.shape, lattice.rate_by_distance, lattice.rate
    head = np.full_like(lattice.head, -1)
    columns, begin, end = shape[0] * shape[1], target // shape[2], goal // shape[2]
    x, y = end // shape[1], end % shape[1]
    rate, cost = np.zeros(columns, np.int32), np.full(columns, UNKNOWN_COST, np.int32)
    closed = np.zeros(columns, np.bool_)
    keys, after, before = np.empty_like(cost), np.empty_like(cost), np.empty_like(cost)
    i, j = begin // shape[1], begin % shape[1]
    rate[begin], cost[begin] = best_rate(field, threshold, factor, shape, table, i, j), 0
    looked_at[begin * shape[2]] = BLOCKED  # in the border: now the whole column was
    key, opened = least_cost(i - x, j - y, 0), 1
    insert(head, after, before, keys, begin, key)
    while opened > 0 and not closed[end]:
        column = int(head[bucket_of(head, key)])
        if column < 0:
            key += 1
            continue
        remove(head, after, before, keys, column)
        closed[column] = True
        opened -= 1
        i, j = column // shape[1], column % shape[1]
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                other = a * shape[1] + b
                if closed[other]:
                    continue
                if rate[other] == UNSEEN:
                    rate[other] = best_rate(field, threshold, factor, shape, table, a, b)
                    looked_at[other * shape[2]] = BLOCKED
                if rate[other] < 0:
                    continue
                step = STEPS[0] if a == i or b == j else STEPS[1]
                through = cost[column] + step * (rate[column] + rate[other])
                if through >= cost[other]:
                    continue
                if cost[other] < UNKNOWN_COST:
                    remove(head, after, before, keys, other)
                    opened -= 1
                cost[other] = through
                insert(head, after, before, keys, other, through + least_cost(a - x, b - y, 0))
                opened += 1
    for column in range(columns):
        open_yet = key - least_cost(column // shape[1] - x, column % shape[1] - y, 0)
        lattice.least[column] = cost[column] if closed[column] else max(open_yet, 0)
    return bool(closed[end])


@kernel
def descend(lattice: Lattice, start: int) -> Integers:
    """The cells from a closed one down the costs-to-go, the goal's last; the first way of equals.

    Only closed cells are followed, whose costs are exact: the cheapest path on the lattice.
    """
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    offsets, steps, touched = lattice.offsets, lattice.steps, lattice.touched
    rate, state, cost = lattice.rate, lattice.state, lattice.cost
    cells = np.empty(len(rate), np.int32)
    count, cell = 1, start
    cells[0] = start
    while cost[cell] > 0:
        index = grid_index(field, factor, place_of(lattice.shape, cell))
        for way in range(len(offsets)):
            other = cell + offsets[way]
            if state[other] != CLOSED:
                continue
            if cost[other] + steps[way] * (rate[cell] + rate[other]) != cost[cell]:
                continue
            if step_free(lattice.cells, threshold, index, touched, lattice.counts, way):
                cell = other
                break
        cells[count] = cell
        count += 1
    return cells[:count].copy()


@kernel
def bounds_to_go(lattice: Lattice, target: int, limit: int) -> Integers:
    """About what it costs at least from each cell of a plane to the goal, shape (nodes,).

    Cells of which a way from the target over them to the goal costs at most the limit are told
    their cost-to-go, others what it has to be to cost more than that. So it is the same whatever
    else is closed. Without the border, and halved: a step costs its length times the mean rate.

    Args:
        lattice: Of a plane, with all cells closed whose keys are up to the limit.
        target: Cell that its search is drawn to.
        limit: Cost.
    """
    shape, state, cost = lattice.shape, lattice.state, lattice.cost
    rows, columns = shape[0] - 2, shape[1] - 2
    x, y = target // (shape[1] * shape[2]) - 1, target // shape[2] % shape[1] - 1
    bounds = np.empty(rows * columns, np.int32)
    for i in range(rows):
        for j in range(columns):
            cell = ((i + 1) * shape[1] + j + 1) * shape[2] + 1
            most = limit - least_cost(i - x, j - y, 0)
            known = state[cell] == CLOSED and cost[cell] <= most
            bounds[i * columns + j] = (cost[cell] if known else max(most, 0)) >> 1
    return bounds


@kernel
def look_again(lattice: Lattice, low: Longs, high: Longs) -> Integers:
    """Look again at the lattice cells of a box that were looked at before; tell which changed."""
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    shape, rates, rate_by_distance = lattice.shape, lattice.rate, lattice.rate_by_distance
    masks = lattice.mask
    changed = np.empty(len(rates), np.int32)
    count = 0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                cell = (i * shape[1] + j) * shape[2] + k
                if rates[cell] == UNSEEN:
                    continue
                place = i, j, k
                rate = middle_rate(field, threshold, factor, shape, rate_by_distance, place)
                mask = block_mask(field, threshold, factor, shape, place)
                if rate != rates[cell] or mask != masks[cell]:
                    rates[cell], masks[cell] = rate, mask
                    changed[count] = cell
                    count += 1
    return changed[:count].copy()


@kernel
def draw_to(lattice: Lattice, target: int, cells: Longs) -> None:
    """Queue all open cells anew, for a search that is drawn to another cell; -1 for none."""
    cost = lattice.cost
    head, after, before, keys = lattice.head, lattice.after, lattice.before, lattice.key
    head[:] = -1
    first = UNKNOWN_KEY
    for cell in cells:
        key = cost[cell] + estimate(lattice, cell, target)
        insert(head, after, before, keys, cell, key)
        first = min(first, key)
    lattice.now[KEY], lattice.now[OPENED] = first, len(cells)


@kernel
def repair(lattice: Lattice, changed: Integers) -> None:
    """Forget the costs-to-go that a change can have altered, and reopen the cells around them.

    A change alters steps to, from and past its cell only, so the costs of its neighbours are
    forgotten, and of all cells whose way leads over one that is. Those that are left are the costs
    of ways that still exist; ``spread`` finds the cheaper ones. The goal's cost is never forgotten.
    The queue is to be made anew by ``draw_to``.

    Args:
        lattice: Its search.
        changed: Cells whose rate is another now.
    """
    offsets, state, cost, via = lattice.offsets, lattice.state, lattice.cost, lattice.via
    forgotten = np.empty(len(state), np.int32)
    count, done = 0, 0
    for cell in changed:
        for way in range(-1, len(offsets)):
            near = cell if way < 0 else cell + offsets[way]
            if state[near] == FORGOTTEN or (state[near] != NEW and cost[near] == 0):
                continue
            state[near] = FORGOTTEN
            forgotten[count] = near
            count += 1
    while done < count:
        cell = forgotten[done]
        done += 1
        for way in range(len(offsets)):
            near = cell + offsets[way]
            if near < 0 or near >= len(state):
                continue  # of a cell in the border
            if (state[near] != OPEN and state[near] != CLOSED) or via[near] != way:
                continue
            if cost[near] == 0:
                continue
            state[near] = FORGOTTEN
            forgotten[count] = near
            count += 1
    for cell in forgotten[:count]:
        for offset in offsets:
            near = cell + offset
            if 0 <= near < len(state) and state[near] == CLOSED:
                state[near] = OPEN
        state[cell] = NEW
