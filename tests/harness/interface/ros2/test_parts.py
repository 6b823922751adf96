"""Parts of a ROS 2 stack by themselves: options, pace, task, discovery, grids."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.maps.costmap.test_costmap import BODY, FLOOR, HIGH, LOW, StateArray
from wayproof import Config, build
from wayproof.harness.errors import InputError
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.ros2.discovery import mismatch
from wayproof.harness.interface.ros2.grids import costmap_grid, map_grid
from wayproof.harness.interface.ros2.inputs import Received
from wayproof.harness.interface.ros2.messages import (
    Clock,
    LaserScan,
    OccupancyGrid,
    Time,
    Twist,
    TwistStamped,
)
from wayproof.harness.interface.ros2.node import Endpoint
from wayproof.harness.interface.ros2.options import Options, parse
from wayproof.harness.interface.ros2.pace import Unexpected, answer_to, made_after, ticks_up_to
from wayproof.harness.interface.ros2.task import read_task, write_task
from wayproof.harness.interface.types import Velocity
from wayproof.harness.scenario.scenario import sensor_info
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig


def test_without_options_the_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert parse("ros2") == Options()
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert parse("ros2:map=").domain == 7
    options = parse("ros2:domain=5,pace=lockstep,controller_frequency=50,silence=0.5")
    assert (options.domain, options.pace) == (5, "lockstep")
    assert (options.controller_frequency, options.silence) == (50.0, 0.5)


@pytest.mark.parametrize(
    ("text", "topic", "name"),
    [
        ("", "cmd_vel", "/cmd_vel"),
        ("", "local_costmap/costmap", "/local_costmap/costmap"),
        ("namespace=/robot1", "tf", "/robot1/tf"),
        ("namespace=/robot1", "clock", "/clock"),  # one for all
        ("namespace=/robot1,cmd_vel=/my_cmd", "cmd_vel", "/my_cmd"),
        ("namespace=/robot1,/scan=front/scan", "scan", "/robot1/front/scan"),
        ("namespace=/robot1,map=", "map", ""),
        ("namespace=/robot1,points=front/points", "points/ranges", "/robot1/front/points/ranges"),
        ("depth/image=", "depth/image/ranges", ""),
        ("namespace=/robot1", "altimeter/ranges", "/robot1/altimeter/ranges"),
        ("points/ranges=", "points/ranges", ""),
    ],
)
def test_topics_are_those_of_nav2_or_as_named_in_a_namespace(text, topic, name):
    assert parse(f"ros2:{text}" if text else "ros2").topic(topic) == name


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


def received(stamp_ns, sent_ns=0):
    return Received(Velocity(0.1), stamp_ns, sent_ns, publisher=1)


def test_in_lockstep_the_stamp_of_the_sweep_is_the_answer():
    old, new = received(100), received(200)
    assert answer_to(200, [old, new]) is new
    assert answer_to(200, [old]) is None
    assert answer_to(200, []) is None


@pytest.mark.parametrize(("one", "words"), [(None, "no stamp"), (201, "stamp 0.000000201 s")])
def test_in_lockstep_a_command_of_its_own_time_is_refused(one, words):
    with pytest.raises(Unexpected, match=words):
        answer_to(200, [received(100), received(one)])


def test_of_a_controller_the_first_command_after_the_clock_counts():
    late, first, second = received(201), received(251), received(260)
    assert made_after(201, 0, [late, first, second]) is first
    assert made_after(201, 0, [late]) is None


def test_a_command_without_a_stamp_counts_by_when_it_was_sent():
    before, after = received(None, sent_ns=999), received(None, sent_ns=1000)
    assert made_after(201, 1000, [before, after]) is after
    assert made_after(201, 1000, [before]) is None


def test_controller_periods_end_up_to_the_sweep_and_with_it():
    assert ticks_up_to(200, 100, 50) == [150, 200]
    assert ticks_up_to(199, 100, 50) == [150]
    assert ticks_up_to(100, 100, 50) == []
    assert ticks_up_to(230, 100, 40) == [140, 180, 220]


@pytest.fixture(scope="module")
def task():
    config = Config("office", "drone", 3)
    scenario = build(config)
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    return task_of(config, scenario.mission, {info.name: info for info in infos})


def test_every_number_comes_back_bit_by_bit(task):
    read = read_task(write_task(task, 1_100_000_000))
    assert (read.start_ns, read.robot, read.mission) == (1_100_000_000, "drone", task.mission)
    assert list(read.sensors) == list(task.sensors)
    for name, sensor in task.sensors.items():
        assert read.sensors[name].info == sensor.info


def test_it_does_not_hold_the_settings(task):
    assert set(json.loads(write_task(task, 0))) == {"start_ns", "robot", "mission", "sensors"}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("start_ns", 1.5),
        ("start_ns", 10**30),
        ("robot", None),
        ("mission", {}),
        ("mission", [1]),
        ("sensors", 3),
        ("sensors", [{"nonsense": 1}]),
        ("sensors", [{"name": "lidar"}]),
        ("sensors", [{"name": "lidar", "order": "grid", "beams": 10**9, "row_width": 2}]),
    ],
)
def test_another_text_is_refused(task, key, value):
    parts = json.loads(write_task(task, 0))
    with pytest.raises(InputError):
        read_task(json.dumps({**parts, key: value}))


@pytest.mark.parametrize("text", ["", "{}", "[1]", "[" * 100_000, "NaN", '{"start_ns": 1e999}'])
def test_a_text_of_anything_is_refused(text):
    with pytest.raises(InputError):
        read_task(text)


PUBLISHERS = [
    SimpleNamespace(topic="/scan", kind=LaserScan, latched=False),
    SimpleNamespace(topic="/clock", kind=Clock, latched=False),
]
SUBSCRIPTIONS = [
    SimpleNamespace(topic="/cmd_vel", kind=Twist, latched=False),
    SimpleNamespace(topic="/cmd_vel", kind=TwistStamped, latched=False),
    SimpleNamespace(topic="/local_costmap/costmap", kind=OccupancyGrid, latched=True),
]
STAMPED, GRID = "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/OccupancyGrid"
SCAN, COSTMAP = "sensor_msgs/msg/LaserScan", "/local_costmap/costmap"


def found(publications=(), subscriptions=()):
    return mismatch(publications, subscriptions, PUBLISHERS, SUBSCRIPTIONS)


def test_what_fits_is_no_mismatch():
    theirs = [Endpoint("/cmd_vel", STAMPED, True, False), Endpoint(COSTMAP, GRID, True, True)]
    best_effort, other = Endpoint("/scan", SCAN, False, False), Endpoint("/x", "a", False, True)
    assert found([*theirs, other], [best_effort, other]) == ""


@pytest.mark.parametrize(
    ("topic", "kind", "reliable", "latched", "line"),
    [
        ("/clock", "rosgraph_msgs/msg/Clock", True, False,
         "published by another simulator or episode in this domain, too"),
        ("/cmd_vel", "geometry_msgs/msg/Pose", True, False,
         "published as geometry_msgs/msg/Pose, expected geometry_msgs/msg/Twist or "
         "geometry_msgs/msg/TwistStamped"),
        ("/cmd_vel", STAMPED, False, False,
         "published with best effort reliability, expected reliable"),
        (COSTMAP, GRID, True, False,
         "published with volatile durability, expected transient local"),
        ("/scan", "sensor_msgs/msg/PointCloud2", True, False,
         f"subscribed as sensor_msgs/msg/PointCloud2, expected {SCAN}"),
        ("/scan", SCAN, True, True,
         "subscribed with transient local durability, expected volatile"),
    ],
)  # fmt: skip
def test_what_cannot_be_heard_is_named(topic, kind, reliable, latched, line):
    endpoint = Endpoint(topic, kind, reliable, latched)
    theirs = ((), [endpoint]) if line.startswith("subscribed") else ([endpoint], ())
    assert found(*theirs) == f"{topic} is {line}"


RADIUS = 0.2


@pytest.fixture
def costmap():
    """A floor of 30 x 20 cells, free above, with a post at (10, 5) and the right part unknown."""
    states = np.full((30, 20, 15), UNKNOWN, np.uint8)
    states[:, :, FLOOR] = OCCUPIED
    states[:, :, FLOOR + 1 :] = FREE
    states[10, 5, BODY] = OCCUPIED
    states[25:] = UNKNOWN
    config = CostmapConfig(localization_margin=0.0)
    made = Costmap(config, StateArray(states), LOW, HIGH, "ground", RADIUS, 0.4, 0.15)
    assert made.state[10, 5, 0] == OCCUPIED
    return made


def cells(grid):
    return grid.data.reshape(grid.info.height, grid.info.width)


def test_the_map_has_three_values_and_its_rows_run_along_x(costmap):
    grid = map_grid(costmap, "map", Time(3, 0))
    assert (grid.info.width, grid.info.height) == costmap.shape[:2]
    assert grid.header.frame_id == "map"
    corner = grid.info.origin.position
    assert (corner.x, corner.y) == pytest.approx(tuple(costmap.origin[:2]))
    assert cells(grid)[5, 10] == 100
    assert cells(grid)[5, 3] == 0
    assert (cells(grid)[:, 25:30] == -1).all()
    assert set(np.unique(grid.data)) == {-1, 0, 100}


def test_costs_are_scaled_as_nav2_publishes_them(costmap):
    grid = cells(costmap_grid(costmap, "map", Time(3, 0)))
    assert grid[5, 10] == 100
    assert grid[5, 11] == grid[5, 9] == 99  # the body collides there
    assert (grid[:, 25:30] == -1).all()
    away = grid[12, 10:20]
    assert ((away >= 0) & (away < 99)).all()
    cost = costmap.cost_table[costmap.obstacle_clearance[10, 9, 0]]
    assert math.isfinite(cost)
    assert grid[9, 10] == math.floor(1 + 97 * (cost - 1) / 251)
