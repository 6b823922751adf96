"""Worlds by the parameters of a config, from the command line to the replay."""

import itertools
from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import made_otherwise, rebuild
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.scenario.worlds import find_world
from wayproof.models.worlds import WORLDS

SET = ("world.empty.length=9", "world.passers_by=2", "episode.time_limit=1.5")


def test_only_the_parameters_of_its_own_world_apply():
    config = override(
        Config("empty", "drone", 1), ["world.warehouse.crates=2", "world.empty.width=9"]
    )
    assert find_world(config).high[:2] == (12.0, 9.0)
    assert find_world(Config("empty", "drone", 1)) == WORLDS["empty"](1, 0.5)


def test_a_world_is_generated_once_for_equal_parameters():
    config = Config("empty", "drone", 1)
    assert find_world(config) is find_world(Config("empty", "quadruped", 1))
    others = [replace(config, seed=2), replace(config, difficulty=0.7), override(config, SET[:1])]
    for other in others:
        assert find_world(other) != find_world(config)
        assert find_world(other) == WORLDS["empty"](
            other.seed, other.difficulty, other.world_parameters
        )


def test_a_check_of_the_seed_generates_the_world_anew(tmp_path, monkeypatch):
    make, calls = WORLDS["empty"], itertools.count()
    monkeypatch.setitem(WORLDS, "empty", lambda seed, *rest: make(seed + next(calls), *rest))
    path = tmp_path / "e.mcap"
    run_episode(build(override(Config("empty", "drone", 1), ["episode.time_limit=0.3"])), path)
    assert made_otherwise(open_log(path))


def test_a_log_holds_the_parameters_and_is_simulated_again(recorded):
    path = Path(recorded("empty", "drone", 1, *SET).log)
    log = open_log(path)
    assert log.config.world_parameters.empty.length == 9.0
    assert log.config.world_parameters.passers_by == 2
    assert log.mission.high[0] == 9.0
    assert [mover.name for mover in next(iter(log.truth())).movers] == [
        "passer_by_0",
        "passer_by_1",
    ]
    assert made_otherwise(log) == []
    assert rebuild(log).world == find_world(log.config)
    assert replay(path).identical
    assert simulate_again(path).identical


def test_no_way_through_is_one_line():
    settings = ["world.corridor.width=1.2", "world.corridor.crates=0"]
    config = override(Config("corridor", "drone", 1), settings)
    with pytest.raises(InputError, match=r"expected wider passages by world.corridor"):
        find_world(config)
    passable = replace(config.world_parameters, passage_radius=0.4)
    assert find_world(replace(config, world_parameters=passable)).name == "corridor"


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("world.warehouse.crates=3", "got a parameter of 'warehouse', but the world is 'empty'"),
        ("world.empty.length=99", "world.empty.length: got 99, expected 8 to 60 m"),
        ("world.empty.lenght=9", "did you mean 'world.empty.length'"),
        ("world.passers_by=some", "expected a whole number, such as 0"),
    ],
)
def test_a_wrong_parameter_is_one_line(capsys, setting, message):
    assert main(["run", "empty", "--robot", "drone", "--seed", "1", "--set", setting]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert "world_parameters" not in error


def test_a_replay_refuses_another_world(capsys, recorded):
    path = recorded("empty", "drone", 1, *SET).log
    assert main(["replay", "what-if", path, "--set", "world.empty.length=10"]) == 2
    assert "the log holds its world; expected 'wayproof run'" in capsys.readouterr().err
