"""Broken files of every imported format: refused in one line or read, and nothing else."""

import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.tools.soak.cases import MOST_MEMORY_MIB
from tests.tools.soak.import_sources import SOURCES
from tests.tools.soak.imports import import_whole, run_case
from wayproof.harness.errors import InputError
from wayproof.models.world_files import FORMATS, ImportOptions, import_world
from wayproof.models.world_files.octomaps import read_octomap


@pytest.mark.parametrize("kind", SOURCES)
def test_the_sound_file_is_imported(kind, tmp_path):
    assert import_whole(kind, tmp_path) is not None


def test_every_format_is_broken_but_those_that_are_tested_elsewhere():
    endings = {f".{next(iter(make())).split('.')[1]}" for make in SOURCES.values()}
    elsewhere = {".xml", ".mjcf", ".sdf", ".csv", ".3dmap"}
    assert endings | elsewhere == set(FORMATS)


def test_broken_files_in_a_watched_process():
    command = [sys.executable, "-m", "tests.tools.soak", "imports", "--count"]
    ended = subprocess.run([*command, "21"], capture_output=True, text=True, check=False)
    found = json.loads(ended.stdout.splitlines()[-1])
    assert (ended.returncode, found["failures"]) == (0, [])
    assert sum(found["refused"].values()) + sum(found["read"].values()) == 21
    assert 0 < found["peak_mib"] <= MOST_MEMORY_MIB


def test_an_area_as_thin_as_it_is_long_is_read(tmp_path):
    """Two small boxes 90 km apart: two million cells in one row."""
    points = "0 0 0\n90000 0.01 0\n"
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
    (tmp_path / "a.ply").write_text(head + "property float z\nend_header\n" + points)
    _, notes = import_world(tmp_path / "a.ply", ImportOptions(resolution=0.1))
    assert notes[0] == "2 points as 2 cells of 0.1 m"


def test_a_line_of_an_octomap_without_a_value_is_passed_over(tmp_path):
    files = SOURCES["bt"]()
    data = files["a.bt"].replace(b"size 17", b"size ")
    (tmp_path / "a.bt").write_bytes(data)
    assert len(read_octomap(tmp_path / "a.bt", ImportOptions()).parts) == 1


@given(st.sampled_from(list(SOURCES)), st.integers(0, 2**32))
@example("sdf with png", 1514)  # so high that its scale is no number
@example("sdf", 112_700_532)  # a cylinder at 1e308 m, which divides to no number
@settings(
    max_examples=40, deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)  # fmt: skip
def test_a_broken_file_is_refused_in_a_line_or_read(tmp_path, kind, seed):
    said = ""
    try:
        run_case(kind, tmp_path, np.random.default_rng(seed))
    except InputError as error:
        said = str(error)
    assert "\n" not in said
