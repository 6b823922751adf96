import json
from pathlib import Path

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, setting_names, to_json, value_of
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.renamed import RENAMED
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.build import build_navigator

BASE = Config("warehouse", "drone", 3)
LOGS = Path(__file__).parent / "logs"


def test_override_changes_only_the_named_field():
    changed = override(BASE, ["map.resolution=0.05", "planner.iterations=7"])
    assert changed.map.resolution == 0.05
    assert changed.planner.iterations == 7
    assert (
        override(changed, ["map.resolution=0.1", f"planner.iterations={BASE.planner.iterations}"])
        == BASE
    )


def test_json_round_trip_is_exact():
    config = override(BASE, ["map.half_life=0.1", "goal=[1.1,2.2]"])
    assert from_json(to_json(config)) == config


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("map.resolution=-1", "map.resolution: got -1"),
        ("map.resolution=abc", "expected a finite number, such as 0.1"),
        ("map.resolution=NaN", "expected a finite number, such as 0.1"),
        ("planner.iterations=1.5", "planner.iterations: expected `int`, got `float`"),
        ("costmap.unknown_policy=maybe", "costmap.unknown_policy"),
        ("map.resolutoin=0.1", "did you mean 'map.resolution'?"),
        ("nothing=1", "unknown setting 'nothing'"),
        ("map=1", "unknown setting 'map'"),
        ("map.resolution", "expected section.field=value"),
        ("latency.deadline=0", "latency.deadline: got 0"),
        ("goal=[1]", "goal: got 1 numbers"),
        ("seed=-1", "seed: got -1"),
        ("behaviour.wait_timeout=-2", "behaviour.wait_timeout: got -2"),
    ],
)
def test_bad_settings_are_told_in_one_line(setting, said):
    with pytest.raises(InputError) as caught:
        override(BASE, [setting])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_setting_name_can_be_set_to_its_own_value():
    import json

    import msgspec

    for name in setting_names():
        value = msgspec.to_builtins(value_of(BASE, name))
        assert override(BASE, [f"{name}={json.dumps(value)}"]) == BASE, name


def test_a_planner_of_the_users_is_named_by_module_and_class():
    config = override(Config("empty", "drone", 0), ["planner.name=ompl.geometric:RRTConnect"])
    assert config.planner.name == "ompl.geometric:RRTConnect"
    with pytest.raises(InputError, match="cannot be loaded"):
        override(Config("empty", "drone", 0), ["planner.name=no.such:Planner"])


def test_no_code_is_loaded_because_a_log_names_it():
    config = override(Config("empty", "drone", 0), ["planner.name=ompl.geometric:RRTConnect"])
    with pytest.raises(InputError, match="expected --allow-plugins"):
        from_json(to_json(config))
    assert from_json(to_json(config), allow_plugins=True) == config


@pytest.mark.parametrize(
    ("robot", "planner", "space", "expected"),
    [
        (
            "drone",
            "bitstar",
            "pose",
            "pose in space for the planner bitstar, expected position",
        ),
        ("drone", "rrtconnect", "dubins", "got dubins in space, expected position or pose"),
        ("quadruped", "astar", "position", "got position for a body of discs, expected pose"),
    ],
)
def test_a_state_space_that_does_not_suit_the_robot(robot, planner, space, expected):
    settings = [f"planner.name={planner}", f"planner.state_space={space}"]
    scenario = build(override(Config("empty", robot, 1), settings))
    with pytest.raises(InputError, match=f"^robot '{robot}': planner.state_space: .*{expected}"):
        build_navigator(scenario.config, scenario.mission, {})


def test_settings_under_their_former_names_are_read_from_documents_and_from_set():
    former = {
        "world": "empty",
        "robot": "drone",
        "seed": 3,
        "map": {"hit": 0.8, "inflation_margin": 0.3, "look_ahead": 1.0, "surface_guard": "none"},
        "odometry": {"turn_sigma": 0.1},
        "planner": {"name": "field", "keep_ratio": 0.5},
    }
    config = from_json(json.dumps(former).encode())
    assert (config.map.log_odds_hit, config.map.floor_grazing_filter) == (0.8, False)
    assert config.map.dynamic.prediction_horizon == 1.0
    assert config.costmap.localization_margin == 0.3
    assert config.pose_model.yaw_bias_sigma == 0.1
    assert config.planner.switch_ratio == 0.5
    assert config.planner.name == "field"  # each decision of that log records it
    base = Config("empty", "drone", 3)
    settings = ["map.hit=0.8", "map.surface_guard=floor", "planner.name=field"]
    assert override(base, settings) == override(base, ["map.log_odds_hit=0.8"])


def test_every_former_name_stands_for_a_setting_and_is_none_itself():
    names = set(setting_names())
    assert set(RENAMED.values()) <= names
    assert not RENAMED.keys() & names
    assert len(RENAMED) - len(set(RENAMED.values())) == 9  # of `pose_model`, renamed twice


@pytest.mark.parametrize("version", ["2", "3", "4", "5"])
def test_logs_of_former_formats_open_with_the_settings_of_a_new_one(version):
    former = open_log(LOGS / f"format-{version}.mcap").config
    current = open_log(LOGS / "format-6.mcap").config
    later = [f"planner.grain={current.planner.grain}"]
    later.append(f"keyframe_period={current.keyframe_period}")
    assert (former.map.ground_fit, current.map.ground_fit) == (False, True)
    later.append("map.ground_fit=true")
    assert (former.costmap.window, current.costmap.window) == (0.0, 32.0)
    later.append("costmap.window=32.0")
    assert (former.motion.limits, current.motion.limits) == ("cautious", "full")
    assert (former.behaviour.keep_moving, current.behaviour.keep_moving) == (False, True)
    shares = [one.behaviour.narrow_speed_fraction for one in (former, current)]
    assert shares == [1.0, 0.7]
    assert (former.behaviour.rules, current.behaviour.rules) == (1, 14)
    later += ["motion.limits=full", "behaviour.keep_moving=true"]
    later += ["behaviour.narrow_speed_fraction=0.7", "behaviour.rules=14"]
    assert override(former, ["planner.name=astar", *later]) == current


def test_a_log_recorded_by_the_planners_former_name_replays_bit_by_bit(capsys):
    assert main(["replay", str(LOGS / "format-5.mcap")]) == 0
