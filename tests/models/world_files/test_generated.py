"""A generated world written as a world file is the same world, movers and all."""

from __future__ import annotations

import numpy as np
import pytest

from wayproof.models.world_files.world_file import file_of, world_of
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds import WORLDS


@pytest.mark.parametrize("name", [name for name in WORLDS if name != "hall"])
def test_a_generated_world_reads_back_from_its_file(name):
    world = WORLDS[name](3, 0.5, WorldParameters())
    read = world_of(file_of(world))
    for field in ("low", "high", "start", "start_heading", "goal", "solid_names"):
        assert getattr(read, field) == getattr(world, field), field
    points = np.random.default_rng(0).uniform(world.low, world.high, (200, 3))
    for one, other in zip(read.solids, world.solids, strict=True):
        np.testing.assert_allclose(one.distance(points), other.distance(points), atol=1e-6)
    assert len(read.movers) == len(world.movers)
    for one, other in zip(read.movers, world.movers, strict=True):
        for moment in (0, 3_300_000_000, 41_000_000_000):
            np.testing.assert_allclose(one.place(moment).position, other.place(moment).position)
        for field in ("appears", "vanishes", "stands_off", "backs_up", "returns", "loops"):
            assert getattr(one, field) == getattr(other, field), field
