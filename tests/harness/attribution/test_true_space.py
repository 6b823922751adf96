"""Distances in the true scene."""

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
    assert space.body_clearance() == pytest.approx(1.25)  # from 0.25 to 1.5
    space.place_robot(np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert space.body_clearance("crate") == pytest.approx(0.25)
    place, name = space.body_contact()
    np.testing.assert_allclose(place, [1.5, 0.0, 0.5], atol=1e-6)
    occupied = space.occupied(np.array([1.0, -1.0, 0.0]), (20, 20, 10), 0.1)
    assert occupied.sum() == 1000  # one cubic metre
    assert occupied[5:15, 5:15].all()
    assert not space.moves("crate")
