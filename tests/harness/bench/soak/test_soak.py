import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from wayproof.harness.bench.maintain.small_log import COMMITTED, committed_name
from wayproof.harness.bench.soak.child import Kill, in_child
from wayproof.harness.bench.soak.episodes import soak_episodes
from wayproof.harness.bench.soak.fuzz import KINDS, MOST_MEMORY_MIB, run_case
from wayproof.harness.bench.soak.kill import soak_kill
from wayproof.harness.bench.soak.race import soak_race
from wayproof.harness.bench.soak.worlds import draw_batch, soak_worlds
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.models.worlds import WORLDS


def test_killed_episodes_leave_what_was_flushed():
    found = soak_kill(3, 0, print)
    assert found.failures == ()
    assert found.killed + found.finished == 3
    assert found.killed > 0


def test_random_episodes_come_again():
    lines = []
    found = soak_episodes(2, 72, lines.append, first=20, jobs=1)  # of drones in the empty world
    assert found.failures == []
    assert (found.count, found.replayed, found.closed_loop, found.forked) == (2, 4, 1, 1)
    assert [json.loads(line)["trial"] for line in lines] == [20, 21]


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


def test_mutated_input_in_a_watched_process():
    # A process of its own: the bound on memory is that of a process which does nothing besides,
    # and what a fork of this one holds depends on the tests before it.
    module = "wayproof.harness.bench.soak"
    command = [sys.executable, "-m", module, "fuzz", "--count", "24", "--seed", "3"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    found = json.loads(ended.stdout.splitlines()[-1])
    assert (ended.returncode, found["failures"]) == (0, [])
    assert sum(found["refused"].values()) + sum(found["read"].values()) == 24
    assert 0 < found["peak_mib"] <= MOST_MEMORY_MIB


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "source.mcap"
    path.write_bytes((COMMITTED / committed_name()).read_bytes())
    return path


@given(st.sampled_from(KINDS), st.integers(0, 2**32))
@example("forged", 2_195_821_628)  # a true place at 1e214 m, whose square is no number
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_mutated_input_is_refused_in_a_line_or_read(copy, kind, seed):
    said = ""
    try:
        run_case(kind, copy, open_log(copy), np.random.default_rng(seed))
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert [one.name for one in copy.parent.iterdir()] == ["source.mcap"]


def test_a_child_that_hangs_or_breaks_is_told_of():
    def hang(tell):
        tell("begun")
        while True:
            pass

    def fail(tell):
        tell("begun")
        raise ZeroDivisionError

    hung, broken = in_child(hang, 0.5), in_child(fail, 20.0)
    assert (hung.code, hung.overdue, hung.lines) == (-9, True, ("begun",))
    assert broken.code == 1
    assert "ZeroDivisionError" in broken.lines[-1]
    for kill in (Kill(0, 0.2), Kill(1, 0.0)):
        killed = in_child(hang, 20.0, kill)
        assert (killed.code, killed.overdue) == (-9, False)
    assert killed.lines == ("begun",)


def test_two_runs_for_one_log_are_one_log_and_one_refusal():
    found = soak_race(2, 0, print)
    assert found.failures == ()
    assert (found.refused, found.first_won + found.second_won) == (2, 2)
