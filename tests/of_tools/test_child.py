from tests.tools.soak.child import Kill, in_child


def test_a_child_that_hangs_or_breaks_is_reported():
    def hang(report):
        report("begun")
        while True:
            pass

    def fail(report):
        report("begun")
        raise ZeroDivisionError

    hung, broken = in_child(hang, 0.5), in_child(fail, 20.0)
    assert (hung.code, hung.overdue, hung.lines) == (-9, True, ("begun",))
    assert broken.code == 1
    assert "ZeroDivisionError" in broken.lines[-1]
    for kill in (Kill(0, 0.2), Kill(1, 0.0)):
        killed = in_child(hang, 20.0, kill)
        assert (killed.code, killed.overdue) == (-9, False)
    assert killed.lines == ("begun",)
