"""The tile caster against MuJoCo's own rays, shape by shape and scene by scene."""

import mujoco
import numpy as np
import pytest

from tests.models.interpreting import interpret_kernels
from wayproof.models import rays
from wayproof.models.poses import Trail
from wayproof.models.rays import TileCaster, bounds, cut_grid, cut_scattered, tile_kernels, tiles
from wayproof.models.rays.geometry import Geometry
from wayproof.models.rays.surface_kernels import meet_tiles
from wayproof.models.robots import ROBOTS
from wayproof.models.scene import compose
from wayproof.models.sensors.beams import directions as beams_of
from wayproof.models.sensors.beams import rotate
from wayproof.models.sensors.caster import RangefinderCaster
from wayproof.models.sensors.devices import DepthCamera, Device, SensorConfig, SpinningLidar, evenly
from wayproof.models.sensors.engines import Firing, MujocoEngine
from wayproof.models.worlds import WORLDS

ALL = np.ones(mujoco.mjNGROUP, np.uint8)


def lidar(rings: int, azimuths: int, low: float, high: float, range: float) -> Device:
    elevations = evenly(low, high, rings)
    kept = {"range": range, "rate": 10.0, "no_return_is_free": True, "source": "test"}
    return SpinningLidar(elevations=elevations, azimuths=azimuths, **kept)


def camera(height: int, width: int, horizontal: float, vertical: float, range: float) -> Device:
    return DepthCamera(
        height=height,
        width=width,
        field_of_view_horizontal=horizontal,
        field_of_view_vertical=vertical,
        range=range,
        rate=10.0,
        no_return_is_free=True,
        measures="range",
        source="test",
    )


LIDAR = lidar(21, 130, -0.9, 0.9, range=8.0)
CAMERA = camera(45, 61, 1.5, 1.2, range=8.0)
SINGLE = cut_grid(np.array([[1.0, 0.0, 0.0]]), 1, 1)
SHAPES = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
KINDS = {name: int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")) for name in SHAPES}


def directions_of(sensor):
    return beams_of(sensor.beam_table(), 0)


def own_hits(model, data, directions, range, origin, R):
    firing = Firing(directions, np.zeros(len(directions), np.int32), cut_scattered(directions))
    return MujocoEngine(model, ALL, range, 1).cast(data, firing, origin[None], R[None])[:2]


def pattern_of(sensor, indices=None):
    table = sensor.beam_table()
    rows, columns = len(table.rows), len(table.columns)
    return cut_grid(directions_of(sensor), rows, columns, indices)


def posed(worldbody, head=""):
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{head}<worldbody>{worldbody}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def random_rotation(rng):
    quaternion = rng.normal(size=4)
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, quaternion / np.linalg.norm(quaternion))
    return R.reshape(3, 3)


def facing(direction):
    """A rotation whose x axis is `direction`: it turns SINGLE's beam to it."""
    x = np.asarray(direction, float) / np.linalg.norm(direction)
    y = np.cross([0.0, 0.0, 1.0] if abs(x[2]) < 0.9 else [1.0, 0.0, 0.0], x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def by_mj_ray(model, data, origin, directions, limit, groups=ALL):
    distance, ids = np.full(len(directions), -1.0), np.full(len(directions), -1, np.int32)
    geom = np.zeros(1, np.int32)
    for beam, direction in enumerate(directions):
        found = mujoco.mj_ray(model, data, origin, direction, groups, 1, -1, geom)
        if 0.0 <= found <= limit:
            distance[beam], ids[beam] = found, geom[0]
    return distance, ids


def random_geoms(rng, count, spread=4.0, sizes=None):
    """MJCF of mixed primitives about the origin, any rotation; sizes between two, any scale."""
    lines = ['<geom name="floor" type="plane" size="0 0 1" pos="0 0 -1.5"/>']
    for index in range(count):
        size = np.exp(rng.uniform(*np.log(sizes), 3)) if sizes else rng.uniform(0.1, 0.7, 3)
        numbers = [rng.uniform(-spread, spread, 3), rng.normal(size=4), size]
        position, quaternion, size = (" ".join(map(repr, n.tolist())) for n in numbers)
        shape = (*SHAPES, "plane")[index % 6]
        lines.append(
            f'<geom name="g{index}" type="{shape}" pos="{position}" quat="{quaternion}" '
            f'size="{size}"/>'
        )
    return "\n".join(lines)


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
    for origin in np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3):
        distance, _ = caster.cast(data, pattern, origin, np.eye(3))
        expected, _ = by_mj_ray(model, data, origin, axes, 100.0)
        np.testing.assert_allclose(distance, expected, atol=1e-12, err_msg=str(origin))


def rolling_poses(rng, m):
    """A sensor that flies a bend of a metre while it turns by a radian."""
    part = np.linspace(0.0, 1.0, m)
    origins = rng.uniform(-1.0, 1.0, 3) + part[:, None] * [1.0, 0.4, -0.2] * part[:, None]
    start, axis, rotations = random_rotation(rng), rng.normal(size=3), np.empty((m, 9))
    for R, angle in zip(rotations, part, strict=True):
        quaternion = np.empty(4)
        mujoco.mju_axisAngle2Quat(quaternion, axis / np.linalg.norm(axis), angle)
        mujoco.mju_quat2Mat(R, quaternion)
    return origins, rotations.reshape(m, 3, 3) @ start


def by_mj_ray_rolling(model, data, origins, rotations, directions, indices, limit):
    found = [
        by_mj_ray(model, data, origins[k], rotate(rotations[k], direction[None]), limit)
        for k, direction in zip(indices, directions, strict=True)
    ]
    return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])


@pytest.mark.parametrize("order", ["columns", "scattered"])
def test_each_beam_of_a_rolling_sweep_leaves_from_its_own_pose(order):
    """A lidar that fires column by column, and beams of any direction at any indices."""
    differ = 0
    for seed in range(6):
        rng = np.random.default_rng([7, seed])
        model, data = posed(random_geoms(rng, 60))
        if order == "columns":
            m, directions = 130, directions_of(LIDAR)
            indices = np.tile(np.arange(m, dtype=np.int32), 21)
            pattern = pattern_of(LIDAR, indices)
        else:
            m, directions = 40, random_directions(rng, 2000)
            indices = rng.integers(m, size=2000, dtype=np.int32)
            pattern = cut_scattered(directions, indices)
        origins, rotations = rolling_poses(rng, m)
        caster = TileCaster(model, ALL, range=8.0)
        found, ids = caster.cast(data, pattern, origins, rotations)
        expected, expected_ids = by_mj_ray_rolling(
            model, data, origins, rotations, directions, indices, 8.0
        )
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(ids, expected_ids)
        still, _ = caster.cast(data, pattern, origins[0], rotations[0])
        differ += (np.abs(found - still) > 0.1).sum()
    assert differ > 4000


def test_a_rolling_sweep_by_hand():
    """Four beams along x towards a wall, from a sensor that comes nearer by 0.5 m a beam."""
    model, data = posed('<geom type="box" size="1 9 9" pos="6 0 0"/>')
    pattern = cut_grid(np.repeat(X, 4, axis=0), 1, 4, np.array([0, 1, 2, 3], np.int32))
    origins = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0], [1.5, 0, 0]])
    found, _ = TileCaster(model, ALL, range=9.0).cast(data, pattern, origins, np.eye(3))
    np.testing.assert_array_equal(found, [5.0, 4.5, 4.0, 3.5])
    turned = np.stack([np.eye(3), np.diag([-1.0, -1, 1]), np.eye(3), np.eye(3)])
    found, _ = TileCaster(model, ALL, range=9.0).cast(data, pattern, np.zeros(3), turned)
    np.testing.assert_array_equal(found, [5.0, -1.0, 5.0, 5.0])


def test_equal_poses_are_one_pose():
    rng = np.random.default_rng(11)
    model, data = posed(random_geoms(rng, 80))
    indices = np.tile(np.arange(130, dtype=np.int32), 21)
    pattern, caster = pattern_of(LIDAR, indices), TileCaster(model, ALL, LIDAR.range)
    for _ in range(4):
        origin, R = rng.uniform(-2.0, 2.0, 3), random_rotation(rng)
        one = caster.cast(data, pattern, origin, R)
        many = caster.cast(data, pattern, np.tile(origin, (130, 1)), np.tile(R, (130, 1, 1)))
        half = caster.cast(data, pattern, np.tile(origin, (130, 1)), R)
        for got in (many, half):
            assert [array.tobytes() for array in got] == [array.tobytes() for array in one]


def random_directions(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 5000])
def test_scattered_beams_are_all_cast_whatever_their_order(count):
    rng = np.random.default_rng(count)
    model, data = posed(random_geoms(rng, 60))
    directions, shuffle = random_directions(rng, count), rng.permutation(count)
    caster, R = TileCaster(model, ALL, range=8.0), random_rotation(rng)
    found, ids = caster.cast(data, cut_scattered(directions), np.zeros(3), R)
    expected, expected_ids = by_mj_ray(model, data, np.zeros(3), rotate(R, directions), 8.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(ids, expected_ids)
    shuffled = caster.cast(data, cut_scattered(directions[shuffle]), np.zeros(3), R)
    assert shuffled[0].tobytes() == found[shuffle].tobytes()


def test_scattered_beams_lie_in_narrow_tiles():
    """Of 5000 beams all over the sphere 64 fill 0.16 sr: half a cone of 13 degrees, if round."""
    pattern = cut_scattered(random_directions(np.random.default_rng(3), 5000))
    assert np.median(np.degrees(np.arccos(pattern.tile_cones[:, 3]))) < 24.0
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    assert sorted(cut_scattered(axes).places) == list(range(6))


def test_neighbours_on_the_curve_are_neighbours_on_the_sphere():
    """Every cell in front of the sensor has its own place, next to the one before."""
    side = 2**tiles.CURVE_BITS
    centres = (np.arange(side) + 0.5) * 2.0 / side - 1.0
    e, f = (axis.ravel() for axis in np.meshgrid(centres, centres))
    x = 1.0 - np.abs(e) - np.abs(f)
    y = np.where(x < 0.0, np.copysign(1.0 - np.abs(f), e), e)
    z = np.where(x < 0.0, np.copysign(1.0 - np.abs(e), f), f)
    cells = np.empty(side * side, np.uint16)
    tiles.number_cells(np.stack([x, y, z], axis=1), cells)
    order = np.argsort(cells)
    np.testing.assert_array_equal(cells[order], np.arange(side * side))
    steps = np.abs(np.diff(e[order])) + np.abs(np.diff(f[order]))
    np.testing.assert_allclose(steps, 2.0 / side, rtol=1e-9)


@pytest.mark.parametrize("poses", [1, 130])
def test_threads_do_not_change_a_bit(poses):
    rng = np.random.default_rng(13)
    model, data = posed(random_geoms(rng, 60))
    pattern = pattern_of(LIDAR, np.tile(np.arange(130, dtype=np.int32), 21))
    origins, rotations = rolling_poses(rng, poses)
    sweeps = [
        TileCaster(model, ALL, LIDAR.range, threads).cast(data, pattern, origins, rotations)
        for threads in (1, 2, 3, 64)
    ]
    assert (sweeps[0][1] >= 0).sum() > 500
    for sweep in sweeps[1:]:
        assert [array.tobytes() for array in sweep] == [array.tobytes() for array in sweeps[0]]


@pytest.mark.parametrize("pattern", ["grid", "scattered"])
def test_no_bound_rules_out_a_hit(pattern):
    """Splinters, plates and balls of any size, many to a tile: all bits as of `mj_multiRay`."""
    dense = lidar(40, 200, -0.5, 0.5, range=30.0)
    for seed in range(8):
        rng = np.random.default_rng([31, seed])
        model, data = posed(random_geoms(rng, 300, spread=10.0, sizes=(0.003, 3.0)))
        directions = directions_of(dense) if pattern == "grid" else random_directions(rng, 8000)
        cut = pattern_of(dense) if pattern == "grid" else cut_scattered(directions)
        origin, R = rng.uniform(-5.0, 5.0, 3), random_rotation(rng)
        distance, ids = TileCaster(model, ALL, dense.range).cast(data, cut, origin, R)
        own, own_ids = own_hits(model, data, directions, dense.range, origin, R)
        beyond = own > dense.range
        np.testing.assert_array_equal(distance, np.where(beyond, -1.0, own))
        np.testing.assert_array_equal(ids, np.where(beyond, -1, own_ids))


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


def test_of_equal_hits_the_lower_id_is_told():
    cube = '<geom type="box" size="{0} {0} {0}" pos="{1} 0 0"/>'
    model, data = posed(cube.format(2, 4) + cube.format(1, 3))  # faces at x = 2; near bounds alike
    _, ids = TileCaster(model, ALL, range=10.0).cast(data, SINGLE, np.zeros(3), np.eye(3))
    assert ids[0] == by_mj_ray(model, data, np.zeros(3), np.array([[1.0, 0, 0]]), 10.0)[1][0] == 0


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


@pytest.mark.parametrize("poses", [1, 3])
def test_compiled_kernels_equal_their_python(poses, monkeypatch):
    """The interpreter runs the same source, callees included, beam by beam."""
    rng = np.random.default_rng(5)
    model, data = posed(random_geoms(rng, 12, spread=2.0))
    sensor = camera(5, 9, 2.0, 1.0, range=5.0)
    origins = [0.3, -0.2, 0.1] + 0.05 * rng.normal(size=(poses, 3))
    rotations = np.stack([random_rotation(rng)] * poses)

    def everything():
        pattern = cut_scattered(directions_of(sensor), np.arange(45, dtype=np.int32) % poses)
        hits = TileCaster(model, ALL, sensor.range).cast(data, pattern, origins, rotations)
        return [array.tobytes() for array in (*pattern, *hits)]

    compiled = everything()
    interpret_kernels(monkeypatch, "wayproof.models.rays")
    with np.errstate(all="ignore"):
        assert everything() == compiled


def test_the_nearest_possible_distance_is_a_lower_bound():
    """Against MuJoCo's distance of a vanishing ball from each geom; close to it for boxes."""
    rng = np.random.default_rng(8)
    dot = '<body name="dot" mocap="true"><geom name="dot" type="sphere" size="1e-9"/></body>'
    model, data = posed(random_geoms(rng, 60) + dot)
    geometry = Geometry(model, ALL)
    local, views = np.empty((model.ngeom, 3)), np.empty((6, model.ngeom))
    nearest = views[0]
    apart = 0
    for _ in range(20):
        origin = data.mocap_pos[0] = rng.uniform(-5.0, 5.0, 3)
        mujoco.mj_kinematics(model, data)
        geometry.refresh(data)
        bounds.view_geoms(origin, 0.0, geometry.geoms, local, views)
        for geom in range(model.ngeom):
            kind = model.geom_type[geom]
            if kind == mujoco.mjtGeom.mjGEOM_PLANE or model.geom(geom).name == "dot":
                continue
            true = mujoco.mj_geomDistance(model, data, model.geom("dot").id, geom, 20.0, None)
            assert nearest[geom] <= max(true, 0.0) + 1e-6
            apart += true > 0.1
            if kind == mujoco.mjtGeom.mjGEOM_BOX and true > 0.1:
                assert nearest[geom] == pytest.approx(true, abs=1e-6)
            if kind == mujoco.mjtGeom.mjGEOM_SPHERE and true > 0.1:
                assert nearest[geom] == pytest.approx(true, abs=1e-6)
    assert apart > 500


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (8, 8), (33, 32), (16, 100), (3, 65)])
def test_tiles_hold_each_beam_once_and_their_cones_hold_the_beams(rows, columns):
    sensor = lidar(rows, columns, -0.4, 0.7, range=1.0)
    directions = directions_of(sensor)
    pattern = cut_grid(directions, rows, columns)
    assert sorted(pattern.places) == list(range(rows * columns))
    np.testing.assert_array_equal(pattern.beams.T, directions[pattern.places])
    starts = (pattern.tile_starts, pattern.tile_starts[pattern.block_starts])
    for cones, runs in zip((pattern.tile_cones, pattern.block_cones), starts, strict=True):
        assert runs[0] == 0
        assert runs[-1] == rows * columns
        for cone, start, stop in zip(cones, runs[:-1], runs[1:], strict=True):
            assert (directions[pattern.places[start:stop]] @ cone[:3] >= cone[3]).all()
            assert cone[3] ** 2 + cone[4] ** 2 == pytest.approx(1.0)


MESH = (
    '<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
    '<hfield name="hills" nrow="3" ncol="3" size="2 2 1 1" elevation="0 1 0 2 0 1 0 1 3"/></asset>'
)
MIXED = """<geom type="mesh" mesh="wedge" pos="1 -2 -.2" euler="20 30 40"/>
    <geom type="hfield" hfield="hills" pos="-3 0 -1"/><geom type="box" size=".3 .3 .3" pos="2 0 0"/>
    <geom type="plane" size="0 0 1" pos="0 0 -2"/>
    <body mocap="true" pos="0 3 0"><geom type="mesh" mesh="wedge"/></body>"""


@pytest.mark.parametrize("poses", [1, 26])
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_triangles_and_primitives_in_one_scene(poses, threads):
    """Distances, ids and normals of MuJoCo's own caster, from one pose and from many."""
    model, data = posed(MIXED, MESH)
    rng = np.random.default_rng(poses)
    directions = directions_of(LIDAR)
    indices = np.tile(np.arange(130) * poses // 130, 21).astype(np.int32)
    origins = np.array([0.1, 0.2, 0.3]) + rng.normal(0.0, 0.05, (poses, 3))
    rotations = np.stack([random_rotation(rng) for _ in range(poses)])
    caster = TileCaster(model, ALL, LIDAR.range, threads)
    got = caster.cast_with_normals(data, pattern_of(LIDAR, indices), origins, rotations)
    plain = caster.cast(data, pattern_of(LIDAR, indices), origins, rotations)
    assert all((one == other).all() for one, other in zip(plain, got, strict=False))
    firing = Firing(directions, indices, pattern_of(LIDAR, indices))
    own = MujocoEngine(model, ALL, LIDAR.range, 1)
    expected = own.cast(data, firing, origins, rotations, normals=True)
    hit = (expected.distance >= 0.0) & (expected.distance <= LIDAR.range)
    assert set(np.unique(expected.geom_id[hit])) == {0, 1, 2, 3, 4}
    np.testing.assert_array_equal(got[1], np.where(hit, expected.geom_id, -1))
    np.testing.assert_allclose(got[0], np.where(hit, expected.distance, -1.0), rtol=0, atol=1e-9)
    np.testing.assert_allclose(got[2][hit], expected.normals[hit], rtol=0, atol=1e-9)
    assert (got[2][~hit] == 0.0).all()


X = np.array([[1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        (lambda: cut_grid(np.zeros((2, 3)), 1, 2), "beam 0: got length 0, expected 1"),
        (lambda: cut_scattered(X * [[1.0], [2.0]]), "beam 1: got length 2, expected 1"),
        (lambda: cut_grid(np.zeros((0, 3)), 0, 2), "beams: got 0 rows"),
        (lambda: cut_grid(X, 1, 2), "beams: got 1, expected 1 rows x 2 columns"),
        (lambda: cut_scattered(np.zeros((0, 3))), "beams: got 0"),
        (lambda: cut_scattered(X, np.array([0, 1])), r"pose_indices: got shape \(2,\)"),
        (lambda: cut_scattered(X, np.array([-1])), "pose_indices: got -1"),
    ],
)
def test_what_is_no_pattern_is_refused(cut, said):
    with pytest.raises(ValueError, match=said):
        cut()


@pytest.mark.parametrize(
    ("groups", "limit", "threads", "said"),
    [
        (ALL, 0.0, 1, "range: got 0"),
        (ALL, np.inf, 1, "range: got inf"),
        (ALL[:3], 1.0, 1, "group_mask: got shape"),
        (ALL, 1.0, 0, "threads: got 0"),
    ],
)
def test_what_is_no_caster_is_refused(groups, limit, threads, said):
    model, _ = posed('<geom type="sphere" size="1"/>')
    with pytest.raises(ValueError, match=said):
        TileCaster(model, groups, limit, threads)


@pytest.mark.parametrize(
    ("origins", "rotations", "said"),
    [
        (np.zeros(2), np.eye(3), r"origins: got shape \(2,\)"),
        (np.zeros((1, 1, 3)), np.eye(3), "origins: got shape"),
        (np.zeros((0, 3)), np.eye(3), "origins: got shape"),
        (np.zeros(3), np.eye(2), "R_world_sensor: got shape"),
        (np.zeros((2, 3)), np.zeros((3, 3, 3)), "poses: got 2 origins, 3 rotations"),
        (np.zeros((2, 3)), np.eye(3), "pose_indices: got up to 2, expected less than 2"),
    ],
)
def test_poses_that_do_not_fit_are_refused(origins, rotations, said):
    model, data = posed('<geom type="sphere" size="1"/>')
    with pytest.raises(ValueError, match=said):
        TileCaster(model, ALL, 1.0).cast(data, cut_scattered(X, [2]), origins, rotations)


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_both_engines_give_the_same_warehouse(robot):
    world, robot = WORLDS["warehouse"](4), ROBOTS[robot]
    sweeps = []
    for engine in ("tile", "mujoco"):
        scene = compose(world, robot, SensorConfig(engine=engine))
        data = mujoco.MjData(scene.model)
        start = np.array([*world.start[:2], robot.spec.rest_height])
        scene.controller.reset(data, start, world.start_heading)
        for quaternion in ([1, 0, 0, 0], [0.9, 0.1, -0.05, 0.3]):
            data.qpos[:3] += (0.1234, -0.0567, 0.031)
            data.qpos[3:7] = np.array(quaternion) / np.linalg.norm(quaternion)
            mujoco.mj_kinematics(scene.model, data)
            casters = [c for c in scene.casters if not isinstance(c, RangefinderCaster)]
            trail = Trail(data.qpos[None, :3].copy(), data.qpos[None, 3:7].copy(), 0.002)
            sweeps.append((engine, [caster.cast(data, trail, 0, 0) for caster in casters]))
    for (_, tile), (_, own) in zip(sweeps[:2], sweeps[2:], strict=True):
        for one, other in zip(tile, own, strict=True):
            np.testing.assert_array_equal(one, other)
            assert (one < 60000).mean() > 0.3


def test_both_engines_give_the_same_sweep():
    model, data = posed(random_geoms(np.random.default_rng(1), 10))
    caster = TileCaster(model, ALL, LIDAR.range)
    tile = caster.cast(data, pattern_of(LIDAR), np.zeros(3), np.eye(3))
    directions = directions_of(LIDAR)
    distance, ids = own_hits(model, data, directions, LIDAR.range, np.zeros(3), np.eye(3))
    beyond = distance > LIDAR.range
    np.testing.assert_allclose(tile[0], np.where(beyond, -1.0, distance), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(tile[1], np.where(beyond, -1, ids))


def test_nothing_is_compiled_after_the_warm_up():
    rays.warm_up()
    everything = {
        name: kernel
        for module in (bounds, tile_kernels, tiles)
        for name, kernel in vars(module).items()
        if name in ("view_geoms", "cast_blocks", "fit_cones", "turn_cones", "number_cells")
    }
    assert len(everything) == 5
    before = {name: len(kernel.signatures) for name, kernel in everything.items()}
    assert set(before.values()) == {1}
    model, data = posed(random_geoms(np.random.default_rng(2), 10))
    caster = TileCaster(model, ALL, LIDAR.range, threads=2)
    R = data.geom_xmat[0].reshape(3, 3)
    caster.cast(data, pattern_of(LIDAR), data.geom_xpos[0], R)
    directions = np.asfortranarray(directions_of(LIDAR))
    directions.flags.writeable = False
    indices = (np.arange(len(directions)) % 7)[::-1]
    caster.cast(data, cut_scattered(directions, indices), data.geom_xpos[:7], R)
    caster.cast(data, cut_grid(directions[::-2][:9], 3, 3), data.geom_xpos[0], R.T)
    assert before == {name: len(kernel.signatures) for name, kernel in everything.items()}


def test_nothing_is_compiled_after_a_caster_of_triangles_is_made():
    head = '<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
    model, data = posed('<geom type="mesh" mesh="wedge"/>', head)
    caster = TileCaster(model, ALL, LIDAR.range, threads=2)
    before = len(meet_tiles.signatures)
    assert before > 0
    directions = directions_of(LIDAR)
    caster.cast(data, pattern_of(LIDAR), np.ones(3), np.eye(3))
    scattered = cut_scattered(directions, np.arange(len(directions)) % 7)
    caster.cast(data, scattered, np.ones((7, 3)), np.broadcast_to(np.eye(3), (7, 3, 3)))
    assert len(meet_tiles.signatures) == before
