import json
import subprocess
import sys

import numpy as np
import pytest

from tests.tools.soak.cases import MOST_MEMORY_MIB
from tests.tools.soak.recording_sources import SOURCES
from tests.tools.soak.recordings import KINDS, break_one
from wayproof.harness.recordings.formats import open_recording


def test_broken_recordings_in_a_watched_process():
    # A process of its own, as of the fuzzed logs.
    module = "tests.tools.soak"
    command = [sys.executable, "-m", module, "recordings", "--count", "51", "--seed", "5"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    found = json.loads(ended.stdout.splitlines()[-1])
    assert (ended.returncode, found["failures"], ended.stderr) == (0, [], "")
    assert sum(found["refused"].values()) + sum(found["read"].values()) == 51
    assert 0 < found["peak_mib"] <= MOST_MEMORY_MIB


@pytest.mark.parametrize("name", SOURCES)
def test_a_source_is_sound_and_every_way_breaks_it(tmp_path, name):
    (tmp_path / "sound").mkdir()
    sound = SOURCES[name](tmp_path / "sound")
    recording = open_recording(sound)
    assert sum(1 for _ in recording.sweeps()) >= 6
    assert recording.faults == {}
    before = _bytes(sound)
    for number, kind in enumerate(KINDS):
        folder = tmp_path / kind
        folder.mkdir()
        rng = np.random.default_rng(number + 1)
        assert _bytes(break_one(sound, kind, folder, rng)) != before
    assert _bytes(sound) == before


def _bytes(path):
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return b"".join(one.read_bytes() for one in files if one.is_file())
