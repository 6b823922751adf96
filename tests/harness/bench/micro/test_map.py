import dataclasses
import itertools
import math

import msgspec
import numpy as np
import pytest
from rich.console import Console

from wayproof.harness.bench.micro.map import (
    MODES,
    THREADS,
    MapRow,
    bench_map,
    extent,
    speed,
    workload,
)
from wayproof.harness.bench.micro.map_entrants import SETTLING, THINNING
from wayproof.harness.bench.micro.map_trials import (
    accuracies,
    agreement,
    agreements_with_octomap,
    false_free,
    floor_columns_lost,
    ghost,
    ghosts,
    sweeps_by_formula,
)
from wayproof.harness.bench.micro.map_workload import (
    FLOOR,
    HALL_PERIOD,
    HALL_SPACING,
    NOISE,
    RANGE,
    RAYS,
    Sweep,
    hall_sweeps,
    room_sweeps,
)
from wayproof.harness.bench.stages import STAGES
from wayproof.harness.bench.table import print_rows
from wayproof.maps import FREE, MapConfig, VoxelMap

COARSE = 0.2
STILL = MapConfig(half_life=0.0)


@pytest.fixture(scope="module")
def room():
    return room_sweeps(7)


def test_the_workload_is_what_peers_were_measured_on(room):
    """Of seed 7: 8.5 M steps, 47.7 thousand ends and 2.85 m a ray were measured elsewhere."""
    row = workload(room, 0.05)
    assert row.rays == len(room[0].ranges_mm) == 100_000
    assert row.mean_ray_m == pytest.approx(2.85, abs=0.01)
    assert row.ray_voxel_steps == pytest.approx(8.5e6, rel=0.02)
    assert row.end_cells == pytest.approx(47_700, rel=0.12)  # walls lay between cells there
    assert row.cells_updated == pytest.approx(1.45e6, rel=0.08)


def test_sweeps_are_true_but_for_noise(room):
    sweep = room[4]
    hit = sweep.geoms >= 0
    error = sweep.ranges_mm[hit] / 1000.0 - sweep.distances[hit]
    assert hit.mean() > 0.9
    returned = sweep.ranges_mm[hit] < 65535
    assert np.std(error[returned]) == pytest.approx(NOISE, rel=0.05)
    assert (sweep.ranges_mm[~hit] == 65535).all()
    floor = sweep.points()[sweep.geoms[hit] == FLOOR]
    assert len(floor) > 10_000
    assert np.abs(floor[:, 2]).max() < 1e-9
    assert np.abs(np.linalg.norm(sweep.directions, axis=1) - 1.0).max() < 1e-9


def test_sweeps_are_their_seeds_alone(room):
    again, other = room_sweeps(7), room_sweeps(8)
    assert all((a.ranges_mm == b.ranges_mm).all() for a, b in zip(room, again, strict=True))
    assert (room[0].ranges_mm != other[0].ranges_mm).any()


def test_the_hall_repeats():
    phases = round(HALL_PERIOD / HALL_SPACING)
    hall = list(itertools.islice(hall_sweeps(0), phases + 2))
    steps = np.diff([sweep.origin for sweep in hall], axis=0)
    assert np.allclose(steps, [HALL_SPACING, 0.0, 0.0])
    assert (hall[1].ranges_mm == hall[phases + 1].ranges_mm).all()
    assert (hall[1].ranges_mm != hall[2].ranges_mm).any()


def test_speed_has_every_mode_and_the_peer_in_one_run(room):
    rows = speed(room, COARSE, RANGE, sweeps=2, peers=True)
    ours = [("wayproof", mode, threads) for mode in MODES for threads in THREADS]
    theirs = [("pyoctomap", mode, 1) for mode in THINNING]
    assert [(row.library, row.mode, row.threads) for row in rows] == ours + theirs
    fastest = min(row.ms_per_sweep for row in rows[len(ours) :])
    for row in rows:
        assert 0.0 < row.ms_per_sweep <= row.ms_p99
        assert row.ratio_vs_pyoctomap == pytest.approx(fastest / row.ms_per_sweep)
        assert 0.1 < row.map_mib < 64.0
        assert (row.rays, row.resolution_m, row.range_m) == (RAYS, COARSE, RANGE)


def test_without_the_peer_there_is_no_ratio(room):
    rows = speed(room, COARSE, RANGE, sweeps=1, modes={"clamped": STILL})
    assert {row.library for row in rows} == {"wayproof"}
    assert {row.ratio_vs_pyoctomap for row in rows} == {None}


def test_extent_measures_both_lengths_on_the_same_sweeps():
    short, long = extent(0, 2.0, 6.0, COARSE)
    assert (short.trajectory_m, long.trajectory_m) == (2.0, 6.0)
    assert short.map_mib < long.map_mib
    assert SETTLING < 2.0 / HALL_SPACING


def test_ghosts_stay_as_long_as_arithmetic_says():
    found = list(ghosts())
    assert len(found) == 14
    for one in found:
        assert abs(one.sweeps_to_free - one.sweeps_by_formula) <= 1, one
    still = [one for one in found if one.half_life_s == 0.0]
    assert all(one.sweeps_to_free == one.sweeps_by_formula for one in still)


def test_the_formula_by_hand():
    """ln(0.97 / 0.03) = 3.476 is above 8 and below 9 times 0.4; half of it above 4 times."""
    assert sweeps_by_formula(STILL, 0.0) == 9
    assert sweeps_by_formula(MapConfig(half_life=30.0), 30.0) == 5
    even = MapConfig(half_life=0.0, prob_max=1.0 / (1.0 + math.exp(-1.2)), log_odds_miss=0.6)
    assert sweeps_by_formula(even, 0.0) in (2, 3)  # after two it is 0 up to rounding: unknown


def test_a_ghost_nobody_looks_at_stays():
    assert ghost("voxel", STILL, 1000.0).sweeps_to_free == 9


class Told:
    """A map that says of every point what a function says."""

    def __init__(self, state):
        self._state = state

    def state_at(self, points):
        return self._state(np.asarray(points)).astype(np.uint8)


def test_lost_and_false_free_by_hand():
    """Three beams down to the floor, 0.3 m apart, and one against a wall; cells of 0.1 m."""
    directions = np.array([[0.0, 0, -1]] * 3 + [[1.0, 0, 0]])
    geoms = np.array([FLOOR, FLOOR, FLOOR, 5], np.int32)
    one = Sweep(np.zeros(3), directions, np.zeros(4, np.uint16), np.ones(4), geoms)
    sweeps = [one.moved(np.array([0.05 + 0.3 * k, 0.05, 1.0])) for k in range(3)]
    occupied = Told(lambda p: np.where((p[:, 0] < 0.1) & (np.abs(p[:, 2]) < 0.12), 2, 1))
    assert floor_columns_lost(occupied, sweeps, 0.1) == pytest.approx(2 / 3)
    # Six cells hold a surface: one floor's is occupied, two floors' and three walls' are free.
    assert false_free(occupied, sweeps, 0.1) == pytest.approx(5 / 6)


def test_agreement_by_hand():
    """Two maps that know the lower half of the room; in one the floor's layer is free."""
    one = Told(lambda p: np.where(p[:, 2] < 1.5, np.where(p[:, 2] < 0.0, 2, 1), 0))
    other = Told(lambda p: np.where(p[:, 2] < 1.5, 1, 0))
    whole, above = agreement(one, other, 0.2)
    layers = 8  # with centres from -0.05 to 1.35 m
    assert whole == pytest.approx((layers - 1) / layers)
    assert above == 1.0


def test_accuracy_after_few_sweeps(room):
    found = list(accuracies(room[:3], COARSE))
    ours, theirs, on_a_face = found
    assert [f.library for f in found] == ["wayproof", "pyoctomap", "pyoctomap"]
    assert 0.0 < ours.floor_columns_lost <= theirs.floor_columns_lost < 0.1
    assert 0.0 < ours.false_free <= theirs.false_free < on_a_face.false_free < 0.5


def test_the_map_agrees_with_octomap_but_where_the_floor_is_guarded(room):
    guarded, bare = agreements_with_octomap(room[:4], COARSE)
    assert [guarded.mode, bare.mode] == ["guarded floor", "no guard"]
    assert 0.98 < guarded.agreement < guarded.agreement_above_floor
    assert min(guarded.agreement_above_floor, bare.agreement) >= 0.9999


def test_rows_have_every_field_and_are_json(room):
    rows = [dataclasses.asdict(row) for row in (workload(room[:1], COARSE), MapRow(part="speed"))]
    fields = [field.name for field in dataclasses.fields(MapRow)]
    assert [list(row) for row in rows] == [fields, fields]
    assert fields[:10] == [
        "part",
        "library",
        "mode",
        "threads",
        "rays",
        "resolution_m",
        "ms_per_sweep",
        "ms_p99",
        "ratio_vs_pyoctomap",
        "map_mib",
    ]
    assert msgspec.json.decode(msgspec.json.encode(rows)) == rows


def test_rows_that_tell_the_same_fields_share_a_table(capsys):
    rows = [{"part": "a", "x": 1, "y": None}, {"part": "a", "x": 2, "y": None}]
    rows.append({"part": "b", "x": None, "y": 3.0})
    print_rows(Console(width=80), "title", rows)
    printed = capsys.readouterr().out
    assert printed.count("title") == 1
    assert printed.count("part") == 2
    assert printed.count("x") == 1


def test_it_is_a_stage():
    assert STAGES["map"].measure is bench_map


def test_a_marked_cell_is_free_for_the_lab():
    """The room of the workload fits the maps made for it."""
    voxel_map = VoxelMap(STILL)
    voxel_map.mark_free((0.0, 0.0, 0.0), (20.5, 20.5, 3.3), 0)
    assert voxel_map.state_at([[0.1, 0.1, 0.1], [20.4, 20.4, 3.2]]).tolist() == [FREE, FREE]
