"""Votes of Gaussians: known answers, any order, files of two kinds, and what does not vote."""

import gzip
import math
import struct

import numpy as np
import pytest

from tests.tools.world_splat import write_splat
from wayproof.harness.cli.main import main
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
from wayproof.harness.prior.spz import read_spz
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


def packed(splat, version, fraction=12):
    """The bytes of Gaussians before compression; a loop for each, with Python's integers."""
    parts = [b"", b"", b"", b"", b""]
    for mean, deviations, quaternion, opacity in zip(*splat, strict=True):
        for x in mean:
            parts[0] += (round(float(x) * 2**fraction) & 0xFFFFFF).to_bytes(3, "little")
        parts[1] += bytes([round(float(opacity) * 255.0)])
        parts[2] += b"\x80\x80\x80"
        parts[3] += bytes(round((math.log(s) + 10.0) * 16.0) for s in deviations)
        w, x, y, z = (float(q) for q in quaternion / np.linalg.norm(quaternion))
        parts[4] += (first_three if version == 2 else smallest_three)([x, y, z, w])
    head = struct.pack("<IIIBBBB", 0x5053474E, version, len(splat.means), 0, fraction, 0, 0)
    return head + b"".join(parts)


def first_three(xyzw):
    sign = -1.0 if xyzw[3] < 0.0 else 1.0
    return bytes(round((sign * q + 1.0) * 127.5) for q in xyzw[:3])


def smallest_three(xyzw):
    greatest = max(range(4), key=lambda k: abs(xyzw[k]))
    sign = -1.0 if xyzw[greatest] < 0.0 else 1.0
    bits = greatest
    for k in range(4):
        if k != greatest:
            value = sign * xyzw[k]
            bits = bits << 10 | (value < 0.0) << 9 | round(abs(value) * math.sqrt(2.0) * 511)
    return bits.to_bytes(4, "little")


def some(n=200):
    splat = splat_of_world(find_world(Config("office", "drone", 1)))
    rows = np.random.default_rng(0).permutation(len(splat.means))[:n]
    chosen = type(splat)(*(part[rows] for part in splat))
    turns = np.random.default_rng(1).standard_normal((n, 4))
    return chosen._replace(quaternions=turns)


@pytest.mark.parametrize("version", [2, 3])
def test_gaussians_come_back_as_far_as_the_format_holds_them(tmp_path, version):
    splat, path = some(), tmp_path / "a.spz"
    path.write_bytes(gzip.compress(packed(splat, version)))
    found = read_spz(path)
    assert np.abs(found.means - splat.means).max() <= 2.0**-13
    assert np.abs(np.log(found.deviations / splat.deviations)).max() <= 0.5 / 16 + 1e-9
    assert np.abs(found.opacities - splat.opacities).max() <= 0.5 / 255 + 1e-9
    unit = splat.quaternions / np.linalg.norm(splat.quaternions, axis=1)[:, None]
    same = np.abs((found.quaternions * unit).sum(axis=1))
    assert same.min() > (0.99999 if version == 3 else 0.99)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda data: gzip.compress(b"PK" + data), "no 'NGSP' at its beginning"),
        (lambda data: gzip.compress(data[:4] + b"\x09\0\0\0" + data[8:]), "version 9 of .spz"),
        (lambda data: gzip.compress(data[:8] + b"\xff\xff\xff\x7f" + data[12:]), "2147483647 Gau"),
        (lambda data: gzip.compress(data[:-1]), "ends after"),
        (lambda data: gzip.compress(data)[:-40], "no gzip"),
        (lambda data: data, "no gzip, as .spz is of versions 2 and 3"),
    ],
)
def test_a_damaged_spz_is_refused(tmp_path, change, text):
    path = tmp_path / "a.spz"
    path.write_bytes(change(packed(some(5), 3)))
    with pytest.raises(WorldFileError, match=text):
        read_spz(path)


def test_a_run_takes_it_as_it_takes_a_ply(tmp_path, capsys):
    splat = some(50)
    (tmp_path / "a.spz").write_bytes(gzip.compress(packed(splat, 3)))
    write_splat(tmp_path / "a.ply", splat)
    assert np.allclose(read_splat(tmp_path / "a.ply").means, read_spz(tmp_path / "a.spz").means,
                       atol=1e-3)  # fmt: skip
    command = ["run", "office", "--robot", "drone", "--seed", "1", "--set"]
    command += ["episode.time_limit=1", "--prior", str(tmp_path / "a.spz")]
    assert main([*command, "--log", str(tmp_path / "a.mcap")]) == 1
    assert "timeout" in capsys.readouterr().out
    (tmp_path / "b.spz").write_bytes(b"NGSP")
    assert main([*command[:-1], str(tmp_path / "b.spz"), "--log", str(tmp_path / "b.mcap")]) == 2
