import gc
import re
import subprocess
import sys
import threading

import pytest

from wayproof.maps.parallel import WORTH_SHARING_US, ThreadTeam


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 7, 100])
def test_every_item_is_done_once(threads, count):
    team, done = ThreadTeam(threads), [0] * count
    for _ in range(3):

        def work(worker, part):
            assert 0 <= worker < threads
            for item in range(*part):
                done[item] += 1

        team.parallel_for(work, count)
    assert done == [3] * count


def test_an_exception_of_a_worker_reaches_the_caller_and_the_team_works_on():
    team, both_here = ThreadTeam(2), threading.Barrier(2, timeout=10)

    def work(worker, _):
        both_here.wait()  # one part each
        if worker == 1:
            raise ZeroDivisionError("of a worker")

    with pytest.raises(ZeroDivisionError, match="of a worker"):
        team.parallel_for(work, 2, parts_per_thread=1)
    done = []
    team.parallel_for(lambda _, part: done.extend(range(*part)), 10)
    assert sorted(done) == list(range(10))


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_all_workers_run_at_once(threads):
    all_here, workers = threading.Barrier(threads, timeout=10), []

    def work(worker):
        all_here.wait()
        workers.append(worker)

    team = ThreadTeam(threads)
    team.run_all(work)
    assert sorted(workers) == list(range(threads))


def test_a_short_loop_is_run_by_the_caller_alone():
    team, calls = ThreadTeam(2), []
    team.parallel_for(
        lambda worker, part: calls.append((worker, part)), 10, 6, WORTH_SHARING_US / 11
    )
    assert calls == [(0, (0, 10))]


def test_short_work_is_done_by_the_caller_alone():
    workers = []
    ThreadTeam(2).run_all(workers.append, WORTH_SHARING_US - 1)
    assert workers == [0]


def test_threads_start_with_the_first_work_and_end_with_their_team():
    before = set(threading.enumerate())
    team, all_here, threads = ThreadTeam(4), threading.Barrier(4, timeout=10), []
    assert set(threading.enumerate()) <= before

    def work(_):
        all_here.wait()
        threads.append(threading.current_thread())

    team.run_all(work)
    threads.remove(threading.current_thread())
    assert set(threading.enumerate()) - before == set(threads)
    assert len(threads) == 3
    assert all(thread.is_alive() for thread in threads)
    del team
    gc.collect()
    for thread in threads:
        thread.join(10)
    assert not any(thread.is_alive() for thread in threads)


@pytest.mark.parametrize("threads", [0, 65])
def test_a_number_of_threads_out_of_range_is_refused(threads):
    with pytest.raises(ValueError, match="expected 1 to 64"):
        ThreadTeam(threads)


SHORT_OF_MEMORY = """
import resource, threading
from pathlib import Path
from wayproof.maps.parallel import ThreadTeam
threading.stack_size(64 << 20)
mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (mapped + (1 << 30),) * 2)
try:
    ThreadTeam(64).parallel_for(lambda worker, part: None, 64)
except ValueError as error:
    print(error)
"""


def test_more_threads_than_the_system_starts_are_an_error_in_a_line():
    """63 workers of 64 MiB do not fit into 1 GiB."""
    printed = subprocess.run(
        [sys.executable, "-c", SHORT_OF_MEMORY], capture_output=True, text=True, check=True
    ).stdout
    assert re.fullmatch(r"threads: got 64, expected at most \d+, more are refused here\n", printed)
