from tests.tools.soak.race import soak_race


def test_two_runs_for_one_log_are_one_log_and_one_refusal():
    found = soak_race(2, 0, print)
    assert found.failures == ()
    assert (found.refused, found.first_won + found.second_won) == (2, 2)
