"""Age and probability of a layer."""

import numpy as np

from tests.harness.viewer.seen_map import seen_map
from wayproof.harness.viewer.evidence import (
    evidence_at,
)
from wayproof.harness.viewer.layer import layer_at
from wayproof.maps import FREE, OCCUPIED, UNKNOWN


class Body:
    """What a mission says of its body."""

    def __init__(self, planar):
        self.planar, self.step_height, self.height = planar, 0.1, 1.0


def seen(planar=False):
    a_map, costmap = seen_map()
    layer = layer_at(costmap, 0.55)
    found = evidence_at(a_map, costmap, layer, Body(planar), 3_000_000_000)
    return costmap.state[:, :, layer], found


def test_unknown_cells_have_neither_age_nor_probability():
    states, found = seen()
    assert (states == UNKNOWN).any()
    for values in found:
        np.testing.assert_array_equal(np.isnan(values), states == UNKNOWN)


def test_free_is_below_a_half_and_occupied_above():
    states, found = seen()
    assert (found.probability[states == FREE] < 0.5).all()
    assert (found.probability[states == OCCUPIED] > 0.5).all()
    np.testing.assert_allclose(found.age_s[states != UNKNOWN], 3.0, atol=1e-6)


def test_on_the_ground_the_worst_of_a_column_counts():
    _, high = seen(planar=True)
    _, flat = seen()
    known = ~np.isnan(flat.probability)
    assert (high.probability[known] >= flat.probability[known]).all()
