from tests.tools.soak.worlds import draw_batch, soak_worlds
from wayproof.models.worlds import WORLDS


def test_worlds_draw_and_some_compile():
    found = soak_worlds(2 * len(WORLDS), 19, print)
    assert found.failures == []
    assert found.of == dict.fromkeys(WORLDS, 2)
    assert (found.count, found.compiled) == (2 * len(WORLDS), len(WORLDS))


def test_a_generator_that_fails_is_named_with_its_seed(monkeypatch):
    def broken(seed, difficulty):
        if seed == 8:
            raise ZeroDivisionError("no room")
        return WORLDS["empty"](seed, difficulty)

    monkeypatch.setitem(WORLDS, "broken", broken)
    batch = draw_batch("broken", 7, 3)
    assert batch.failures == ["world broken, seed 8, difficulty 0.75: ZeroDivisionError: no room"]
    assert batch.count == 2
