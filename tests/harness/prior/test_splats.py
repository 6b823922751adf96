"""Votes of Gaussians: known answers, any order, files, and what does not vote."""

import math

import numpy as np
import pytest

from tests.tools.world_splat import write_splat
from wayproof.harness.config import Config
from wayproof.harness.prior.grid import UNTURNED, Placement
from wayproof.harness.prior.of_world import grid_of_world, splat_of_world
from wayproof.harness.prior.splats import (
    OCCUPIED_VOTES,
    Gaussians,
    poll,
    read_splat,
    states_by,
    votes_of_shares,
)
from wayproof.harness.scenario.worlds import find_world
from wayproof.maps import OCCUPIED
from wayproof.maps.columns import Window
from wayproof.models.world_files import WorldFileError

WINDOW = Window(0.1, (-10, -10, -10), (20, 20, 20))


def gaussians(n=200, seed=0):
    rng = np.random.default_rng(seed)
    return Gaussians(
        rng.uniform(-1.1, 1.1, (n, 3)),
        rng.uniform(0.01, 0.15, (n, 3)),
        rng.standard_normal((n, 4)),
        rng.uniform(0.05, 0.99, n),
    )


def chosen(splat, rows):
    return Gaussians(*(part[rows] for part in splat))


def naive(splat, window):
    """Sum of -ln(1 - p) by cell, in floats, with matrices."""
    sums = np.zeros(window.shape)
    centres = window.origin + (np.moveaxis(np.indices(window.shape), 0, -1) + 0.5) * 0.1
    for mean, scales, (w, x, y, z), opacity in zip(*splat, strict=True):
        w, x, y, z = np.array([w, x, y, z]) / math.sqrt(w * w + x * x + y * y + z * z)
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        S = R @ np.diag(scales**2) @ R.T + np.eye(3) * 0.01 / 12.0
        away = centres - mean
        squared = np.einsum("...i,ij,...j->...", away, np.linalg.inv(S), away)
        p = np.where(squared < 9.0, opacity * np.exp(-0.5 * squared), 0.0)
        sums -= np.log1p(-np.minimum(p, 0.996))
    return sums


def test_votes_are_those_of_the_formula_up_to_their_steps():
    splat = gaussians(40)
    votes = poll(splat, WINDOW, UNTURNED)
    sums = naive(splat, WINDOW) * 64.0
    assert (np.abs(votes - sums) <= 0.1 * sums + 3.0).all()  # near p = 1 a step of p is several
    assert np.corrcoef(votes.ravel(), sums.ravel())[0, 1] > 0.999
    assert votes_of_shares()[128] == OCCUPIED_VOTES


def test_any_order_and_any_split_gives_the_same_bytes():
    splat = gaussians(3000)
    votes = poll(splat, WINDOW, UNTURNED)
    order = np.random.default_rng(1).permutation(3000)
    assert poll(chosen(splat, order), WINDOW, UNTURNED).tobytes() == votes.tobytes()
    halves = [poll(chosen(splat, part), WINDOW, UNTURNED) for part in np.split(order, 3)]
    assert (halves[0] + halves[1] + halves[2]).tobytes() == votes.tobytes()


def test_what_is_broken_transparent_large_or_far_does_not_vote():
    splat = gaussians(6)
    splat.opacities[0] = 0.001
    splat.deviations[1, 2] = 1.5
    splat.means[2] = (50.0, 0.0, 0.0)
    splat.means[3, 1] = math.nan
    votes = poll(splat, WINDOW, UNTURNED)
    assert (poll(chosen(splat, [4, 5]), WINDOW, UNTURNED) == votes).all()


def test_a_splat_is_scaled_turned_up_and_placed():
    at = Gaussians(np.array([[1.0, -3.0, 2.0]]), np.full((1, 3), 0.02), np.eye(4)[:1], np.ones(1))
    placed = Placement(0.5, 0.0, 0.0, 0.5 * math.pi)
    votes = poll(at, WINDOW, placed, scale=0.1, up="-y")
    # In metres (0.1, -0.3, 0.2); with -y up (0.1, 0.2, 0.3); turned (-0.2, 0.1, 0.3); moved by x.
    heaviest = np.array(np.unravel_index(votes.argmax(), votes.shape))
    centre = WINDOW.origin + (heaviest + 0.5) * 0.1
    assert np.abs(centre - (0.3, 0.1, 0.3)).max() <= 0.05 + 1e-9


def test_a_file_gives_back_what_was_written(tmp_path):
    splat = gaussians(50)
    write_splat(tmp_path / "a.ply", splat)
    again = read_splat(tmp_path / "a.ply")
    for one, other in zip(splat, again, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda data: b"plx" + data[3:], "no 'ply'"),
        (lambda data: data.replace(b"opacity", b"opatite"), "no property opacity"),
        (lambda data: data.replace(b"binary_little_endian", b"ascii"), "binary_little_endian"),
        (lambda data: data[:-8], "ends after"),
        (lambda data: data.replace(b"vertex 50", b"vertex 99999999"), "99999999 Gaussians"),
        (lambda data: data.replace(b"float f_dc_0", b"thing f_dc_0"), "unknown type"),
    ],
)
def test_a_damaged_file_is_refused_in_a_line(tmp_path, change, text):
    path = tmp_path / "a.ply"
    write_splat(path, gaussians(50))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(WorldFileError, match=text):
        read_splat(path)


def test_the_splat_of_a_world_finds_its_surfaces_and_little_else():
    world = find_world(Config("corridor", "drone", 1))
    truth = grid_of_world(world, 0.1)
    window = Window.covering(world.low, world.high, 0.1)
    states = states_by(poll(splat_of_world(world), window, UNTURNED))
    solid = truth.states == OCCUPIED
    near = solid.copy()
    for axis in range(3):
        near |= np.roll(solid, 1, axis) | np.roll(solid, -1, axis)
    found = states == OCCUPIED
    assert found.sum() > 1000
    assert (found & ~near).sum() < 0.01 * found.sum()
    surface = solid & ~(
        np.roll(solid, 1, 0)
        & np.roll(solid, -1, 0)
        & np.roll(solid, 1, 1)
        & np.roll(solid, -1, 1)
        & np.roll(solid, 1, 2)
        & np.roll(solid, -1, 2)
    )
    surface[:, :, : 1 - window.first[2]] = False
    assert (found & surface).sum() > 0.5 * surface.sum()
