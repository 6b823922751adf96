import math
from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.lab.source import first, of_recording
from wayproof.harness.lab.trials import build, misses_to_free, run_trial
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.shadow.body import Body
from wayproof.harness.shadow.prepare import prepare
from wayproof.maps import MapConfig

FR079 = Path(__file__).resolve().parents[3] / "examples/recordings/fr079/fr079-200.clf.bz2"
BODY = Body("wheeled", "ground", 0.25, 0.4, 0.02, 1.0, 1.0, 10.0, 1.0, ())


@pytest.fixture(scope="module")
def source():
    recording = open_recording(FR079)
    return of_recording(recording, prepare(recording, BODY), 20)


@pytest.mark.parametrize("kind", ["voxel", "grid2d"])
@pytest.mark.parametrize("top", [0.97, 0.98, 0.7])
def test_a_ghost_is_gone_after_the_misses_that_its_clamp_holds(kind, top):
    config = MapConfig(kind=kind, prob_max=top)
    held = math.log(top / (1.0 - top)) / config.log_odds_miss
    assert misses_to_free(config) in (math.ceil(held), math.ceil(held) + 1)  # whole units


def test_finer_cells_hold_more_of_them(source):
    fine, coarse = (
        run_trial(source, "resolution", f"{size}", replace(source.config, resolution=size))
        for size in (0.05, 0.2)
    )
    assert fine.free > 8 * coarse.free
    assert fine.occupied > coarse.occupied
    assert fine.memory_mib >= coarse.memory_mib


def test_the_sweeps_are_those_of_the_recording(source):
    assert len(source.sweeps) == 20
    assert source.config.kind == "grid2d"
    a_map, spent = build(source, source.config)
    assert len(spent) == 20
    assert a_map.counts()["free"] > 1000


def test_only_so_many_sweeps_are_read():
    assert first(iter(range(10)), 3) == (0, 1, 2)
