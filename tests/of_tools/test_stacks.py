"""Soak of logs of stacks on trial."""

from tests.tools.soak.stacks import UNSEEDED, soak_stacks


def test_a_stack_without_a_seed_behind_a_script_that_is_gone():
    replayed = soak_stacks(1, 0, print, first=9)
    assert replayed.failures == []
    assert (replayed.count, replayed.identical, replayed.behind_exec) == (1, 1, 1)
    assert replayed.stacks == {UNSEEDED: 1}
    assert (replayed.unseeded, replayed.found) == (1, 1)
    assert replayed.decisions > 7
