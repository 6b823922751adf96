import mujoco
import numpy as np
import pytest

from wayproof.harness.bench.raycast.scenes import RELIEF, clutter, field_terrain, mesh_terrain


def test_clutter_has_the_asked_geoms_and_movers():
    model = mujoco.MjModel.from_xml_string(clutter(23, moving=7, seed=5))
    assert (model.ngeom, model.nmocap) == (24, 7)
    kinds, counts = np.unique(model.geom_type[1:], return_counts=True)
    assert len(kinds) == 5
    assert sorted(counts) == [4, 4, 5, 5, 5]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert np.hypot(*data.geom_xpos[1:, :2].T).min() >= 2.0
    assert (model.geom_bodyid[:17] == 0).all()  # the floor and what stands, in the world body
    assert (model.body_mocapid[model.geom_bodyid[17:]] >= 0).all()


def test_clutter_is_its_seeds_alone():
    assert clutter(9, seed=1) == clutter(9, seed=1)
    assert clutter(9, seed=1) != clutter(9, seed=2)


def test_no_more_movers_than_geoms():
    with pytest.raises(ValueError, match="moving: got 3, expected 0 to 2"):
        clutter(2, moving=3)


@pytest.mark.parametrize(("make", "points"), [(mesh_terrain, 72), (field_terrain, 300)])
def test_terrain_is_ground_below_the_sensor(make, points):
    model = mujoco.MjModel.from_xml_string(make(points, moving=3, seed=2))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if make is mesh_terrain:
        assert model.nmeshface == 2 * 71 * 71
    else:
        assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (300, 300)
    assert model.nmocap == 3
    rng, geom = np.random.default_rng(0), np.zeros(1, np.int32)
    heights = []
    for _ in range(200):
        above = np.array([*rng.uniform(-19.0, 19.0, 2), 5.0])
        down = np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(model, data, above, down, None, 1, -1, geom)
        if geom[0] == 0:
            heights.append(5.0 - distance)
    assert -RELIEF - 1e-6 <= min(heights) < -0.7 * RELIEF
    assert -0.3 * RELIEF < max(heights) <= 1e-6


def test_both_terrains_are_the_same_ground():
    """Where their samples lie, the mesh and the field are one surface."""
    down, geom, found = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32), []
    for make in (mesh_terrain, field_terrain):
        model = mujoco.MjModel.from_xml_string(make(41, seed=3))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        places = [(x + 1e-4, y + 2e-4, 5.0) for x in (-7.0, 0.0, 12.0) for y in (-15.0, 3.0)]
        found.append(
            [mujoco.mj_ray(model, data, np.array(p), down, None, 1, -1, geom) for p in places]
        )
    np.testing.assert_allclose(*found, atol=2e-3)
