"""Carving: the cells that the beams of a sweep cross, marked in a dense window."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.beam_columns import HALF_PITCH, clip, traverse
from wayproof.maps.kernels.beam_targets import OUTSIDE, SPARING, Targets, Window
from wayproof.maps.kernels.beams import HALVES, HALVES_BITS, MAX_BEAM_CELLS, SUBCELLS
from wayproof.maps.kernels.column_masks import FULL, bits_from, list_runs, mark_run
from wayproof.maps.kernels.early_stop import marked_slabs, survey, wedge_of

LANES = 8  # columns are looked at in whole vectors, also beyond the last one
MAX_RUNS = 97  # of ends in a word: 64 of one that spare their own layers, 32, and one cut in two
SCOUTS = 8  # least number of targets carved before the first survey
SURVEY_SHARE = 3  # and least part of the wedge's targets


class CarveScratch(NamedTuple):
    """Memory for `carve`.

    Attributes:
        fractions: (MAX_STEPS + 1,) where a beam enters each column, see `beam_columns`.
        columns: (MAX_STEPS + 1,) word of each column in the window.
        lower: (MAX_STEPS + 1,) height there of the lowest beam.
        upper: (MAX_STEPS + 1,) height there of the highest beam.
        marked: (SLOPES,) slabs that are marked, see `early_stop`.
        masks: (MAX_STEPS + 1,) cells to be marked of each column.
        runs: (MAX_RUNS * words, 3) lowest and highest end of a run, and least layer to be marked.
    """

    fractions: NDArray[np.int64]
    columns: NDArray[np.int64]
    lower: NDArray[np.int64]
    upper: NDArray[np.int64]
    marked: NDArray[np.int64]
    masks: NDArray[np.uint64]
    runs: NDArray[np.int64]


@kernel
def carve(
    targets: Targets,
    order: NDArray[np.int32],  # (n,) as of `order_targets`
    wedges: NDArray[np.int64],  # (k, 3) likewise
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    window: Window,
    scratch: CarveScratch,
    free: NDArray[np.uint64],  # (nx * ny * words,) out
) -> None:
    """Mark the cells that beams cross.

    Beams to a run of ends cross what lies between the lowest and the highest of them: neighbours
    end one cell apart and come closer on their way. All to one column cross the same columns. Near
    the sensor all beams of a wedge cross the same cells: once the first of them are carved, the
    others are followed only to where everything is marked.
    """
    words, bits, _ = targets
    fractions, columns, lower, upper, marked, masks, runs = scratch
    box, guarded_layer = window.box, window.guarded_layer
    _, ny, depth = window.shape
    for wedge in range(wedges.shape[0]):
        at, end, k = wedges[wedge]
        sensor = (sensors[k, 0], sensors[k, 1], sensors[k, 2])
        sensor_layer = sensor[2] >> HALVES_BITS
        directions = wedge_of(words, order[at:end], sensor)
        first_target, surveyed = at, False
        next_survey = at + max((end - at) // SURVEY_SHARE, SCOUTS)
        while at < end:
            # See again how far all is marked, each time twice as many targets are carved.
            if at >= next_survey:
                survey(directions, sensor, window, free, marked)
                surveyed, next_survey = True, at + (at - first_target)

            # Collect the runs of ends in all words of one column.
            target = order[at]
            x, y = int(words[target, 0]), int(words[target, 1])
            count, alone = int(np.int64(0)), words[target, 4] & OUTSIDE != 0
            while True:
                bottom, flags = int(words[target, 3]), words[target, 4]
                sparing = flags & SPARING != 0
                count = list_runs(bits[target], bottom, guarded_layer, sparing, runs, count)
                at += 1
                if at == end or alone:
                    break
                target = order[at]
                if words[target, 0] != x or words[target, 1] != y:
                    break
                if words[target, 4] & OUTSIDE != 0:
                    break

            lowest_end, highest_end = runs[0, 0], runs[0, 1]
            for i in range(1, count):  # words that spare layers come before those that do not
                lowest_end = min(lowest_end, runs[i, 0])
                highest_end = max(highest_end, runs[i, 1])

            # Follow the beams no farther than to the slabs around the sensor that are marked.
            to_x, to_y = sensor[0] - x * HALVES - SUBCELLS, sensor[1] - y * HALVES - SUBCELLS  # odd
            faces_x, faces_y = MAX_BEAM_CELLS + 1, MAX_BEAM_CELLS + 1
            if surveyed:
                distance = abs(to_x) if directions.along_x else abs(to_y)
                slabs = marked_slabs(lowest_end, highest_end, sensor[2], distance, marked)
                if slabs > 0 and directions.along_x:
                    faces_x = abs((sensor[0] >> HALVES_BITS) - x) - slabs
                elif slabs > 0:
                    faces_y = abs((sensor[1] >> HALVES_BITS) - y) - slabs

            # List the columns that they cross within the box, and where they enter each.
            halves = (int(HALF_PITCH / abs(to_x)), int(HALF_PITCH / abs(to_y)))
            end_cell, max_faces = (x, y, lowest_end), (faces_x, faces_y)
            first, last, to_layers = clip(end_cell, sensor, halves, box, max_faces)
            n = last + 1 - first
            if n <= 0:
                continue
            jumps = (ny * depth if to_x > 0 else -ny * depth, depth if to_y > 0 else -depth)
            padded = -(-n // LANES) * LANES
            start = (x * ny + y) * depth
            traverse(first, padded + 1, halves, start, jumps, columns, fractions)
            fractions[0] = max(fractions[0], to_layers)

            # Word by word along z, merge what the beams to each run cross, and mark it.
            lowest, highest = min(lowest_end, sensor_layer), max(highest_end, sensor_layer)
            for word in range(max(box[2], lowest) >> 6, (min(box[5], highest) >> 6) + 1):
                bottom = 64 * word
                for s in range(padded):
                    masks[s] = 0
                for i in range(count):
                    low, high = runs[i, 0] - bottom, runs[i, 1] - bottom
                    least = min(max(max(runs[i, 2], box[2]) - bottom, 0), 64)
                    keep = bits_from(least) & (bits_from(min(box[5] + 1 - bottom, 64)) ^ FULL)
                    top, above = sensor[2] - bottom * HALVES, sensor_layer - bottom
                    if keep != 0 and max(high, above) >= 0 and min(low, above) <= 63:
                        mark_run((low, high), top, keep, padded, fractions, lower, upper, masks)
                for s in range(n):
                    free[np.uint64(columns[s] + word)] |= masks[s]
