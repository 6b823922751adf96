"""The tile caster against MuJoCo's own rays, shape by shape and scene by scene."""

import mujoco
import numpy as np
import pytest

from tests.models.rays.cast import (
    ALL,
    LIDAR,
    SHAPES,
    by_mj_ray,
    camera,
    directions_of,
    pattern_of,
    posed,
    random_geoms,
    random_rotation,
)
from wayproof.models.rays import TileCaster, cut_grid, cut_scattered, tile_kernels
from wayproof.models.sensors.beams import rotate
from wayproof.models.sensors.caster import MujocoCaster

CAMERA = camera(45, 61, 1.5, 1.2, range=8.0)
SINGLE = cut_grid(np.array([[1.0, 0.0, 0.0]]), 1, 1)
KINDS = {name: int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")) for name in SHAPES}


def facing(direction):
    """A rotation whose x axis is `direction`: it turns SINGLE's beam to it."""
    x = np.asarray(direction, float) / np.linalg.norm(direction)
    y = np.cross([0.0, 0.0, 1.0] if abs(x[2]) < 0.9 else [1.0, 0.0, 0.0], x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("reach", [0.2, 1.0, 5.0])
def test_a_shape_is_met_where_mujoco_meets_it(shape, reach):
    """Random sizes, poses and starts: at 0.2 most start inside, at 5 outside."""
    rng = np.random.default_rng([KINDS[shape], int(10 * reach)])
    hits = 0
    for _ in range(30):
        size, position, R = rng.uniform(0.1, 1.0, 3), rng.normal(size=3), random_rotation(rng)
        origin = position + reach * rng.normal(size=3)
        v = (position - origin)[:, None] + 0.5 * rng.normal(size=(3, 40))
        v = np.ascontiguousarray(v / np.linalg.norm(v, axis=0))
        found, local = np.empty(40), R.T @ (origin - position)
        geom = KINDS[shape], tuple(size), tuple(R.ravel()), tuple(local)
        tile_kernels.reach_geom(40, *geom, None, v, found)
        each, local_starts = np.empty(40), np.repeat(local[:, None], 40, axis=1)
        tile_kernels.reach_geom(40, *geom, local_starts, v, each)
        assert each.tobytes() == found.tobytes()
        for beam in range(40):
            ray = v[:, beam].copy()
            expected = mujoco.mju_rayGeom(position, R.ravel(), size, origin, ray, KINDS[shape])
            assert np.isfinite(found[beam]) == (expected >= 0.0)
            if expected >= 0.0:
                hits += 1
                assert abs(found[beam] - expected) <= 1e-9
    assert 200 < hits <= 1200


@pytest.mark.parametrize(
    ("shape", "origin", "direction", "expected"),
    [
        ("sphere", (0.5, 0, 0), (0, 0, 1), np.sqrt(0.75)),
        ("sphere", (-3, 1, 0), (1, 0, 0), 3.0),  # grazes
        ("sphere", (1, 0, 0), (1, 0, 0), 0.0),  # leaves from the surface
        ("sphere", (3, 0, 0), (1, 0, 0), -1.0),
        ("capsule", (0, 0, -3), (0, 0, 1), 1.0),
        ("capsule", (0.5, 0, 0), (0, 0, 1), 1.0 + np.sqrt(0.75)),
        ("capsule", (1, 0, -3), (0, 0, 1), 2.0),  # along the side
        ("capsule", (-3, 0, 1), (1, 0, 0), 2.0),  # where side and cap meet
        ("capsule", (0, 0, 2), (0, 0, 1), 0.0),
        ("cylinder", (0, 0, 0), (1, 0, 0), 1.0),
        ("cylinder", (0.5, 0, 1), (0, 0, 1), 0.0),  # leaves from the top
        ("cylinder", (1, 0, -3), (0, 0, 1), 2.0),  # along the rim
        ("cylinder", (-3, 0, 1), (1, 0, 0), 2.0),  # along the top
        ("cylinder", (0, 0, 2), (0, 0, 1), -1.0),
        ("ellipsoid", (0, 0, 0), (0, 0, 1), 1.0),
        ("ellipsoid", (-3, 1, 0), (1, 0, 0), 3.0),
        ("box", (0, 0, 0), (0, 0, 1), 1.0),
        ("box", (1, 0, -3), (0, 0, 1), 2.0),  # in the plane of a face
        ("box", (-3, 0, 1), (1, 0, 0), 2.0),
        ("box", (1, 1, -3), (0, 0, 1), 2.0),  # along an edge
        ("box", (1, 0, 0), (1, 0, 0), 0.0),
        ("box", (1.001, 0, -3), (0, 0, 1), -1.0),
    ],
)
def test_a_unit_shape_by_hand(shape, origin, direction, expected):
    size = "1 1 1" if shape in ("ellipsoid", "box") else "1 1"
    model, data = posed(f'<geom type="{shape}" size="{"1" if shape == "sphere" else size}"/>')
    caster = TileCaster(model, ALL, range=100.0)
    found, geom = caster.cast(data, SINGLE, np.array(origin, float), facing(direction))
    assert found[0] == pytest.approx(expected, abs=1e-12)
    assert geom[0] == (0 if expected >= 0 else -1)
    assert by_mj_ray(model, data, np.array(origin, float), np.array([direction], float), 100.0)[
        0
    ] == pytest.approx(found)


@pytest.mark.parametrize(
    ("size", "origin", "direction", "expected"),
    [
        ("1 2 1", (0, 0, 1), (0, 0, -1), 1.0),
        ("1 2 1", (0, 0, -1), (0, 0, 1), -1.0),  # from below there is nothing
        ("1 2 1", (0, 0, -1), (0, 0, -1), -1.0),
        ("1 2 1", (0, 0, 1), (0, 0, 1), -1.0),
        ("1 2 1", (0, 0, 1), (1, 0, 0), -1.0),
        ("1 2 1", (0, 0, 0), (0, 0, -1), 0.0),
        ("1 2 1", (1, 2, 1), (0, 0, -1), 1.0),  # the corner belongs to it
        ("1 2 1", (1.001, 0, 1), (0, 0, -1), -1.0),
        ("1 2 1", (0, -2.001, 1), (0, 0, -1), -1.0),
        ("0 2 1", (50, 0, 1), (0, 0, -1), 1.0),  # infinite along x alone
        ("0 2 1", (50, 3, 1), (0, 0, -1), -1.0),
        ("0 0 1", (7, 7, 3), (3, 0, -4), 3.75),
    ],
)
def test_a_plane_by_hand(size, origin, direction, expected):
    model, data = posed(f'<geom type="plane" size="{size}"/>')
    caster = TileCaster(model, ALL, range=100.0)
    found, _ = caster.cast(data, SINGLE, np.array(origin, float), facing(direction))
    assert found[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("sensor", [LIDAR, CAMERA], ids=["lidar", "camera"])
def test_mixed_scenes_agree_with_mj_ray(sensor):
    """Sixty primitives about the sensor, which is inside some of them; patterns fill no tile."""
    kinds = set()
    pattern, directions = pattern_of(sensor), directions_of(sensor)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        model, data = posed(random_geoms(rng, 60))
        origin, R = rng.uniform(-1.0, 1.0, 3), random_rotation(rng)
        caster = TileCaster(model, ALL, sensor.range)
        found, ids = caster.cast(data, pattern, origin, R)
        rays_world = rotate(R, directions)
        expected, expected_ids = by_mj_ray(model, data, origin, rays_world, sensor.range)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(ids, expected_ids)
        kinds |= set(model.geom_type[ids[ids >= 0]].tolist())
        again, _ = caster.cast(data, pattern, origin, R)
        assert again.tobytes() == found.tobytes()
    assert kinds == {0, *KINDS.values()}


LATTICE_SHAPES = {
    "box": '<geom type="box" size="1 .5 .75"/>',
    "sphere": '<geom type="sphere" size="1"/>',
    "capsule": '<geom type="capsule" size=".5 .75"/>',
    "cylinder": '<geom type="cylinder" size=".5 1"/>',
    "ellipsoid": '<geom type="ellipsoid" size="1 .5 .75"/>',
    "plane": '<geom type="plane" size="1 .5 1"/>',
    "mesh": '<geom type="mesh" mesh="block"/>',
    "hfield": '<geom type="hfield" hfield="hill"/>',
    "touching boxes": '<geom type="box" size=".5 .5 .5" pos=".5 0 0"/>'
    '<geom type="box" size=".5 .5 .5" pos="-.5 0 0"/>',
}
LATTICE_ASSETS = """<asset>
  <mesh name="block" vertex="-1 -.5 -.75 1 -.5 -.75 -1 .5 -.75 1 .5 -.75
                             -1 -.5 .75 1 -.5 .75 -1 .5 .75 1 .5 .75"/>
  <hfield name="hill" nrow="3" ncol="3" size="1 1 .5 .25" elevation="0 1 0 1 2 1 0 1 0"/>
</asset>"""


@pytest.mark.parametrize("shape", LATTICE_SHAPES)
def test_axis_parallel_beams_on_a_lattice_agree_with_mj_ray(shape):
    """Beams that start on surfaces, edges and corners, run within faces, and touch."""
    model, data = posed(LATTICE_SHAPES[shape], LATTICE_ASSETS)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    caster, pattern = TileCaster(model, ALL, 100.0), cut_scattered(axes)
    steps = np.arange(-1.25, 1.26, 0.25)
    origins = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    each = cut_scattered(np.tile(axes, (len(origins), 1)), np.repeat(np.arange(len(origins)), 6))
    distances = caster.cast(data, each, origins, np.eye(3))[0].reshape(-1, 6)
    for number, origin in enumerate(origins):
        expected, _ = by_mj_ray(model, data, origin, axes, 100.0)
        np.testing.assert_array_less(np.abs(distances[number] - expected), 1e-12, str(origin))
        if number % 5 == 0:  # from one pose there are kernels of their own
            distance, _ = caster.cast(data, pattern, origin, np.eye(3))
            np.testing.assert_array_equal(distance, distances[number])


def test_all_that_moves_is_seen_where_it_is_now():
    """Jointed, mocap, and hung on a mocap body; no caster is built anew."""
    model, data = posed(
        """<geom name="wall" type="box" size=".1 9 9" pos="7 0 0"/>
        <body name="slider" pos="3 0 0"><joint type="slide" axis="1 0 0"/>
          <geom name="ball" type="sphere" size=".5" mass="1"/></body>
        <body name="hand" mocap="true" pos="0 3 0">
          <geom name="palm" type="box" size=".5 .5 .5"/>
          <body pos="0 0 2"><geom name="thumb" type="capsule" size=".25 .1"/></body></body>"""
    )
    caster = TileCaster(model, ALL, range=10.0)

    def look(origin, direction):
        mujoco.mj_kinematics(model, data)
        found, ids = caster.cast(data, SINGLE, np.array(origin, float), facing(direction))
        return float(found[0]), model.geom(ids[0]).name if ids[0] >= 0 else None

    assert look((0, 0, 0), (1, 0, 0)) == (pytest.approx(2.5), "ball")
    assert look((0, 0, 0), (0, 1, 0)) == (pytest.approx(2.5), "palm")
    assert look((0, 0, 2), (0, 1, 0)) == (pytest.approx(2.75), "thumb")
    data.qpos[0] = 1.25
    data.mocap_pos[0] = (0, 5, 0)
    assert look((0, 0, 0), (1, 0, 0)) == (pytest.approx(3.75), "ball")
    assert look((0, 0, 0), (0, 1, 0)) == (pytest.approx(4.5), "palm")
    assert look((0, 0, 2), (0, 1, 0)) == (pytest.approx(4.75), "thumb")
    data.qpos[0] = 20.0
    assert look((0, 0, 0), (1, 0, 0)) == (pytest.approx(6.9), "wall")


@pytest.mark.parametrize(
    ("attributes", "seen"),
    [
        ('rgba="1 1 1 1"', True),
        ('rgba="1 1 1 0"', False),
        ('material="clear"', False),
        ('material="clear" rgba="1 0 0 1"', False),  # the material's alpha replaces the geom's
        ('material="solid" rgba="1 0 0 0"', True),
        ('group="2"', True),
        ('group="3"', False),
        ('group="5"', False),
        ('group="7"', False),  # counts as 5
        ('contype="0" conaffinity="0"', True),
    ],
)
def test_what_mj_ray_does_not_see_is_not_seen(attributes, seen):
    model, data = posed(
        f'<geom type="box" size="1 1 1" {attributes}/>',
        '<asset><material name="clear" rgba="1 1 1 0"/><material name="solid"/></asset>',
    )
    groups = np.array([1, 1, 1, 0, 1, 0], np.uint8)
    origin = np.array([-3.0, 0.0, 0.0])
    found, _ = TileCaster(model, groups, range=10.0).cast(data, SINGLE, origin, np.eye(3))
    assert found[0] == (2.0 if seen else -1.0)
    assert found == by_mj_ray(model, data, origin, np.array([[1.0, 0, 0]]), 10.0, groups)[0]


def test_range_ends_what_is_seen():
    model, data = posed('<geom type="box" size="1 1 1" pos="5 0 0"/>')
    for limit, expected in ((4.0, 4.0), (3.999, -1.0)):
        caster = TileCaster(model, ALL, range=limit)
        found, ids = caster.cast(data, SINGLE, np.zeros(3), np.eye(3))
        assert (found[0], ids[0]) == (expected, 0 if expected > 0 else -1)


def test_a_world_without_geoms_is_all_misses():
    model, data = posed('<geom type="box" size="1 1 1" group="3"/>')
    groups = np.array([1, 1, 1, 0, 1, 1], np.uint8)
    caster = TileCaster(model, groups, range=10.0)
    found, ids = caster.cast(data, pattern_of(LIDAR), np.zeros(3), np.eye(3))
    assert (found == -1.0).all()
    assert (ids == -1).all()


MESH = (
    '<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
    '<hfield name="hills" nrow="3" ncol="3" size="2 2 1 1" elevation="0 1 0 2 0 1 0 1 3"/></asset>'
)
MIXED = """<geom type="mesh" mesh="wedge" pos="1 -2 -.2" euler="20 30 40"/>
    <geom type="hfield" hfield="hills" pos="-3 0 -1"/><geom type="box" size=".3 .3 .3" pos="2 0 0"/>
    <geom type="plane" size="0 0 1" pos="0 0 -2"/>
    <body mocap="true" pos="0 3 0"><geom type="mesh" mesh="wedge"/></body>"""


@pytest.mark.parametrize("poses", [1, 26])
def test_triangles_and_primitives_in_one_scene(poses):
    """Distances and ids of MuJoCo's own caster, from one pose and from many."""
    model, data = posed(MIXED, MESH)
    rng = np.random.default_rng(poses)
    indices = np.tile(np.arange(130) * poses // 130, 21).astype(np.int32)
    origins = np.array([0.1, 0.2, 0.3]) + rng.normal(0.0, 0.05, (poses, 3))
    rotations = np.stack([random_rotation(rng) for _ in range(poses)])
    caster = TileCaster(model, ALL, LIDAR.range)
    pattern = pattern_of(LIDAR, indices)
    got = caster.cast(data, pattern, origins, rotations)
    own = MujocoCaster(model, ALL, LIDAR.range)
    distance, ids = own.cast(data, pattern, origins, rotations)
    hit = (distance >= 0.0) & (distance <= LIDAR.range)
    assert set(np.unique(ids[hit])) == {0, 1, 2, 3, 4}
    np.testing.assert_array_equal(got[1], np.where(hit, ids, -1))
    np.testing.assert_allclose(got[0], np.where(hit, distance, -1.0), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("groups", "limit", "said"),
    [
        (ALL, 0.0, "range: got 0"),
        (ALL, np.inf, "range: got inf"),
        (ALL[:3], 1.0, "group_mask: got shape"),
    ],
)
def test_what_is_no_caster_is_refused(groups, limit, said):
    model, _ = posed('<geom type="sphere" size="1"/>')
    with pytest.raises(ValueError, match=said):
        TileCaster(model, groups, limit)
