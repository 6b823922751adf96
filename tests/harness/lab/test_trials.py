import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.harness.shadow.conftest import BODY as SPEC
from tests.harness.shadow.conftest import shadowed, written
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.lab.policies import policies_of
from wayproof.harness.lab.source import PlacedSweep, Source, of_recording
from wayproof.harness.lab.trials import misses_to_free, run_trial
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import Body
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.summary import summarize
from wayproof.maps import MapConfig
from wayproof.models.sensors.beams import NO_RETURN

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


def beam(range_m):
    """One beam along x from the middle of a cell."""
    return WorldSweep(
        origins=np.array([[0.05, 0.05, 0.3]]),
        directions=np.array([[1.0, 0.0, 0.0]]),
        ranges_mm=np.array([round(1000 * range_m)], np.uint16),
        moments=np.zeros(1, np.int32),
    )


@pytest.mark.parametrize("kind", ["voxel", "grid2d"])
def test_a_thing_that_left_is_gone_after_the_sweeps_that_see_beyond_it(kind):
    config = MapConfig(kind=kind, half_life=0.0)
    stood = [beam(1.0)] * 50 + [beam(2.0)] * 30
    sweeps = tuple(PlacedSweep(100_000_000 * k, one, 3.0) for k, one in enumerate(stood))
    source = Source("beam", config, (-4.0, -4.0, -1.0), (4.0, 4.0, 2.0), sweeps)
    trial = run_trial(source, "clamps", "default", config)
    assert (trial.ghosts, trial.sweeps_to_free) == (1, misses_to_free(config))
    still = replace(source, sweeps=sweeps[:50])
    assert run_trial(still, "clamps", "default", config).sweeps_to_free is None


def test_wide_clamps_hold_real_ghosts_longer(source):
    recording = open_recording(FR079)
    longer = of_recording(recording, prepare(recording, BODY), 120)
    narrow, wide = (
        run_trial(longer, "clamps", "", replace(source.config, prob_max=top, half_life=0.0))
        for top in (0.7, 0.98)
    )
    assert narrow.ghosts > wide.ghosts > 0
    assert narrow.sweeps_to_free <= wide.sweeps_to_free


def test_beams_without_return_hit_nothing():
    silent = replace(beam(1.0), ranges_mm=np.array([NO_RETURN], np.uint16))
    assert len(silent.points_within(1000.0)) == 0
    assert len(beam(3.5).points_within(3.0)) == 0
    assert beam(2.0).points_within(3.0).tolist() == [[2.05, 0.05, 0.3]]


def test_the_share_admitted_grows_with_what_unknown_space_allows(tmp_path):
    robot = tmp_path / "wheeled.toml"
    robot.write_text(SPEC)
    backwards = [(-0.3 * k, 0.0, 0.0) for k in range(9)]  # the laser looks ahead
    log = shadowed(written(tmp_path / "a.clf", backwards), robot, tmp_path / "a.mcap")
    by_policy = {one.policy: one for one in policies_of(log)}
    forbid, allow = by_policy["forbid"], by_policy["allow"]
    assert forbid.admitted_share == summarize(assess(log)).admitted_share < 0.5
    assert "unknown" in forbid.refused_m
    assert (allow.admitted_share, allow.refused_m) == (1.0, {})
    assert by_policy["penalize"].admitted_share == 1.0
