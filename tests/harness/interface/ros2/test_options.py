"""Options of `--stack ros2:...`."""

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.interface.ros2.options import Options, parse


def test_without_options_the_names_are_those_of_nav2(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    options = parse("ros2")
    assert options == Options()
    assert options.topic("cmd_vel") == "/cmd_vel"
    assert options.topic("local_costmap/costmap") == "/local_costmap/costmap"


def test_a_namespace_holds_all_topics_but_the_clock(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    options = parse("ros2:namespace=/robot1,cmd_vel=/my_cmd,/scan=front/scan,map=")
    assert options.domain == 7
    assert options.topic("tf") == "/robot1/tf"
    assert options.topic("clock") == "/clock"
    assert options.topic("cmd_vel") == "/my_cmd"
    assert options.topic("scan") == "/robot1/front/scan"
    assert options.topic("map") == ""


def test_ranges_stay_beside_their_points():
    options = parse("ros2:namespace=/robot1,points=front/points,depth/image=")
    assert options.topic("points/ranges") == "/robot1/front/points/ranges"
    assert options.topic("depth/image/ranges") == ""
    assert options.topic("altimeter/ranges") == "/robot1/altimeter/ranges"
    assert parse("ros2:points/ranges=").topic("points/ranges") == ""


def test_numbers_and_the_pace():
    options = parse("ros2:domain=5,pace=lockstep,controller_frequency=50,silence=0.5")
    assert options.domain == 5
    assert options.pace == "lockstep"
    assert (options.controller_frequency, options.silence) == (50.0, 0.5)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("nonsense", "got 'nonsense', expected KEY=VALUE"),
        ("cmdvel=/x", "got 'cmdvel', expected one of domain, namespace, pace"),
        ("pace=fast", "pace: got 'fast', expected one of auto, lockstep, controller"),
        ("domain=300", "domain: got 300, expected 0 to 232"),
        ("domain=1.5", "Expected `int`, got `str` - at `$.domain`"),
        ("silence=nan", "silence: got nan, expected 0 to 3600 s"),
        ("controller_frequency=0", "controller_frequency: got 0, expected 1 to 1000 Hz"),
        ("cmd_vel=a b", "cmd_vel: got 'a b', expected a ROS name"),
        ("namespace=1robot", "namespace: got '1robot', expected a ROS name"),
        ("base_frame=", "base_frame: got '', expected a ROS name"),
    ],
)
def test_what_is_no_option_is_told_in_one_line(text, line):
    with pytest.raises(InputError) as error:
        parse(f"ros2:{text}")
    assert line in str(error.value)
    assert "\n" not in str(error.value)
