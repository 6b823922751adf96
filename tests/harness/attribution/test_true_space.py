"""Distances in the true scene."""

import itertools

import mujoco
import numpy as np
import pytest

from wayproof.harness.attribution.true_space import TrueSpace

SCENE = """<mujoco><size nuser_geom="1"/><worldbody>
<geom name="floor" type="plane" size="5 5 0.1" user="1"/>
<geom name="crate" type="box" pos="2 0 0.5" size="0.5 0.5 0.5" user="4"/>
<body name="robot_base" pos="0 0 0.5"><freejoint/><geom size="0.25" group="3"/></body>
</worldbody></mujoco>"""


def test_true_space_measures_the_scene():
    space = TrueSpace(SCENE)
    distance, name = space.distance(np.array([1.0, 0.0, 0.9]))
    assert (distance, name) == (pytest.approx(0.5, abs=1e-5), "crate")
    assert space.body_clearance("crate") == pytest.approx(1.25)  # from 0.25 to 1.5
    space.place_robot(np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert space.body_clearance("crate") == pytest.approx(0.25)
    place, name = space.body_contact(flies=False)
    np.testing.assert_allclose(place, [1.5, 0.0, 0.5], atol=1e-6)
    occupied = space.occupied(np.array([1.0, -1.0, 0.0]), (20, 20, 10), 0.1)
    assert occupied.sum() == 1000  # one cubic metre
    assert occupied[5:15, 5:15].all()


def scene_with(geoms):
    return TrueSpace(
        SCENE.replace(
            '<geom name="crate" type="box" pos="2 0 0.5" size="0.5 0.5 0.5" user="4"/>', geoms
        )
    )


CELL = 0.1


def cells_of(geom):
    """Return the indices of the cells (n, 3) that a geom is in, of a grid about the origin."""
    return np.argwhere(scene_with(geom).occupied(np.full(3, -0.5), (10, 10, 10), CELL))


@pytest.mark.parametrize("thickness", [0.0005, 0.001, 0.01, 0.03])
@pytest.mark.parametrize("kind", ["box", "cylinder", "capsule", "ellipsoid"])
def test_a_thin_thing_is_in_a_cell_wherever_it_stands(kind, thickness):
    """Walls of half a millimetre, cables and posts, on sides and corners of cells and within."""
    half = 0.5 * thickness
    size = {"box": f"{half} 2 2", "ellipsoid": f"{half} 2 2"}.get(kind, f"{half} 2")
    for x in (0.0, 0.025, 0.05, 0.0999):
        found = cells_of(f'<geom type="{kind}" pos="{x} {x} 0" size="{size}" user="2"/>')
        assert len(np.unique(found[:, 2])) == 10  # from the bottom to the top
        if kind == "box":
            assert len(np.unique(found[:, 1])) == 10


@pytest.mark.parametrize("turn", range(0, 180, 30))
def test_cells_of_a_turned_box_are_those_that_it_is_within_no_distance_of(turn):
    box = f'type="box" size="0.21 0.13 0.02" euler="{turn} 17 {turn / 2}" user="2"'
    found = {tuple(cell) for cell in cells_of(f"<geom {box}/>").tolist()}
    probe = '<geom name="cell" type="box" size="0.05 0.05 0.05" user="2"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><size nuser_geom="1"/><worldbody><geom {box}/>{probe}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for cell in itertools.product(range(10), repeat=3):
        data.geom_xpos[1] = -0.5 + (np.array(cell) + 0.5) * CELL
        gap = mujoco.mj_geomDistance(model, data, 0, 1, 1.0, np.zeros(6))
        assert (gap < 0.0) == (cell in found) or abs(gap) < 1e-4


def test_a_wall_on_the_side_of_a_cell_is_not_in_the_next_one():
    found = cells_of('<geom type="box" pos="0.05 0 0" size="0.05 2 2" user="2"/>')
    assert set(found[:, 0].tolist()) == {5}


@pytest.mark.parametrize("robot", ["stands", "hangs"])
def test_what_is_of_class_floor_is_in_the_cells_that_it_stands_in(robot):
    """A ramp, a step or a deck is a thing; the plane or field that everything stands on is not."""
    height = 0.085 if robot == "stands" else 0.3
    step = f'<geom type="box" pos="0 0 {height}" size="0.3 0.3 0.085" user="1"/>'
    found = cells_of(step)
    assert len(found)
    space = scene_with(step)
    heights = space.terrain(np.array([[0.0, 0.0], [0.45, 0.0]]), climbed=True)
    np.testing.assert_allclose(heights, [height + 0.085, 0.0], atol=1e-9)
    assert space.terrain(np.zeros((1, 2))) is None
