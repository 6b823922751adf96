"""Class margins: extra distance to objects of some classes, as balls around their cells."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import WORD_BITS, ColumnMap
from wayproof.maps.grid import centres
from wayproof.maps.kernels import labels as kernels
from wayproof.maps.representation import Representation
from wayproof.maps.semantic import SemanticLayer
from wayproof.maps.states import OCCUPIED

ROUNDING = 1e-6
"""Part of a squared cell by which rounding may miss a whole number."""


class ClassMargins(ColumnMap):
    """A map with margins around the objects of some classes.

    Cells within m, centre to centre, of an occupied cell that the layer labels with a class of
    margin m are blocked for a costmap. They are neither ground to stand on nor the end of a hole:
    the map itself stays as it is.

    Attributes:
        resolution: Edge of a cell, m.
    """

    def __init__(
        self, a_map: Representation, layer: SemanticLayer, margins: Mapping[int, float]
    ) -> None:
        """Lay margins around the labelled cells of a map.

        Args:
            a_map: The map.
            layer: Classes of its cells.
            margins: Extra distance by class, m.

        Raises:
            ValueError: A class is not one of the layer's, or the cells of the two differ.
        """
        if a_map.resolution != layer.resolution:
            raise ValueError(
                f"resolution: got {layer.resolution:g} m, expected the map's, {a_map.resolution:g}"
            )
        self.resolution = a_map.resolution
        self._map, self._layer = a_map, layer
        self._squared = np.full(layer.classes, -1, np.int64)  # cells^2; -1: no margin
        for name, margin in margins.items():
            if not 0 <= name < layer.classes:
                raise ValueError(f"margins: got class {name}, expected 0 to {layer.classes - 1}")
            cells = margin / self.resolution
            self._squared[name] = math.floor(cells * cells + ROUNDING)
        self._reach = math.isqrt(max(int(self._squared.max()), 0))
        self._stamps = [(0, 0)]  # of the map and of the layer, by the stamp that was returned

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states may have changed since a stamp, as `VoxelMap.changed` does."""
        of_map, of_layer = self._stamps[since]
        boxes, now = self._map.changed(of_map)
        labels, then = self._layer.changed(of_layer)
        if (now, then) != self._stamps[-1]:
            self._stamps.append((now, then))
        around = np.concatenate([boxes, labels])
        around[:, :3] -= self._reach
        around[:, 3:] += self._reach
        return around, len(self._stamps) - 1

    def columns(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the occupied and the free cells of a box: those of the map, as they are."""
        return self._map.columns(low_cell, shape)

    def keep_out(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> NDArray[np.uint64]:
        """Return which cells of a box lie within the margin of an occupied one: (nx, ny, words)."""
        balls = np.zeros(shape, np.uint64)
        cells, labels = self._layer.labelled(self._squared >= 0)
        low = np.array(low_cell) - self._reach
        size = np.array([*shape[:2], WORD_BITS * shape[2]])
        near = np.all((cells >= low) & (cells < low + size + 2 * self._reach), axis=1)
        cells, labels = cells[near], labels[near]
        there = self._map.state_at(centres(cells, self.resolution)) == OCCUPIED
        x, y, z = (int(cell) for cell in low_cell)
        kernels.grow_balls(cells[there], self._squared[labels[there]], (x, y, z), balls)
        return balls
