"""Cells that a body covers."""

import numpy as np

from wayproof.harness.mission import Mission
from wayproof.harness.replay.cells import columns


def test_a_column_by_hand():
    """Ten-centimetre layers from 17.5 cm below the floor: what a walker of 0.4 m meets."""
    mission = Mission(
        "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
        (0.0, 0.0, -0.2), (1.0, 1.0, 2.0), (0.5, 0.5, 0.3), 0.0, (0.5, 0.5, 0.3),
    )  # fmt: skip
    unknown, free, occupied = 0, 1, 2
    clear = [unknown, occupied, free, free, free, free, unknown]
    cases = {
        "clear": (clear, free),
        "no floor seen": ([unknown, unknown, *clear[2:]], unknown),
        "a beam through the floor": ([free, *clear[1:]], occupied),
        "a box": ([*clear[:3], occupied, *clear[4:]], occupied),
        "under a board": ([*clear[:6], occupied], free),
        "not all seen": ([*clear[:5], unknown, unknown], unknown),
    }
    states = np.array([[column for column, _ in cases.values()]], np.uint8)
    found = columns(states, -0.175, 0.1, mission)
    assert found[0].tolist() == [expected for _, expected in cases.values()]
