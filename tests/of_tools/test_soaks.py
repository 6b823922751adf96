"""The soaks of `make test-all` in small; each runs there on hundreds of cases."""

import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.tools.small_log import COMMITTED
from tests.tools.soak import fuzz, imports, recordings
from tests.tools.soak.cases import MOST_MEMORY_MIB
from tests.tools.soak.child import Kill, in_child
from tests.tools.soak.episodes import run_trial
from tests.tools.soak.import_sources import SOURCES
from tests.tools.soak.kill import soak_kill
from tests.tools.soak.recording_sources import SOURCES as RECORDINGS
from tests.tools.soak.worlds import draw_batch
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.formats import open_recording
from wayproof.models.world_files import ImportOptions
from wayproof.models.world_files.importer import FORMATS, import_world
from wayproof.models.world_files.octomaps import read_octomap
from wayproof.models.worlds import WORLDS

DRAWN = settings(
    max_examples=40, deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)  # fmt: skip


def refused_in_a_line_or_read(read, *arguments):
    said = ""
    try:
        read(*arguments)
    except InputError as error:
        said = str(error)
    assert "\n" not in said


def test_a_child_that_hangs_or_breaks_is_reported():
    def hang(report):
        report("begun")
        while True:
            pass

    def fail(report):
        report("begun")
        raise ZeroDivisionError

    hung, broken = in_child(hang, 0.5), in_child(fail, 20.0)
    assert (hung.code, hung.overdue, hung.lines) == (-9, True, ("begun",))
    assert broken.code == 1
    assert "ZeroDivisionError" in broken.lines[-1]
    for kill in (Kill(0, 0.2), Kill(1, 0.0)):
        killed = in_child(hang, 20.0, kill)
        assert (killed.code, killed.overdue) == (-9, False)
    assert killed.lines == ("begun",)


def test_cases_in_a_watched_process():
    # A process of its own: the bound on memory is that of a process which does nothing besides,
    # and what a fork of this one holds depends on the tests before it.
    command = [sys.executable, "-m", "tests.tools.soak", "fuzz", "--count", "12", "--seed", "3"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    found = json.loads(ended.stdout.splitlines()[-1])
    assert (ended.returncode, found["failures"]) == (0, [])
    assert sum(found["refused"].values()) + sum(found["read"].values()) == 12
    assert 0 < found["peak_mib"] <= MOST_MEMORY_MIB


def test_a_random_episode_comes_again():
    trial = run_trial(240, 113)
    brief = "with another draw of episodes, choose a seed of a drone in the empty world"
    assert trial["episode"].startswith("empty drone"), brief
    assert (trial["failures"], trial["replayed"], trial["closed_loop"]) == ([], True, True)


def test_killed_episodes_leave_what_was_flushed():
    found = soak_kill(2, 0, print)
    assert found.failures == []
    assert found.killed + found.finished == 2
    assert found.killed > 0


@pytest.mark.parametrize("name", WORLDS)
def test_worlds_of_every_difficulty_draw_and_one_compiles(name):
    batch = draw_batch(name, 20, 5)
    assert batch.failures == []
    assert (batch.count, batch.compiled) == (5, 1)


def test_a_generator_that_fails_is_named_with_its_seed(monkeypatch):
    def broken(seed, difficulty):
        if seed == 8:
            raise ZeroDivisionError("no room")
        return WORLDS["empty"](seed, difficulty)

    monkeypatch.setitem(WORLDS, "broken", broken)
    batch = draw_batch("broken", 7, 3)
    assert batch.failures == ["world broken, seed 8, difficulty 0.75: ZeroDivisionError: no room"]
    assert batch.count == 2


@pytest.fixture(scope="module")
def log_copy(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "source.mcap"
    path.write_bytes(COMMITTED.read_bytes())
    return path


@given(st.sampled_from(fuzz.KINDS), st.integers(0, 2**32))
@example("forged", 2_195_821_628)  # a true place at 1e214 m, whose square is no number
@example("forged", 2198)  # cosine and sine of a beam that are as large
@example("forged", 3792)  # an estimated orientation
@example("forged", 989)  # a true one
@example("forged", 501_296)  # a delay of no number of steps
@example("forged", 503_856)  # a truth without a place
@example("forged", 504_432)  # a body of the scene beyond all numbers
@example("forged", 504_740)  # a true orientation of five numbers
@example("forged", 16568)  # a scene with masses that MuJoCo warns of
@DRAWN
def test_a_mutated_log_is_refused_in_a_line_or_read(log_copy, kind, seed):
    log, rng = open_log(log_copy), np.random.default_rng(seed)
    refused_in_a_line_or_read(fuzz.run_case, kind, log_copy, log, rng)
    assert [one.name for one in log_copy.parent.iterdir()] == ["source.mcap"]


@given(st.sampled_from(list(SOURCES)), st.integers(0, 2**32))
@example("sdf with png", 1514)  # so high that its scale is no number
@example("urdf", 912_531)  # a mesh whose areas are no numbers
@example("sdf", 112_700_532)  # a cylinder at 1e308 m, which divides to no number
@DRAWN
def test_a_broken_world_file_is_refused_in_a_line_or_read(tmp_path, kind, seed):
    refused_in_a_line_or_read(imports.run_case, kind, tmp_path, np.random.default_rng(seed))


@pytest.mark.parametrize("kind", SOURCES)
def test_the_sound_world_file_is_imported(kind, tmp_path):
    assert imports.import_whole(kind, tmp_path) is not None


def test_every_format_is_broken_but_those_that_are_tested_elsewhere():
    endings = {f".{next(iter(make())).split('.')[1]}" for make in SOURCES.values()}
    elsewhere = {".xml", ".mjcf", ".sdf", ".csv", ".3dmap"}
    assert endings | elsewhere == set(FORMATS)


def test_an_area_as_thin_as_it_is_long_is_read(tmp_path):
    """Two small boxes 9 km apart, in one row of cells."""
    points = "0 0 0\n9000 0.01 0\n"
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
    (tmp_path / "a.ply").write_text(head + "property float z\nend_header\n" + points)
    _, notes = import_world(tmp_path / "a.ply", ImportOptions(resolution=0.1))
    assert notes[0] == "2 points as 2 cells of 0.1 m"


def test_a_line_of_an_octomap_without_a_value_is_passed_over(tmp_path):
    files = SOURCES["bt"]()
    data = files["a.bt"].replace(b"size 17", b"size ")
    (tmp_path / "a.bt").write_bytes(data)
    assert len(read_octomap(tmp_path / "a.bt", ImportOptions()).parts) == 1


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recording_is_sound_and_broken_in_every_way_refused_in_a_line_or_read(tmp_path, name):
    (tmp_path / "sound").mkdir()
    sound = RECORDINGS[name](tmp_path / "sound")
    recording = open_recording(sound)
    assert sum(1 for _ in recording.sweeps()) >= 6
    assert recording.faults == {}
    before = _bytes(sound)
    for number, kind in enumerate(recordings.KINDS):
        folder = tmp_path / kind
        folder.mkdir()
        broken = recordings.break_one(sound, kind, folder, np.random.default_rng(number + 1))
        assert _bytes(broken) != before
        refused_in_a_line_or_read(recordings.read_whole, broken)
    assert _bytes(sound) == before


def _bytes(path):
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return b"".join(one.read_bytes() for one in files if one.is_file())
