"""The record of a decision."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayproof.harness.decision import add_points, path_of, widened_in_words, widening_of
from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb

coordinates = st.floats(allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize(("kind", "field"), [(pb.Trajectory, "path"), (pb.Decision, "global_path")])
@given(points=st.lists(st.tuples(coordinates, coordinates, coordinates), max_size=20))
def test_points_in_wire_format_are_the_messages_that_protobuf_makes_itself(kind, field, points):
    """Down to what is left out when serialized: a zero, but not a negative one."""
    quick, slow = kind(), kind()
    for message in (quick, slow):  # what is there already stays
        getattr(message, field).add(x=1.0)
    add_points(quick, field, np.array(points).reshape(-1, 3))
    getattr(slow, field).extend(pb.Point(x=x, y=y, z=z) for x, y, z in points)
    assert quick.SerializeToString(deterministic=True) == slow.SerializeToString(deterministic=True)
    np.testing.assert_array_equal(
        path_of(getattr(quick, field))[1:], path_of(getattr(slow, field))[1:]
    )


def test_no_path_is_no_points():
    message = pb.Decision()
    add_points(message, "global_path", None)
    assert message == pb.Decision()


def test_a_widening_is_named_by_its_axis_and_a_forged_one_refused():
    wider = pb.Decision(resolution_m=0.1, widening=[0, 5])
    assert widened_in_words(wider) == ", 0.50 m more along y"
    assert widening_of(pb.Decision()) == (0, 0)
    for forged in ([1], [1, 2, 3], [0, 4_000_000_000]):
        with pytest.raises(InputError, match=r"widening .* expected two of at most 400 cells"):
            widening_of(pb.Decision(widening=forged))
