from dataclasses import replace
from math import acos, asin, hypot, pi, sqrt

import mujoco
import numpy as np
import pytest
from scipy import ndimage

from tests.models.drawn_worlds import drawn
from wayproof.models.worlds import WORLDS, is_solvable, shortest_path_length
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.solvability import (
    AIR_BANDS,
    GROUND_BAND,
    REFERENCE_RADIUS,
    number_regions,
)
from wayproof.models.worlds.world import World

WAREHOUSES = range(0, 400, 50)


def room(*boxes: Box) -> World:
    """A 10 x 6 m area without walls, start and goal 6 m apart along its middle."""
    return World(
        name="room",
        seed=0,
        low=(0.0, 0.0, -0.5),
        high=(10.0, 6.0, 3.0),
        solids=boxes,
        start=(2.025, 3.025, 0.0),
        start_heading=0.0,
        goal=(8.025, 3.025, 0.0),
    )


@pytest.mark.parametrize("shape", [(40, 30), (1, 6), (6, 1)])
@pytest.mark.parametrize("number", [number_regions, number_regions.py_func])
def test_regions_are_numbered_as_scipy_does(shape, number):
    for share in (0.3, 0.5, 0.9):
        free = np.random.default_rng(8).random(shape) < share
        labels = np.zeros(shape, np.int32)
        count = number(free, labels, np.empty(free.size, np.int64))
        expected, expected_count = ndimage.label(free, np.ones((3, 3)))
        assert count == expected_count
        np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize("name", ["warehouse", "corridor", "empty"])
def test_mjcf_compiles_to_the_boxes(name):
    world = drawn(name, 3)
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert model.ngeom == len(world.solids) + 1
    assert model.geom("floor").friction[0] == 0.8
    assert model.opt.timestep == 0.002
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.vis.map.znear == np.float32(0.001)
    for box, box_name in zip(world.solids, world.solid_names, strict=True):
        geom = model.geom(box_name)
        assert geom.bodyid == 0
        assert (geom.group, geom.contype, geom.conaffinity) == (0, 1, 1)
        np.testing.assert_allclose(data.geom(box_name).xpos, box.centre, atol=1e-9)
        np.testing.assert_allclose(geom.size, box.half_extents, atol=1e-9)
        x_axis = data.geom(box_name).xmat.reshape(3, 3)[:, 0]
        np.testing.assert_allclose(x_axis[:2], [np.cos(box.yaw), np.sin(box.yaw)], atol=1e-8)


@pytest.mark.parametrize("name", WORLDS)
def test_ends_have_room_and_lie_inside(name):
    for seed in range(2):
        world = drawn(name, seed)
        for point in (world.start, world.goal):
            assert world.contains_obstacle((*point[:2], 0.3), 0.9) is None
            assert is_solvable(world, 0.9, (0.0, 2.5), point, point)


@pytest.mark.parametrize("name", WORLDS)
def test_walls_close_every_world(name):
    world = drawn(name, 1)
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = np.zeros(1, np.int32)
    for angle in np.linspace(0.0, 2.0 * pi, 90):
        for height in (0.01, 1.0, 2.9):
            origin = np.array([*world.start[:2], height])
            beam = np.array([np.cos(angle), np.sin(angle), 0.0])
            length = mujoco.mj_ray(model, data, origin, beam, None, 1, -1, geom)
            assert length > 0.0
            end = origin + length * beam
            assert np.all(end >= world.low)
            assert np.all(end <= world.high)


@pytest.mark.parametrize("seed", WAREHOUSES)
def test_the_warehouse_has_the_documented_size_and_ends(seed):
    world = drawn("warehouse", seed)
    ends = (world.start, world.goal)
    assert is_solvable(world, REFERENCE_RADIUS, GROUND_BAND, *ends)
    assert any(is_solvable(world, REFERENCE_RADIUS, band, *ends) for band in AIR_BANDS)
    assert 12.0 <= hypot(*np.subtract(world.goal, world.start)[:2]) <= 17.0
    kinds = [box.kind for box in world.solids]
    assert 6 <= kinds.count("crate") <= 12
    beams = [box for box in world.solids if box.kind == "overhang"]
    assert beams
    for beam in beams:
        assert 1.0 <= beam.bottom <= 1.4
        assert 2.5 - beam.top >= 1.2 - 1e-9
    doors = [box for box in world.solids if box.kind == "partition"]
    assert 1.6 - 1e-3 <= 14.0 - 0.4 - sum(2 * door.half_extents[1] for door in doors) <= 1.801


@pytest.mark.parametrize("seed", WAREHOUSES[::4])
def test_the_doorway_is_the_only_way(seed):
    world = drawn("warehouse", seed)
    lintel = next(box for box in world.solids if box.kind == "lintel")
    door = replace(
        lintel,
        centre=(*lintel.centre[:2], 1.5),
        half_extents=(*lintel.half_extents[:2], 1.5),
    )
    shut = replace(world, solids=(*world.solids, door))
    assert not is_solvable(shut, 0.05, GROUND_BAND, world.start, world.goal)


def test_corridor_is_as_wide_as_promised():
    for seed in range(5):
        world = drawn("corridor", seed)
        bare = replace(world, solids=tuple(box for box in world.solids if box.kind != "crate"))
        ends = (world.start, world.goal)
        assert is_solvable(bare, 0.97, GROUND_BAND, *ends)
        assert not is_solvable(bare, 1.2, GROUND_BAND, *ends)
        length = shortest_path_length(bare, 0.97, GROUND_BAND, *ends)
        assert length is not None
        assert 12.0 < length < 14.0  # 16 m less two ends of 1.1 m, corners cut a little


def test_empty_is_a_straight_line():
    world = WORLDS["empty"](5)
    straight = hypot(*np.subtract(world.goal, world.start)[:2])
    assert straight >= 6.0
    length = shortest_path_length(world, 0.5, GROUND_BAND, world.start, world.goal)
    assert length == pytest.approx(straight, abs=1e-9)


def test_the_band_decides_which_solids_are_in_the_way():
    wall = Box.between((5.0, 0.0, 0.6), (5.2, 6.0, 1.2), "wall")
    world = room(wall)
    ends = (world.start, world.goal)
    assert is_solvable(world, 0.3, (0.08, 0.6), *ends)
    assert not is_solvable(world, 0.3, (0.08, 0.61), *ends)
    assert is_solvable(world, 0.3, (1.2, 2.0), *ends)


def test_a_gap_lets_narrower_bodies_through_to_a_cell():
    low = Box.between((5.0, 0.0, 0.0), (5.2, 2.5, 1.0), "wall")
    high = Box.between((5.0, 3.5, 0.0), (5.2, 6.0, 1.0), "wall")
    world = room(low, high)
    assert is_solvable(world, 0.47, (0.1, 0.5), world.start, world.goal)
    assert not is_solvable(world, 0.50, (0.1, 0.5), world.start, world.goal)


def test_shortest_path_round_a_post_is_two_tangents_and_an_arc():
    post = Box((5.025, 3.025, 0.5), (0.001, 0.001, 0.5), 0.0, "pillar")
    world = room(post)
    radius, reach = 1.0, 3.0
    tangents = 2.0 * sqrt(reach**2 - radius**2)
    arc = radius * (pi - 2.0 * acos(radius / reach))
    length = shortest_path_length(world, radius, (0.1, 0.5), world.start, world.goal)
    assert tangents + arc == pytest.approx(2.0 * sqrt(8.0) + 2.0 * asin(1 / 3))
    assert length == pytest.approx(tangents + arc, rel=0.02)


def test_no_path_has_no_length():
    world = room(Box.between((5.0, 0.0, 0.0), (5.2, 6.0, 1.0), "wall"))
    assert shortest_path_length(world, 0.1, (0.1, 0.5), world.start, world.goal) is None
    assert shortest_path_length(world, 0.1, (0.1, 0.5), (5.1, 3.0), world.goal) is None


def test_obstacles_are_named_by_exact_distance():
    near = Box.between((4.0, 3.0, 0.0), (5.0, 4.0, 1.0), "shelf")
    far = Box.between((6.0, 3.0, 0.0), (7.0, 4.0, 1.0), "shelf")
    world = room(near, far)
    assert world.contains_obstacle((5.3, 4.4, 0.5), 0.5 + 1e-12) == "shelf_0"
    assert world.contains_obstacle((5.3, 4.4, 0.5), 0.499) is None
    assert world.contains_obstacle((6.5, 3.5, 1.2), 0.2 + 1e-12) == "shelf_1"
    assert world.contains_obstacle((6.5, 3.5, 0.5), 0.0) == "shelf_1"
    assert room().contains_obstacle((6.5, 3.5, 0.5), 9.0) is None


def test_bad_input_is_refused_in_one_line():
    with pytest.raises(ValueError, match="half_extents: got"):
        Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0), 0.0, "wall")
    with pytest.raises(ValueError, match="goal: got"):
        replace(room(), goal=(11.0, 3.0, 0.0))
    with pytest.raises(ValueError, match="seed: got -1"):
        WORLDS["warehouse"](-1)
    with pytest.raises(ValueError, match="point: got"):
        is_solvable(room(), 0.1, (0.0, 1.0), (-1.0, 3.0), (5.0, 3.0))


def test_a_draft_that_never_opens_ends_in_an_error():
    def closed(rng, difficulty, parameters):
        return room(Box.between((5.0, 0.0, 0.0), (5.2, 6.0, 3.0), "wall"))

    with pytest.raises(RuntimeError, match="world 'closed', seed 0: none of 100 drafts"):
        generated(closed)(0)
