import numpy as np

from wayproof.maps.columns import unpack
from wayproof.maps.kernels import labels as kernels
from wayproof.maps.semantic import UNLABELLED


def test_votes_are_counted_alike_compiled_and_as_python():
    rng = np.random.default_rng(7)
    voters = rng.integers(-3, 3, (200, 3))
    labels = rng.integers(0, 2, 200).astype(np.uint8)
    counts = rng.integers(1, 4, 200).astype(np.uint32)
    results = []
    for run in (kernels.count_votes, kernels.count_votes.py_func):
        directory, cells = np.full(256, -1, np.int32), np.zeros((60, 3), np.int64)
        votes, winners = np.zeros((60, 2), np.uint32), np.full(60, UNLABELLED, np.uint8)
        sums, box = np.zeros(2, np.uint64), np.array([[9] * 3, [-9] * 3])
        with np.errstate(over="ignore"):
            table = kernels.VoteTable(directory, cells, votes, winners)
            ballots = kernels.Ballots(voters, labels, counts)
            numbers = run(table, 0, ballots, sums, box)
        held = directory, cells, votes, winners, sums, box
        results.append((numbers, *(part.tobytes() for part in held)))
    assert results[0] == results[1]
    assert results[0][0][0] == 60
    assert results[0][0][1] > 0
    np.testing.assert_array_equal(winners, votes.argmax(axis=1))
    np.testing.assert_array_equal(box, [cells.min(axis=0), cells.max(axis=0)])


def test_balls_and_blocked_columns_are_alike_compiled_and_as_python():
    rng = np.random.default_rng(2)
    cells, squared = rng.integers(-6, 9, (9, 3)), rng.integers(0, 10, 9)
    balls = []
    for run in (kernels.grow_balls, kernels.grow_balls.py_func):
        grown = np.zeros((5, 4, 1), np.uint64)
        run(cells, squared, (-2, 0, -3), grown)
        balls.append(grown)
    np.testing.assert_array_equal(*balls)
    assert 0 < np.bitwise_count(grown).sum() < 5 * 4 * 20
    planes = []
    for run in (kernels.block_columns, kernels.block_columns.py_func):
        occupied, free = np.zeros((6, 2), np.uint64), np.full((6, 2), 2**64 - 1, np.uint64)
        run(grown, np.full((5, 4), 3, np.int16), 4, 1, 62, occupied, free)
        np.testing.assert_array_equal(occupied, ~free)
        planes.append(occupied)
    np.testing.assert_array_equal(*planes)
    blocked = unpack(grown, 64)[:, :, 3:7].any(axis=2)
    np.testing.assert_array_equal(unpack(planes[0][:, None], 128)[1:, 0, 62:66], blocked)
