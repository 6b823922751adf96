import os
import signal
import time
from pathlib import Path

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.worker_pool import THREADS, TRIES, Bounds, WorkerPool


def double(number):
    return 2 * number


def die(count: Path, times: int) -> int:
    """Kill this process the first few times; afterwards return the number of calls."""
    calls = int(count.read_text()) + 1
    count.write_text(str(calls))
    if calls <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    return calls


def fail(text):
    raise ValueError(text)


def allocate(mib):
    return len(bytearray(mib * 2**20))


def test_values_come_in_the_order_of_the_jobs():
    with WorkerPool(2) as pool:
        assert list(pool.run_in_order(double, [(k,) for k in range(20)])) == list(range(0, 40, 2))
        assert {ended.number: ended.value for ended in pool.run(double, [(5,), (7,)])} == {
            0: 10,
            1: 14,
        }


def test_a_fresh_process_for_each_job_or_one_for_all():
    with WorkerPool(1) as pool:
        assert len(set(pool.run_in_order(os.getpid, [()] * 3))) == 1
    with WorkerPool(1, fresh=True) as pool:
        assert len(set(pool.run_in_order(os.getpid, [()] * 3))) == 3


@pytest.mark.parametrize("times", [TRIES - 1, TRIES])
def test_a_killed_worker_costs_one_try(tmp_path, times):
    count = tmp_path / "count"
    count.write_text("0")
    with WorkerPool(1) as pool:
        [ended] = pool.run(die, [(count, times)])
    if times < TRIES:
        assert ended.result() == TRIES
    else:
        assert ended.failure == f"its process died {TRIES} times, last with exit -9"
        with pytest.raises(InputError, match="job 0: its process died"):
            ended.result()


def test_bounds_of_time_and_memory():
    bounds = Bounds(wall_s=0.5, memory_mib=1024)
    with WorkerPool(1, bounds) as pool:
        [ended] = pool.run(time.sleep, [(60.0,)])
        assert ended.failure == "took more than the 0.5 s that bounds.wall_s allows"
        assert [one.value for one in pool.run(time.sleep, [(0.6,)], timed=False)] == [None]
        with pytest.raises(MemoryError):
            list(pool.run(allocate, [(2048,)], timed=False))


def test_an_exception_of_the_work_is_raised_and_the_environment_is_restored(monkeypatch):
    monkeypatch.setenv(THREADS, "3")
    with WorkerPool(1) as pool:
        assert list(pool.run_in_order(os.getenv, [(THREADS,)])) == ["1"]
        with pytest.raises(ValueError, match="broken"):
            list(pool.run(fail, [("broken",)]))
    assert os.environ[THREADS] == "3"
