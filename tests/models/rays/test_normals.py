"""Surface normals where rays hit, against MuJoCo's own and by hand."""

import mujoco
import numpy as np
import pytest

from wayproof.models.rays import TileCaster, cut_scattered

ALL = np.ones(mujoco.mjNGROUP, np.uint8)
HEAD = """
<asset>
  <mesh name="wedge" vertex="0 0 0  1 0 0  0 1.2 0  0.1 0.2 0.9  0.6 0.7 0.5"/>
  <mesh name="mirrored" vertex="0 0 0  1 0 0  0 1 0  0 0 1" scale="0.5 2 -1"/>
  <hfield name="hills" nrow="3" ncol="4" size="1 1.5 0.6 0.2"
          elevation="0 1 2 1  1 3 0 1  0 0 2 4"/>
</asset>
"""
SHAPES = {
    "plane": 'type="plane" size="1 1 1"',
    "sphere": 'type="sphere" size="0.7"',
    "capsule": 'type="capsule" size="0.4 0.6"',
    "ellipsoid": 'type="ellipsoid" size="0.4 0.9 0.6"',
    "cylinder": 'type="cylinder" size="0.5 0.6"',
    "box": 'type="box" size="0.4 0.9 0.6"',
    "mesh": 'type="mesh" mesh="wedge"',
    "mirrored": 'type="mesh" mesh="mirrored"',
    "hfield": 'type="hfield" hfield="hills"',
}


def posed(geom):
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{HEAD}<worldbody>{geom}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def cast(model, data, origins, directions):
    """Distances, geom ids and normals of world rays, each from an origin of its own."""
    pattern = cut_scattered(directions, np.arange(len(origins), dtype=np.int32))
    return TileCaster(model, ALL, 20.0).cast_with_normals(data, pattern, origins, np.eye(3))


@pytest.mark.parametrize("reach", [0.1, 3.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_normals_as_mujoco_reports_them(shape, reach):
    """From afar and from inside, where a normal still points out of the solid."""
    rng = np.random.default_rng(len(shape))
    model, data = posed(f'<geom {SHAPES[shape]} pos="1 2 -1" quat="0.7 0.1 -0.4 0.5"/>')
    origins = data.geom_xpos + reach * rng.normal(size=(600, 3))
    directions = data.geom_xpos - origins + 0.4 * rng.normal(size=(600, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, ids, normals = cast(model, data, origins, directions)
    expected = np.empty(3)
    for ray in range(600):
        mujoco.mj_ray(
            model, data, origins[ray], directions[ray], ALL, 1, -1, np.zeros(1, np.int32), expected
        )
        np.testing.assert_allclose(normals[ray], expected, rtol=0.0, atol=1e-9)
    assert (ids == 0).sum() > 100
    behind = np.einsum("ni,ni->n", normals, directions)[ids == 0] > 0.0
    assert behind.any() or shape == "plane" or reach > 1.0


@pytest.mark.parametrize(
    ("geom", "origin", "direction", "expected"),
    [
        ('type="plane" size="1 1 1"', (0, 0, 1), (0.6, 0, -0.8), (0, 0, 1)),
        ('type="box" size="1 1 1"', (0, 0, 0), (0, -1, 0), (0, -1, 0)),  # from inside: out
        ('type="box" size="1 1 1"', (-3, 0.5, 0), (1, 0, 0), (-1, 0, 0)),
        ('type="sphere" size="1"', (0, 0, 0), (0, 0.6, 0.8), (0, 0.6, 0.8)),
        ('type="capsule" size="1 1"', (0.6, 0, 5), (0, 0, -1), (0.6, 0, 0.8)),
        ('type="capsule" size="1 1"', (5, 0, 0.5), (-1, 0, 0), (1, 0, 0)),
        ('type="cylinder" size="1 1"', (0.9, 0, 5), (0, 0, -1), (0, 0, 1)),
        ('type="cylinder" size="1 1"', (0.6, 5, 0.9), (0, -1, 0), (0.6, 0.8, 0)),
        ('type="ellipsoid" size="2 1 1"', (5, 0, 0), (-1, 0, 0), (1, 0, 0)),
        ('type="sphere" size="1"', (5, 5, 5), (0, 0, 1), (0, 0, 0)),  # a miss
    ],
)
def test_normals_by_hand(geom, origin, direction, expected):
    model, data = posed(f"<geom {geom}/>")
    rays = np.array([origin], float), np.array([direction], float)
    normals = cast(model, data, *rays)[2]
    np.testing.assert_allclose(normals[0], expected, rtol=0.0, atol=1e-12)


def test_a_slope_by_hand():
    """Rising by 1 m over 2 m along x: the normal leans back by as much."""
    spec = mujoco.MjSpec()
    field = spec.add_hfield(name="ramp", nrow=2, ncol=2, size=[1.0, 1.0, 1.0, 0.5])
    field.userdata = [0.0, 1.0, 0.0, 1.0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ramp")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    origins = np.array([[0.3, 0.1, 3.0], [3.0, 0.1, 0.4], [0.1, -3.0, -0.2]])
    directions = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    normals = cast(model, data, origins, directions)[2]
    slope = np.array([-1.0, 0.0, 2.0]) / np.sqrt(5.0)
    np.testing.assert_allclose(normals, [slope, [1, 0, 0], [0, -1, 0]], rtol=0.0, atol=1e-12)
