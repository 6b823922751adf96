"""Which command answers what: by stamps, whatever the order and the wall clock."""

import pytest

from wayproof.harness.interface.ros2.inputs import Received
from wayproof.harness.interface.ros2.pace import Unexpected, answer_to, made_after, ticks_up_to
from wayproof.harness.interface.types import Velocity


def received(stamp_ns, sent_ns=0):
    return Received(Velocity(0.1), stamp_ns, sent_ns, publisher=1)


def test_in_lockstep_the_stamp_of_the_sweep_is_the_answer():
    old, new = received(100), received(200)
    assert answer_to(200, [old, new]) is new
    assert answer_to(200, [old]) is None
    assert answer_to(200, []) is None


@pytest.mark.parametrize(("one", "words"), [(None, "no stamp"), (201, "stamp 0.000000201 s")])
def test_in_lockstep_a_command_of_its_own_time_is_refused(one, words):
    with pytest.raises(Unexpected, match=words):
        answer_to(200, [received(100), received(one)])


def test_of_a_controller_the_first_command_after_the_clock_counts():
    late, first, second = received(201), received(251), received(260)
    assert made_after(201, 0, [late, first, second]) is first
    assert made_after(201, 0, [late]) is None


def test_a_command_without_a_stamp_counts_by_when_it_was_sent():
    before, after = received(None, sent_ns=999), received(None, sent_ns=1000)
    assert made_after(201, 1000, [before, after]) is after
    assert made_after(201, 1000, [before]) is None


def test_controller_periods_end_up_to_the_sweep_and_with_it():
    assert ticks_up_to(200, 100, 50) == [150, 200]
    assert ticks_up_to(199, 100, 50) == [150]
    assert ticks_up_to(100, 100, 50) == []
    assert ticks_up_to(230, 100, 40) == [140, 180, 220]
