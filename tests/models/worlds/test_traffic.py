"""Movers by hand-computed times and places, and their contacts in the ground truth."""

from dataclasses import replace
from itertools import pairwise
from math import inf, pi

import mujoco
import numpy as np
import pytest

from tests.models.watching import watch
from wayproof.models.robots import ROBOTS
from wayproof.models.scene import compose
from wayproof.models.truth import REST_WINDOW, Truth
from wayproof.models.worlds import (
    WORLDS,
    Box,
    Mover,
    Traffic,
    World,
    with_traffic,
)
from wayproof.models.worlds.movers import ASIDE_DISTANCE
from wayproof.models.worlds.pedestrians import PERSON
from wayproof.models.worlds.solvability import GROUND_BAND, shortest_path

STEP_NS = 2_000_000
SECOND = 1_000_000_000


def walker(**fields):
    route = fields.pop("route", ((2.0, 0.0, 0.0), (2.0, 4.0, 0.0)))
    return Mover("walker", PERSON, route, **{"speed": 1.0, **fields})


def hall(*movers):
    return World(
        name="hall", seed=0, low=(-5.0, -5.0, -0.5), high=(5.0, 5.0, 3.0), solids=(),
        start=(0.0, 0.0, 0.0), start_heading=0.0, goal=(4.0, 0.0, 0.0), movers=movers,
    )  # fmt: skip


class Stage:
    """A drone held where a test puts it, and the movers about it."""

    def __init__(self, *movers, robot=(0.0, 0.0, 1.0)):
        self.scene = compose(hall(*movers), ROBOTS["drone"])
        self.data = mujoco.MjData(self.scene.model)
        self.traffic = Traffic(self.scene.model, movers, self.scene.base, radius=0.36)
        self.truth = Truth(self.scene.model, self.scene.base, self.scene.floor)
        self.time_ns = 0
        self.put(robot)
        self.traffic.advance(self.data, 0, 0)

    def put(self, robot):
        self.data.qpos[:3] = robot
        self.data.qpos[3:7] = 1.0, 0.0, 0.0, 0.0

    def run(self, seconds, velocity=(0.0, 0.0, 0.0)):
        for _ in range(round(seconds * SECOND / STEP_NS)):
            self.data.qpos[:3] += np.multiply(velocity, STEP_NS * 1e-9)
            mujoco.mj_kinematics(self.scene.model, self.data)
            mujoco.mj_collision(self.scene.model, self.data)
            watch(self.truth, self.data, self.scene.base)
            self.time_ns += STEP_NS
            self.traffic.advance(self.data, self.time_ns, STEP_NS)

    def position(self):
        return self.data.mocap_pos[0].tolist()


def test_a_walker_goes_to_and_fro():
    mover = walker(begin=1.0)
    assert mover.length == 4.0
    north, south = pi / 2, -pi / 2
    for seconds, y, heading in ((0, 1.0, north), (2, 3.0, north), (5, 2.0, south), (8, 1.0, north)):
        place = mover.place(seconds * SECOND)
        assert place.position == pytest.approx((2.0, y, 0.0))
        assert place.heading == place.yaw == pytest.approx(heading)


def test_a_vehicle_backs_up_and_a_one_way_mover_stays_at_its_end():
    truck = walker(backs_up=True)
    back = truck.place(5 * SECOND)
    assert back.position == pytest.approx((2.0, 3.0, 0.0))
    assert (back.yaw, back.heading) == pytest.approx((pi / 2, -pi / 2))
    assert walker(returns=False).place(60 * SECOND).position == (2.0, 4.0, 0.0)


def test_corners_are_turned():
    bent = walker(route=((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 2.0, 0.0)))
    assert bent.place(4 * SECOND).position == pytest.approx((3.0, 1.0, 0.0))
    assert bent.place(4 * SECOND).yaw == pytest.approx(pi / 2)


@pytest.mark.parametrize(("fields", "said"), [
    ({"times": (0.0,)}, "times: expected one for each point"),
    ({"times": (0.0, 0.0)}, "increasing from 0"),
    ({"times": (1.0, 2.0)}, "increasing from 0"),
    ({"times": (0.0, inf)}, "times: expected finite ones"),
    ({"times": (0.0, 1.0), "speed": 1.0}, "neither speed nor begin"),
    ({"loops": True}, "loops: expected a route that ends where it begins"),
])  # fmt: skip
def test_a_timetable_that_none_can_keep_is_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        walker(**{"speed": 0.0, **fields})


def test_one_that_stands_for_a_robot_is_late_from_then_on():
    """It waits at 2.21 m for the 2 s for which the robot is there."""
    stage = Stage(walker(speed=0.0, times=(0.0, 4.0), returns=False), robot=(2.0, 3.62, 1.0))
    stage.run(4.21)
    waited = stage.position()[1]
    assert waited == pytest.approx(3.62 - 0.8 - 0.36 - 0.25, abs=0.003)
    stage.put((0.0, 0.0, 1.0))
    stage.run(1.0)
    assert stage.position()[1] == pytest.approx(waited + 1.0, abs=0.003)


def test_the_simulation_follows_the_timetable_to_the_bit():
    stage = Stage(walker())
    stage.run(1.5)
    assert stage.position() == list(walker().place(1_500_000_000).position)
    again = Stage(walker())
    again.run(1.5)
    assert again.position() == stage.position()


def test_a_person_that_looks_stops_before_a_robot_and_another_goes_on():
    """Radius 0.36 m and a person of 0.25 m: centres 0.8 + 0.61 m apart at the end."""
    looking = Stage(walker(stands_off=0.8), robot=(2.0, 3.0, 1.0))
    looking.run(4.0)
    assert looking.position()[1] == pytest.approx(3.0 - 0.8 - 0.36 - 0.25, abs=0.003)
    assert looking.truth.hits_by_movers == looking.truth.collisions == 0
    looking.put((0.0, 3.0, 1.0))
    looking.run(1.0)
    assert looking.position()[1] == pytest.approx(1.59 + 1.0, abs=0.006)


def test_a_robot_aside_or_behind_is_not_in_the_way():
    aside = Stage(walker(), robot=(2.0 + 0.36 + 0.25 + ASIDE_DISTANCE + 0.01, 1.0, 1.0))
    aside.run(2.0)
    assert aside.position()[1] == pytest.approx(2.0)
    behind = Stage(walker(begin=1.0), robot=(2.0, 0.0, 1.0))
    behind.run(1.0)
    assert behind.position()[1] == pytest.approx(2.0)


def test_a_mover_hits_a_robot_at_rest_and_one_in_motion_collides():
    at_rest = Stage(walker(stands_off=0.0), robot=(2.0, 2.0, 1.0))
    at_rest.run(2.2)
    assert (at_rest.truth.hits_by_movers, at_rest.truth.collisions) == (1, 0)
    assert at_rest.truth.touched == "walker"
    moving = Stage(walker(stands_off=0.0, speed=0.0), robot=(0.0, 0.0, 1.0))
    moving.run(2.2, velocity=(1.0, 0.0, 0.0))
    assert (moving.truth.hits_by_movers, moving.truth.collisions) == (0, 1)
    assert moving.truth.touched == "walker"


def test_a_wall_hits_no_robot_at_rest():
    world = replace(hall(), solids=(Box.between((0.2, -1.0, 0.0), (1.0, 1.0, 2.0), "wall"),))
    scene = compose(world, ROBOTS["drone"])
    data = mujoco.MjData(scene.model)
    data.qpos[:3] = 0.0, 0.0, 1.0
    truth = Truth(scene.model, scene.base, scene.floor)
    for _ in range(3):
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_collision(scene.model, data)
        watch(truth, data, scene.base)
    assert (truth.hits_by_movers, truth.collisions, truth.touched) == (0, 1, "an obstacle")


@pytest.mark.parametrize("steps", [0, 3, 100, 101, 102, 250])
def test_the_latest_positions_are_returned_in_order_and_restored(steps):
    scene = compose(hall(), ROBOTS["drone"])
    data = mujoco.MjData(scene.model)
    truth, other = (Truth(scene.model, scene.base, scene.floor) for _ in range(2))
    window = round(REST_WINDOW / scene.model.opt.timestep) + 1
    assert window == 101
    walked = np.random.default_rng(0).normal(size=(steps + 60, 3))
    for n, place in enumerate(walked):
        if n == steps:
            other.restore(truth.state())
        data.xpos[scene.base] = place
        for one in (truth, other)[: 1 + (n >= steps)]:
            watch(one, data, scene.base)
        np.testing.assert_array_equal(truth.state()["places"], walked[: n + 1][-window:])
    np.testing.assert_array_equal(other.state()["places"], truth.state()["places"])
    assert other._speed() == truth._speed() > 0.0


@pytest.mark.parametrize("shape", [(4, 1), (4,), (102, 3), (2, 3, 1)])
def test_positions_of_a_bad_shape_are_refused(shape):
    scene = compose(hall(), ROBOTS["drone"])
    truth = Truth(scene.model, scene.base, scene.floor)
    with pytest.raises(ValueError, match="places: got"):
        truth.restore({**truth.state(), "places": np.zeros(shape)})


def test_clearance_counts_movers_and_forgets_the_vanished():
    stage = Stage(walker(speed=0.0, route=((1.5, 0.0, 0.0),), vanishes=1.0))
    stage.run(0.5)
    near = stage.truth.clearance(stage.data)
    assert 1.5 - 0.25 - 0.40 < near < 1.5 - 0.25 - 0.1
    stage.run(1.0)
    mujoco.mj_kinematics(stage.scene.model, stage.data)
    assert stage.truth.clearance(stage.data) == 2.0  # the limit: nothing else is there
    assert stage.traffic.states()[0].present is False


def test_things_appear_when_due_and_never_on_a_robot():
    ghost = Mover("ghost", PERSON, ((0.0, 0.0, 0.0),), appears=1.0, vanishes=5.0)
    stage = Stage(ghost)
    stage.run(2.0)
    assert stage.traffic.present == [False]  # the robot stands there
    stage.put((3.0, 0.0, 1.0))
    stage.run(0.1)
    assert stage.traffic.present == [True]
    assert stage.position() == [0.0, 0.0, 0.0]
    stage.run(3.0)
    assert stage.traffic.present == [False]
    early = Stage(Mover("ghost", PERSON, ((4.0, 0.0, 0.0),), appears=1.0))
    early.run(0.9)
    assert early.traffic.present == [False]
    early.run(0.2)
    assert early.traffic.present == [True]


@pytest.mark.parametrize("name", ["crossing", "ghosts"])
def test_worlds_with_movers_compile_and_repeat(name):
    world = WORLDS[name](5, 1.0)
    assert len(world.movers) >= 8
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    assert model.nmocap == len(world.movers)
    for mover in world.movers:
        assert model.body(mover.name).mocapid[0] >= 0
    assert WORLDS[name](5, 1.0).movers == world.movers


@pytest.mark.parametrize("name", ["office", "crossing"])
def test_traffic_crosses_the_way_through_free_space(name):
    bare = WORLDS[name](2)
    world = with_traffic(bare, count=3, speed=0.8, seed=4)
    assert with_traffic(bare, count=3, speed=0.8, seed=4) == world
    people = world.movers[len(bare.movers) :]
    assert 1 <= len(people) <= 3
    assert world.solids == bare.solids
    for person in people:
        assert person.length >= 2.0
        points = [person.place(i * SECOND // 4).position for i in range(60)]
        floor = [(x, y, 1.0) for x, y, _ in points]
        for solid in bare.solids:
            assert solid.distance(floor).min() > 0.25
        assert np.less_equal(bare.low, points).all()
        assert np.less_equal(points, bare.high).all()
        tail, head = (np.array(point[:2]) for point in person.route)
        line = tail + np.linspace(0.0, 1.0, 200)[:, None] * (head - tail)
        way = shortest_path(bare, 0.75, GROUND_BAND, bare.start, bare.goal)
        legs = [a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a) for a, b in pairwise(way)]
        gap = np.linalg.norm(line[:, None] - np.concatenate(legs)[None], axis=2).min()
        assert gap < 0.1  # the two lines meet


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: walker(speed=-1.0), "speed: got -1"),
        (lambda: walker(appears=2.0, vanishes=1.0), "vanishes: got 1"),
        (lambda: walker(route=((0.0, 0.0, 0.0),) * 2), "route: got the same point"),
        (lambda: walker(begin=inf), "begin: got inf"),
        (lambda: Mover("x", (), ((0.0, 0.0, 0.0),)), "mover 'x': expected at least one solid"),
        (lambda: hall(walker(), walker()), "movers: got one name twice"),
        (lambda: with_traffic(hall(), -1, 1.0, 0), "count, speed: got -1"),
    ],
)
def test_bad_movers_are_refused_in_one_line(make, said):
    with pytest.raises(ValueError, match=said):
        make()
