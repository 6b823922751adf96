import json

from wayproof.harness.bench.soak.episodes import soak_episodes


def test_random_episodes_come_again():
    lines = []
    found = soak_episodes(2, 72, lines.append, first=20, jobs=1)  # of drones in the empty world
    assert found.failures == []
    assert (found.count, found.replayed, found.closed_loop, found.forked) == (2, 4, 1, 1)
    assert [json.loads(line)["trial"] for line in lines] == [20, 21]
