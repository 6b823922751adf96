import contextlib
import io
import json

import numpy as np
import pytest
from rich.console import Console

from wayproof.harness.bench.micro import rays
from wayproof.harness.bench.micro.rays import SAMPLE, SCENES, disagreement, within
from wayproof.harness.bench.table import print_rows
from wayproof.harness.cli.main import main

FIELDS = [
    "scene",
    "geoms",
    "engine",
    "threads",
    "rays",
    "mray_per_s",
    "ratio_vs_multiray",
    "max_error_m",
    "id_mismatches",
]


OURS = [("tile", 1), ("tile", 2), ("tree", 1), ("mj_multiRay", 1), ("mj_ray", 1)]


PEERS = {"open3d", "embree"}  # where they are installed


@pytest.fixture(scope="module")
def printed():
    """What the command prints, once for all tests: it casts at every scene.

    MuJoCo takes half of the time for the height fields, unless they have fewer points.
    """
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(rays, "FIELD_POINTS", 100)
        assert main(["bench", "rays", "--repeats", "1", "--json"]) == 0
    assert err.getvalue() == ""
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def rows(printed):
    return [row for row in printed["rows"] if row["engine"] not in PEERS]


def test_the_command_prints_flat_rows(printed):
    assert list(printed) == ["rows"]
    assert all(list(row) == FIELDS for row in printed["rows"])


def test_every_engine_is_on_every_scene(rows):
    got = [(row["scene"], row["geoms"], row["engine"], row["threads"]) for row in rows]
    assert got == [(s.name, s.geoms, *engine) for s in SCENES for engine in OURS]
    assert {row["rays"] for row in rows} == {100_000, 320 * 240, SAMPLE}


def test_engines_agree(rows):
    for row in rows:
        assert 0.0 <= row["max_error_m"] <= 1e-9, row
        assert row["id_mismatches"] == 0, row


def test_ratios_are_those_of_the_rates(rows):
    for i in range(0, len(rows), len(OURS)):
        multi = rows[i + 3]["mray_per_s"]
        for row in rows[i : i + len(OURS)]:
            assert row["mray_per_s"] > 0.0
            assert row["ratio_vs_multiray"] == pytest.approx(row["mray_per_s"] / multi)


def test_without_json_a_table(rows):
    console = Console(file=io.StringIO(), width=80)
    print_rows(console, "bench rays, seed 0", rows)
    text = console.file.getvalue()
    assert "bench rays, seed 0" in text
    assert text.count("mj_multiRay") == len(SCENES)
    assert "…" not in text


def test_disagreement_by_hand():
    got = np.array([1.0, -1.0, 3.0]), np.array([4, -1, 6], np.int32)
    expected = np.array([1.5, -1.0, 3.0]), np.array([4, -1, 7], np.int32)
    assert disagreement(got, expected) == (0.5, 1)


def test_hits_beyond_range_become_misses():
    distance, ids = within((np.array([2.0, 2.5, -1.0]), np.array([3, 4, -1], np.int32)), 2.0)
    assert distance.tolist() == [2.0, -1.0, -1.0]
    assert ids.tolist() == [3, -1, -1]
