import json

from rich.console import Console

from wayproof.harness.bench.micro import loop
from wayproof.harness.bench.table import print_rows
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
        stages_ms = [row[f"{stage}_ms"] for stage in loop.STAGES]
        assert 0.0 < min(stages_ms) <= max(stages_ms) < row["decision_ms_p50"]
        assert 0.0 < row["decision_ms_p50"] <= row["decision_ms_p99"]
        assert 0.02 < row["share_of_physics"] < 1.0
        assert row["physics_realtime_factor"] > row["realtime_factor"]
        # What a decision takes is part of what an episode of ten decisions a second takes.
        assert 0.0 < row["realtime_factor"] < 100.0 / sum(stages_ms)
    for robot in loop.ROBOTS:
        for load in ("dense", "dense-on-two"):
            scenario = build(override(Config(loop.WORLD, robot, 0), loop.LOADS[load]))
            assert sum(one.table.beams for one in scenario.scene.casters) >= 100_000
            assert scenario.config.map.resolution == 0.05
            assert scenario.config.threads == (2 if load == "dense-on-two" else 1)
    assert main(["bench", "loop", "--only", "heavy"]) == 2
    assert "(available: dense, dense-on-two, light)" in capsys.readouterr().err


def test_rows_fit_a_table_of_80_columns():
    row = loop.LoopRow(
        robot="quadruped",
        rays=100_000,
        resolution_m=0.05,
        threads=2,
        episodes=10,
        reached=10,
        share_of_physics=0.082,
        realtime_factor=12.34,
        physics_realtime_factor=265.4,
        sense_ms=1.46,
        map_ms=6.21,
        costmap_ms=2.34,
        plan_ms=4.35,
        decision_ms_p50=14.39,
        decision_ms_p99=88.4,
    )
    console = Console(width=80)
    with console.capture() as printed:
        print_rows(console, "loop", [row])
    text = printed.get()
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    assert all(value in text for value in ("0.082", "12.3", "265", "1.46", "6.21", "2.34", "88.4"))
