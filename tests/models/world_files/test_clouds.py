"""Point clouds become the cells of their points; damaged ones are refused."""

import base64
import re

import numpy as np
import pytest

from tests.models.world_files.written import PCD_HEAD, imported, write
from wayproof.models.world_files import ImportOptions, WorldFileError
from wayproof.models.world_files.pcd import decompress_lzf, read_pcd

CLOUD = np.array([[2.05, 0.05, 0.35], [2.15, 0.05, 0.35], [2.17, 0.02, 0.31], [3.05, 0.05, 0.35]])


def cloud_file(tmp_path, kind):
    if kind == "ply":
        head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        rows = "".join(" ".join(map(str, point)) + "\n" for point in CLOUD.tolist())
        return write(tmp_path, "c.ply", head + "property float z\nend_header\n" + rows)
    if kind == "ascii":
        rows = "".join(" ".join(map(str, point)) + " 7\n" for point in CLOUD.tolist())
        return write(tmp_path, "c.pcd", PCD_HEAD + "POINTS 5\nDATA ascii\n" + rows + "nan 0 0 7\n")
    rows = np.zeros(4, [("p", "<f4", 3), ("i", "u1")])
    rows["p"] = CLOUD
    head = PCD_HEAD + "POINTS 4\nDATA binary\n"
    return write(tmp_path, "c.pcd", head.encode() + rows.tobytes())


@pytest.mark.parametrize("kind", ["ply", "ascii", "binary"])
def test_a_point_cloud_gives_the_cells_of_its_points(tmp_path, kind):
    near, far = sorted(imported(cloud_file(tmp_path, kind)).solids, key=lambda box: box.low[0])
    np.testing.assert_allclose([near.low, near.high], [(2.0, 0.0, 0.3), (2.2, 0.1, 0.4)], atol=1e-6)
    np.testing.assert_allclose([far.low, far.high], [(3.0, 0.0, 0.3), (3.1, 0.1, 0.4)], atol=1e-6)


LZF = base64.b64decode(
    "DwAAAADNzMw9zcxMPpqZmT4gCwA+IBIIP5qZGT8zMzM/IBcHP2ZmZj8AAIAgCwCMIBcAmSAPAKYgGwCzIBMAwCATAMwg"
    "EwDZIBMA5iATAPMgE+D/T+H/P+K5L+BDACMvI2vgQwMATCOz4EEDIa/gRAMg6+BEAyGLRGPgQANDp+BDA0Uz4EMDIdvg"
    "RANFy+BDAyGP4P8A4P8A4P8AIAABAAA="
)
"""A floor of 20 x 10 points, 0.1 m apart, as python-lzf 0.2.4 compresses its three columns."""

FLOOR_HEAD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 200\nDATA binary_compressed\n"


def compressed(packed=LZF, size=2400, length=None):
    sizes = np.array([len(packed) if length is None else length, size], "<u4")
    return FLOOR_HEAD.encode() + sizes.tobytes() + packed


def test_a_compressed_cloud_is_that_of_its_columns(tmp_path):
    found = read_pcd(write(tmp_path, "c.pcd", compressed()), ImportOptions(resolution=0.1))
    assert found.notes[0].startswith("200 points as ")
    columns = np.empty(2400, np.uint8)
    assert decompress_lzf(np.frombuffer(LZF, np.uint8).copy(), columns) == 2400
    x, y, z = columns.view("<f4").reshape(3, 200)
    np.testing.assert_array_equal(x, np.tile(np.arange(20) * 0.1, 10).astype(np.float32))
    np.testing.assert_array_equal(y, np.repeat(np.arange(10) * 0.1, 20).astype(np.float32))
    assert not z.any()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (compressed(LZF[:-9]), "damaged"),
        (compressed(b"\xff" * 24), "damaged"),
        (compressed(b"\x20\x00" * 30), "damaged"),  # copies from before the beginning
        (compressed(LZF, 2_400_000), "expected 2400 by the header"),
        (compressed(LZF, 2400, 4_000_000_000), "expected 2400 by the header"),
        (compressed(b"\x00" * 8), "2400 bytes of 8 are none"),
    ],
)
def test_damaged_compressed_clouds_are_refused(tmp_path, data, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "c.pcd", data))


def test_no_byte_of_damaged_lzf_is_read_or_written_out_of_bounds():
    rng = np.random.default_rng(3)
    for _ in range(300):
        data = np.frombuffer(LZF, np.uint8).copy()
        data[rng.integers(len(data), size=4)] = rng.integers(256, size=4, dtype=np.uint8)
        guarded = np.full(2500, 7, np.uint8)
        length = decompress_lzf(data, guarded[50:2450])
        assert length == decompress_lzf.py_func(data, guarded[50:2450].copy())
        assert (guarded[:50] == 7).all()
        assert (guarded[2450:] == 7).all()


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("c.pcd", PCD_HEAD + "POINTS 9\nDATA binary\n123", "POINTS 9, but 0 are there"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA ascii\n0 0 0 1 x", "a word that is no number"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA ascii\n0 0 0 1", "but 4 numbers are there"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA lzma\n", "expected ascii, binary or binary_compr"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA binary_compressed\n", "0 bytes of 0, of which 0 are"),
        ("c.pcd", PCD_HEAD.replace("F F F U", "Q F F U") + "POINTS 2\nDATA ascii\n", "Q4"),
        ("c.pcd", "VERSION 0.7\n", "no line DATA"),
        ("c.las", "LASF", "pdal translate c.las cloud.pcd"),
    ],
)
def test_broken_clouds_are_refused_by_name(tmp_path, name, text, said):
    with pytest.raises(WorldFileError, match=re.escape(said)):
        imported(write(tmp_path, name, text))
