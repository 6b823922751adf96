"""Widest ways through grids."""

import numpy as np
import pytest

from wayproof.harness.attribution.grids import clearances, joined, widest


def test_grids_know_the_widest_way():
    walls = np.zeros((20, 11), bool)
    walls[10] = True
    walls[10, 3:8] = False  # five cells: 0.3 m from the middle one's centre to the walls' cells
    gaps = clearances(walls, 0.1)
    assert gaps[10, 5] == pytest.approx(0.3)
    assert joined(gaps > 0.29, (4, 5), (16, 5), 0)
    assert not joined(gaps > 0.31, (4, 5), (16, 5), 0)
    assert widest(gaps, (4, 5), (16, 5), 0) == pytest.approx(0.3, abs=0.01)
