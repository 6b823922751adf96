from tests.planners.lattices import cells_of
from wayproof.planners.astar.primitives import LENGTHS, STEPS, motion_primitives


def test_tables_by_hand():
    ways = motion_primitives((0.0,), 0, 1)
    assert ways.lengths.tolist() == [LENGTHS[x * x + y * y] for x, y in STEPS]
    cells = [cells_of(ways.stepped, way) for way in range(16)]
    assert cells[0] == {(0, 0), (1, 0)}
    assert cells[2] == {(0, 0), (1, 0), (0, 1), (1, 1)}  # through the corner of four
    assert cells[1] == {(0, 0), (1, 0), (1, 1), (2, 1)}
    assert ways.turned.counts.tolist() == [[1]] * 16  # the centre of the body stays
