import json

from wayproof.harness.bench.micro import loop
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.scenario.scenario import build


def test_whole_episodes_under_one_load(capsys):
    assert main(["bench", "loop", "--repeats", "1", "--only", "light", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["robot"] for row in rows] == ["quadruped", "drone"]
    for row in rows:
        assert row["rays"] in range(19_000, 20_001)
        assert (row["resolution_m"], row["threads"]) == (0.1, 1)
        assert (row["episodes"], row["reached"]) == (1, 1)
        assert set(row["stage_ms"]) == {"sense", "map", "costmap", "plan"}
        assert 0.0 < row["decision_ms_p50"] <= row["decision_ms_p99"]
        assert 0.02 < row["share_of_physics"] < 1.0
        assert row["physics_realtime_factor"] > row["realtime_factor"]
        # What a decision takes is part of what an episode of ten decisions a second takes.
        assert 0.0 < row["realtime_factor"] < 100.0 / sum(row["stage_ms"].values())
    for robot in loop.ROBOTS:
        for load in ("dense", "dense-on-two"):
            scenario = build(override(Config(loop.WORLD, robot, 0), loop.LOADS[load]))
            assert sum(one.table.beams for one in scenario.scene.casters) >= 100_000
            assert scenario.config.map.resolution == 0.05
            assert scenario.config.threads == (2 if load == "dense-on-two" else 1)
    assert main(["bench", "loop", "--only", "heavy"]) == 2
    assert "(available: dense, dense-on-two, light)" in capsys.readouterr().err
