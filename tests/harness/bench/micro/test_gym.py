import json

import pytest

from wayproof.harness.bench.micro import gym
from wayproof.harness.cli.main import main


def test_an_environment_is_slower_than_its_physics(capsys, monkeypatch):
    monkeypatch.setattr(gym, "STEPS", 15)
    assert main(["bench", "gym", "--repeats", "1", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["robot"] for row in rows] == ["quadruped", "drone"]
    for row in rows:
        assert (row["steps"], row["episodes"]) == (15, 1)
        assert row["beams"] in range(19_000, 20_001)
        assert 0.0 < row["steps_per_s"] < row["physics_per_s"]
        assert row["realtime_factor"] * 10.0 == pytest.approx(row["steps_per_s"])
