import gc
import re
import subprocess
import sys
import threading

import pytest

from wayproof.maps.parallel import WORTH_SHARING_US, Team


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 7, 100])
def test_every_item_is_done_once(threads, count):
    team, done = Team(threads), [0] * count
    for _ in range(3):

        def work(member, part):
            assert 0 <= member < threads
            for item in range(*part):
                done[item] += 1

        team.share(work, count)
    assert done == [3] * count


def test_what_a_helper_raises_reaches_the_caller_and_the_team_goes_on():
    team, met = Team(2), threading.Barrier(2, timeout=10)

    def work(member, _):
        met.wait()  # one part each
        if member == 1:
            raise ZeroDivisionError("a helper's")

    with pytest.raises(ZeroDivisionError, match="a helper's"):
        team.share(work, 2, parts_each=1)
    done = []
    team.share(lambda _, part: done.extend(range(*part)), 10)
    assert sorted(done) == list(range(10))


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_all_members_work_together(threads):
    met, seen = threading.Barrier(threads, timeout=10), []

    def work(member):
        met.wait()  # all at once
        seen.append(member)

    team = Team(threads)
    team.together(work)
    assert sorted(seen) == list(range(threads))


def test_little_work_is_not_shared():
    team, members = Team(2), []
    team.share(lambda member, part: members.append((member, part)), 10, 6, WORTH_SHARING_US / 11)
    assert members == [(0, (0, 10))]


def test_little_work_is_done_by_the_caller_alone():
    members = []
    Team(2).together(members.append, WORTH_SHARING_US - 1)
    assert members == [0]


def test_threads_end_with_their_team():
    team = Team(4)
    assert team._helpers == []
    team.share(lambda *_: None, 4)
    helpers = [helper._thread for helper in team._helpers]
    assert [helper.is_alive() for helper in helpers] == [True] * 3
    del team
    gc.collect()
    for helper in helpers:
        helper.join(10)
    assert not any(helper.is_alive() for helper in helpers)


@pytest.mark.parametrize("threads", [0, 65])
def test_a_team_of_no_size(threads):
    with pytest.raises(ValueError, match="expected 1 to 64"):
        Team(threads)


SHORT_OF_MEMORY = """
import resource, threading
from pathlib import Path
from wayproof.maps.parallel import Team
threading.stack_size(64 << 20)
mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (mapped + (1 << 30),) * 2)
try:
    Team(64).share(lambda member, part: None, 64)
except ValueError as error:
    print(error)
"""


def test_more_threads_than_the_system_starts_are_an_error_in_a_line():
    """63 helpers of 64 MiB do not fit into 1 GiB."""
    told = subprocess.run(
        [sys.executable, "-c", SHORT_OF_MEMORY], capture_output=True, text=True, check=True
    ).stdout
    assert re.fullmatch(r"threads: got 64, expected at most \d+, more are refused here\n", told)
