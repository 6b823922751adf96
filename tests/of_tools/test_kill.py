from tests.tools.soak.kill import soak_kill


def test_killed_episodes_leave_what_was_flushed():
    found = soak_kill(3, 0, print)
    assert found.failures == []
    assert found.killed + found.finished == 3
    assert found.killed > 0
