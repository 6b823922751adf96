import json

from tests.tools.soak.episodes import soak_episodes


def test_random_episodes_come_again():
    lines = []
    found = soak_episodes(2, 113, lines.append, first=240, jobs=1)
    assert found.failures == []
    assert (found.count, found.replayed, found.closed_loop, found.forked) == (2, 2, 1, 1)
    trials = [json.loads(line) for line in lines]
    assert [one["trial"] for one in trials] == [240, 241]
    brief = "with another draw of episodes, choose a seed of drones in the empty world"
    assert all(one["episode"].startswith("empty drone") for one in trials), brief
