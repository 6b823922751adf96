import json

import msgspec
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, setting_names, to_json, value_of
from wayproof.harness.errors import InputError
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.build import build_navigator

BASE = Config("warehouse", "drone", 3)


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
        ("planner.iterations=1.5", "planner.iterations: expected `int`, got `float`"),
        ("costmap.unknown_policy=maybe", "costmap.unknown_policy"),
        ("nothing=1", "unknown setting 'nothing'"),
        ("robot_file=x", "unknown setting 'robot_file'"),
        ("recording={}", "unknown setting 'recording'"),
        ("map=1", "unknown setting 'map'"),
        ("map.resolution", "expected section.field=value"),
        ("latency.deadline=0", "latency.deadline: got 0"),
        ("goal=[1]", "goal: got 1 numbers"),
        ("behaviour.wait_timeout=-2", "behaviour.wait_timeout: got -2"),
    ],
)
def test_bad_settings_are_told_in_one_line(setting, said):
    with pytest.raises(InputError) as caught:
        override(BASE, [setting])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_setting_name_can_be_set_to_its_own_value():
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
        ("drone", "bitstar", "pose", "pose in space for the planner bitstar, expected position"),
        ("drone", "rrtconnect", "dubins", "got dubins in space, expected position or pose"),
        ("quadruped", "astar", "position", "got position for a body of discs, expected pose"),
    ],
)
def test_a_state_space_that_does_not_suit_the_robot(robot, planner, space, expected):
    settings = [f"planner.name={planner}", f"planner.state_space={space}"]
    scenario = build(override(Config("empty", robot, 1), settings))
    with pytest.raises(InputError, match=f"^robot '{robot}': planner.state_space: .*{expected}"):
        build_navigator(scenario.config, scenario.mission, {})
