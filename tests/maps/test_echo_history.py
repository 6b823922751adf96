"""Echoes by direction over sweeps, and silence that the map contradicts."""

import math
from collections import defaultdict

import numpy as np
import pytest

from tests.maps.test_ground_fit import NO_RETURN, RANGE_M, beams
from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.echo_history import SAMPLE, SILENT_SWEEPS, EchoHistory, are_contradicted
from wayproof.maps.kernels import echo_history as kernels

DIRECTIONS = beams(30, 240)
RETURN_MM = 4000


def all_echoes(directions=DIRECTIONS):
    return np.full(len(directions), RETURN_MM, np.uint16)


def with_patch(rng, share):
    """A sweep that lost its echoes in a run of columns."""
    image = all_echoes().reshape(30, 240)
    image[:, (rng.integers(240) + np.arange(round(240 * share))) % 240] = NO_RETURN
    return image.ravel()


def naive_index(direction):
    """The square of the cube that a direction passes, by its definition."""
    axis = int(np.argmax(np.abs(direction)))
    face = 2 * axis + (direction[axis] <= 0.0)
    along = [direction[(axis + k) % 3] / abs(direction[axis]) for k in (1, 2)]
    row, column = (
        min(math.floor((u + 1.0) * kernels.ACROSS / 2), kernels.ACROSS - 1) for u in along
    )
    return (face * kernels.ACROSS + row) * kernels.ACROSS + column


def test_directions_are_squares_of_a_cube():
    rng = np.random.default_rng(0)
    random = rng.normal(size=(3000, 3))
    random /= np.linalg.norm(random, axis=1)[:, None]
    axes = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0.6, 0.0], [0.0, -0.6, 0.6]]])
    for x, y, z in np.concatenate([random, axes]).tolist():
        index = naive_index(np.array([x, y, z]))
        assert kernels.direction_index(x, y, z) == index
        assert kernels.direction_index.py_func(x, y, z) == index
    indices = {naive_index(one) for one in rng.normal(size=(60_000, 3))}
    assert indices == set(range(kernels.DIRECTIONS))


def test_directions_that_are_none_stay_within_the_cube():
    """The map refuses such beams, but only after the history has taken them in."""
    for one in ((np.nan,) * 3, (1.0, np.nan, 0.0), (0.0, np.nan, 1e-300), (np.inf, np.inf, 0.0)):
        assert 0 <= kernels.direction_index(*one) < kernels.DIRECTIONS
    assert 0 <= kernels.direction_index(0.0, 0.0, 0.0) < kernels.DIRECTIONS


def test_silence_counts_after_so_many_sweeps_in_a_row():
    history = EchoHistory()
    silent = np.full(len(DIRECTIONS), NO_RETURN, np.uint16)
    for sweep in range(1, SILENT_SWEEPS + 3):
        count = history.take_in(DIRECTIONS, silent)
        recent = history.recently_silent(DIRECTIONS, silent)
        assert recent.all() == recent.any() == (sweep < SILENT_SWEEPS)
        assert count == recent.sum()
    history.take_in(DIRECTIONS, all_echoes())
    assert not history.silent_sweeps.any()
    assert history.take_in(DIRECTIONS, silent) == len(silent)


def test_the_history_is_that_of_dictionaries_compiled_or_not():
    rng, history, runs = np.random.default_rng(3), EchoHistory(), defaultdict(int)
    interpreted = np.zeros(kernels.DIRECTIONS, np.uint8)
    index = [naive_index(one) for one in DIRECTIONS]
    for _ in range(25):
        ranges_mm = with_patch(rng, 0.6)
        ranges_mm[rng.random(len(ranges_mm)) < 0.3] = 0
        counted = np.empty(kernels.DIRECTIONS, np.int64)
        count, returned = kernels.note_echoes.py_func(
            DIRECTIONS, ranges_mm, 1, SILENT_SWEEPS, counted, interpreted
        )
        assert history.take_in(DIRECTIONS, ranges_mm) == count
        seen = defaultdict(set)
        for k, value in zip(index, ranges_mm.tolist(), strict=True):
            if value:
                seen[k].add(value == NO_RETURN)
        came_back = {k for k in seen if False in seen[k] and 0 < runs[k] < SILENT_SWEEPS}
        assert returned == sum(
            value not in (0, NO_RETURN) and k in came_back
            for k, value in zip(index, ranges_mm.tolist(), strict=True)
        )
        for k, kinds in seen.items():
            runs[k] = min(runs[k] + 1, SILENT_SWEEPS) if kinds == {True} else 0
        recent = np.array(
            [
                value == NO_RETURN and runs[k] < SILENT_SWEEPS
                for k, value in zip(index, ranges_mm.tolist(), strict=True)
            ]
        )
        assert (history.silent_sweeps == interpreted).all()
        assert {k: run for k, run in runs.items() if run} == {
            int(k): int(history.silent_sweeps[k]) for k in np.flatnonzero(history.silent_sweeps)
        }
        assert (history.recently_silent(DIRECTIONS, ranges_mm) == recent).all()
        found = np.empty(len(recent), np.bool_)
        kernels.find_recent.py_func(DIRECTIONS, ranges_mm, SILENT_SWEEPS, interpreted, found)
        assert (found == recent).all()
        assert count == recent.sum()


def test_of_many_beams_some_are_looked_at_and_the_count_is_about_right():
    rng = np.random.default_rng(1)
    many = rng.normal(size=(100_000, 3))
    many /= np.linalg.norm(many, axis=1)[:, None]
    ranges_mm = np.where(many[:, 0] > 0.5, NO_RETURN, RETURN_MM).astype(np.uint16)
    history = EchoHistory()
    count = history.take_in(many, ranges_mm)
    assert abs(count - history.recently_silent(many, ranges_mm).sum()) < 0.03 * count


@pytest.mark.parametrize(
    ("silent_sweeps", "steady_sweeps"),
    [
        (np.zeros(7, np.uint8), 0),
        (np.full(kernels.DIRECTIONS, SILENT_SWEEPS + 1, np.uint8), 0),
        (np.zeros(kernels.DIRECTIONS, np.uint8), SILENT_SWEEPS + 1),
    ],
)
def test_a_history_that_is_none_is_refused(silent_sweeps, steady_sweeps):
    with pytest.raises(ValueError, match="expected"):
        EchoHistory().restore(silent_sweeps, steady_sweeps)


def test_patches_that_move_are_echoes_that_come_and_go_and_others_are_not():
    rng, history = np.random.default_rng(5), EchoHistory()
    for _ in range(6):
        history.take_in(DIRECTIONS, with_patch(rng, 0.3))
    assert history.loses_echoes
    history.take_in(DIRECTIONS, all_echoes())  # the last patch comes back
    for _ in range(SILENT_SWEEPS):
        assert history.loses_echoes
        history.take_in(DIRECTIONS, all_echoes())
    assert not history.loses_echoes
    still = EchoHistory()
    for _ in range(30):
        still.take_in(DIRECTIONS, with_patch(np.random.default_rng(6), 0.6))  # at one place
        assert not still.loses_echoes


@pytest.fixture(scope="module")
def room():
    """A map of walls 4 m around the sensor."""
    voxel_map = VoxelMap(MapConfig(), (-6.0, -6.0, -3.0), (6.0, 6.0, 3.0))
    for time_ns in (0, 10**8):
        voxel_map.integrate(
            origins=np.zeros((1, 3)),
            directions=DIRECTIONS,
            ranges_mm=all_echoes(),
            range_limit=RANGE_M,
            time_ns=time_ns,
        )
    return voxel_map


def contradicted(room, chosen, beams_of_sweep):
    return are_contradicted(
        room, np.zeros((chosen.sum(), 3)), DIRECTIONS[chosen], RANGE_M, beams_of_sweep
    )


def test_silence_across_walls_is_contradicted_and_others_are_not(room):
    level = np.abs(DIRECTIONS[:, 2]) < 0.2
    assert SAMPLE < level.sum()
    assert contradicted(room, level, int(level.sum()))
    assert contradicted(room, level, 15 * int(level.sum()))
    assert not contradicted(room, level, 17 * int(level.sum()))  # less than 6 % of the sweep
    nothing = VoxelMap(MapConfig(), (-6.0, -6.0, -3.0), (6.0, 6.0, 3.0))
    assert not contradicted(nothing, level, int(level.sum()))
    short = are_contradicted(
        room, np.zeros((level.sum(), 3)), DIRECTIONS[level], 3.5, int(level.sum())
    )
    assert not short  # the wall is farther than silence clears
