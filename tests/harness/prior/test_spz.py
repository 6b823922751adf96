"""Splats in `.spz`, packed here by the published format, byte by byte."""

import gzip
import math
import struct

import numpy as np
import pytest

from tests.tools.world_splat import write_splat
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.prior.of_world import splat_of_world
from wayproof.harness.prior.splats import read_splat
from wayproof.harness.prior.spz import read_spz
from wayproof.harness.scenario.worlds import find_world
from wayproof.models.world_files import WorldFileError


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
def test_a_damaged_file_is_refused(tmp_path, change, text):
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
