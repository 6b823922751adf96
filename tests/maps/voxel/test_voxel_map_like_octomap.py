"""The voxel map against OctoMap itself, by its Python binding: the same sweeps, the same states."""

import numpy as np
import pyoctomap

from wayproof.maps import FREE, OCCUPIED, UNKNOWN, MapConfig, VoxelMap, states_in
from wayproof.maps.grid import cell_box

LOW, HIGH = np.array([0.0, 0.0, 1.0]), np.array([8.0, 6.0, 4.0])
SWEEPS, BEAMS = 6, 3000


def sweeps():
    """Beams from random places in a room to its walls, in whole millimetres."""
    rng = np.random.default_rng(11)
    room_low, room_high = LOW + 0.5, HIGH - 0.5
    for _ in range(SWEEPS):
        origin = rng.uniform(room_low + 0.5, room_high - 0.5)
        directions = rng.normal(size=(BEAMS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        to_wall = np.where(directions > 0, room_high - origin, room_low - origin) / directions
        yield origin, directions, np.rint(to_wall.min(axis=1) * 1000).astype(np.uint16)


def test_states_agree_with_octomap():
    config = MapConfig(half_life=0.0, floor_grazing_filter=False)
    ours = VoxelMap(config)
    peer = pyoctomap.OcTree(config.resolution)
    peer.setProbHit(1.0 / (1.0 + np.exp(-config.log_odds_hit)))
    peer.setProbMiss(1.0 / (1.0 + np.exp(config.log_odds_miss)))
    peer.setClampingThresMin(config.prob_min)
    peer.setClampingThresMax(config.prob_max)
    for time, (origin, directions, ranges) in enumerate(sweeps()):
        ours.integrate(origin, directions, ranges, 20.0, time)
        ends = origin + directions * (ranges / 1000.0)[:, None]
        # OctoMap's cells begin at multiples of the resolution, ours along z a quarter below.
        shift = np.array([0.0, 0.0, 0.75 * config.resolution])
        peer.insertPointCloud(ends + shift, origin + shift, -1.0, False, True)
    states = states_in(ours, LOW, HIGH)
    first, _ = cell_box(LOW, HIGH, config.resolution)
    theirs = np.full(states.shape, UNKNOWN, np.uint8)
    for cell in np.ndindex(states.shape):
        node = peer.search((np.array(cell) + first + 0.5) * config.resolution)
        if node is not None:
            theirs[cell] = OCCUPIED if peer.isNodeOccupied(node) else FREE
    assert (theirs == OCCUPIED).sum() > 1000
    assert (theirs == FREE).sum() > 10000
    assert (states == theirs).mean() >= 0.9999
