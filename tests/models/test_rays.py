"""The tile caster against MuJoCo's own rays, shape by shape and scene by scene."""

import mujoco
import numpy as np
import pytest

from models import rays
from models.beams import DepthCamera, Lidar, SensorConfig, beam_directions
from models.rays import TileCaster, kernels
from models.rays.geometry import Geometry
from models.rays.tiles import cut
from models.robots import ROBOTS
from models.scene import compose
from models.sensors import MujocoCaster, SweepCaster
from models.worlds import WORLDS

ALL = np.ones(mujoco.mjNGROUP, np.uint8)
LIDAR = Lidar("lidar", "eye", 21, 130, -0.9, 0.9, range=8.0, rate=10.0, source="")
CAMERA = DepthCamera("camera", "eye", 45, 61, 1.5, 1.2, range=8.0, rate=10.0, source="")
SINGLE = (np.array([[0.0]]), np.array([[0.0]]))  # one beam along x
SHAPES = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
KINDS = {name: int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")) for name in SHAPES}


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


def random_geoms(rng, count, spread=4.0):
    """MJCF of mixed primitives about the origin, every shape, non-uniform sizes, any rotation."""
    lines = ['<geom name="floor" type="plane" size="0 0 1" pos="0 0 -1.5"/>']
    for index in range(count):
        numbers = [rng.uniform(-spread, spread, 3), rng.normal(size=4), rng.uniform(0.1, 0.7, 3)]
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
        found, room = np.empty(40), np.empty((3, 40))
        local = R.T @ (origin - position)
        kernels.reach_geom(KINDS[shape], 40, local, v, R.ravel(), size, room, found)
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
    caster = TileCaster(model, *SINGLE, ALL, range=100.0)
    found, geom = caster.cast(data, np.array(origin, float), facing(direction))
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
    caster = TileCaster(model, *SINGLE, ALL, range=100.0)
    found, _ = caster.cast(data, np.array(origin, float), facing(direction))
    assert found[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("sensor", [LIDAR, CAMERA], ids=lambda sensor: sensor.name)
def test_mixed_scenes_agree_with_mj_ray(sensor):
    """Sixty primitives about the sensor, which is inside some of them; patterns fill no tile."""
    kinds = set()
    tables = sensor.beam_tables()
    for seed in range(12):
        rng = np.random.default_rng(seed)
        model, data = posed(random_geoms(rng, 60))
        origin, R = rng.uniform(-1.0, 1.0, 3), random_rotation(rng)
        caster = TileCaster(model, *tables, ALL, sensor.range)
        found, ids = caster.cast(data, origin, R)
        rays_world = beam_directions(*tables) @ R.T
        expected, expected_ids = by_mj_ray(model, data, origin, rays_world, sensor.range)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(ids, expected_ids)
        kinds |= set(model.geom_type[ids[ids >= 0]].tolist())
        again, _ = caster.cast(data, origin, R)
        assert again.tobytes() == found.tobytes()
    assert kinds == {0, *KINDS.values()}


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
    caster = TileCaster(model, *SINGLE, ALL, range=10.0)

    def look(origin, direction):
        mujoco.mj_kinematics(model, data)
        found, ids = caster.cast(data, np.array(origin, float), facing(direction))
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
    found, _ = TileCaster(model, *SINGLE, groups, range=10.0).cast(data, origin, np.eye(3))
    assert found[0] == (2.0 if seen else -1.0)
    assert found == by_mj_ray(model, data, origin, np.array([[1.0, 0, 0]]), 10.0, groups)[0]


def test_of_equal_hits_the_lower_id_is_told():
    cube = '<geom type="box" size="{0} {0} {0}" pos="{1} 0 0"/>'
    model, data = posed(cube.format(2, 4) + cube.format(1, 3))  # faces at x = 2; near bounds alike
    _, ids = TileCaster(model, *SINGLE, ALL, range=10.0).cast(data, np.zeros(3), np.eye(3))
    assert ids[0] == by_mj_ray(model, data, np.zeros(3), np.array([[1.0, 0, 0]]), 10.0)[1][0] == 0


def test_range_ends_what_is_seen():
    model, data = posed('<geom type="box" size="1 1 1" pos="5 0 0"/>')
    for limit, expected in ((4.0, 4.0), (3.999, -1.0)):
        caster = TileCaster(model, *SINGLE, ALL, range=limit)
        found, ids = caster.cast(data, np.zeros(3), np.eye(3))
        assert (found[0], ids[0]) == (expected, 0 if expected > 0 else -1)


def test_a_world_without_geoms_is_all_misses():
    model, data = posed('<geom type="box" size="1 1 1" group="3"/>')
    groups = np.array([1, 1, 1, 0, 1, 1], np.uint8)
    caster = TileCaster(model, *LIDAR.beam_tables(), groups, range=10.0)
    found, ids = caster.cast(data, np.zeros(3), np.eye(3))
    assert (found == -1.0).all()
    assert (ids == -1).all()


def test_compiled_kernels_are_their_python():
    """The interpreter runs the same source, callees included, beam by beam."""
    rng = np.random.default_rng(5)
    model, _ = posed(random_geoms(rng, 12, spread=2.0))
    tables = DepthCamera("", "", 5, 9, 2.0, 1.0, range=5.0, rate=1.0, source="").beam_tables()
    pattern = cut(beam_directions(*tables), 5, 9)
    geoms = Geometry(model, ALL).geoms
    origin, R = np.array([0.3, -0.2, 0.1]), random_rotation(rng)
    results = []
    for run in (lambda kernel: kernel, lambda kernel: kernel.py_func):
        local, nearest = np.empty((13, 3)), np.empty(13)
        run(kernels.approach)(origin, geoms, local, nearest)
        order = np.argsort(nearest, kind="stable")
        distance, ids = np.empty(45), np.empty(45, np.int32)
        with np.errstate(all="ignore"):
            run(kernels.cast_sweep)(
                pattern, R, origin, geoms, local, nearest, order, 5.0, distance, ids
            )
        results.append((local.tobytes(), nearest.tobytes(), distance.tobytes(), ids.tobytes()))
    assert results[0] == results[1]


def test_the_nearest_possible_distance_is_a_lower_bound():
    """Against MuJoCo's distance of a vanishing ball from each geom; close to it for boxes."""
    rng = np.random.default_rng(8)
    dot = '<body name="dot" mocap="true"><geom name="dot" type="sphere" size="1e-9"/></body>'
    model, data = posed(random_geoms(rng, 60) + dot)
    geometry = Geometry(model, ALL)
    local, nearest = np.empty((model.ngeom, 3)), np.empty(model.ngeom)
    apart = 0
    for _ in range(20):
        origin = data.mocap_pos[0] = rng.uniform(-5.0, 5.0, 3)
        mujoco.mj_kinematics(model, data)
        geometry.refresh(data)
        kernels.approach(origin, geometry.geoms, local, nearest)
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
                assert nearest[geom] > 0.0
    assert apart > 500


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (8, 8), (33, 32), (16, 100), (3, 65)])
def test_tiles_hold_each_beam_once_and_their_cones_hold_the_beams(rows, columns):
    sensor = Lidar("", "", rows, columns, -0.4, 0.7, range=1.0, rate=1.0, source="")
    directions = beam_directions(*sensor.beam_tables())
    pattern = cut(directions, rows, columns)
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
    '<hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
)


@pytest.mark.parametrize("shape", ['type="mesh" mesh="wedge"', 'type="hfield" hfield="hills"'])
def test_shapes_that_only_mujoco_casts_are_refused_by_name(shape):
    model, data = posed(f'<site name="eye"/><geom name="rock" {shape}/>', MESH)
    with pytest.raises(ValueError, match=r"geom 'rock': got shape (mesh|hfield).*'mujoco'"):
        SweepCaster(model, CAMERA, engine="tile")
    assert len(SweepCaster(model, CAMERA, engine="mujoco").cast(data)) == 45 * 61
    hidden, _ = posed(f'<site name="eye"/><geom name="rock" {shape} group="3"/>', MESH)
    SweepCaster(hidden, CAMERA, engine="tile")


@pytest.mark.parametrize(
    ("rows", "columns", "groups", "limit", "said"),
    [
        (np.zeros((1, 2)), np.zeros((1, 2)), ALL, 1.0, "beam 0: got length 0, expected 1"),
        (np.zeros((0, 2)), np.zeros((1, 2)), ALL, 1.0, "beams: got 0 rows"),
        (*SINGLE, ALL, 0.0, "range: got 0"),
        (*SINGLE, ALL, np.inf, "range: got inf"),
        (*SINGLE, ALL[:3], 1.0, "group_mask: got shape"),
    ],
)
def test_what_cannot_be_cast_is_refused(rows, columns, groups, limit, said):
    model, _ = posed('<geom type="sphere" size="1"/>')
    with pytest.raises(ValueError, match=said):
        TileCaster(model, rows, columns, groups, limit)


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_both_engines_give_the_same_warehouse(robot):
    world, robot = WORLDS["warehouse"](4), ROBOTS[robot]
    sweeps = []
    for engine in ("tile", "mujoco"):
        scene = compose(world, robot, SensorConfig(engine))
        data = mujoco.MjData(scene.model)
        start = np.array([*world.start[:2], robot.spec.rest_height])
        scene.controller.reset(data, start, world.start_heading)
        for quaternion in ([1, 0, 0, 0], [0.9, 0.1, -0.05, 0.3]):
            data.qpos[:3] += (0.1234, -0.0567, 0.031)
            data.qpos[3:7] = np.array(quaternion) / np.linalg.norm(quaternion)
            mujoco.mj_kinematics(scene.model, data)
            casters = scene.casters[: len(robot.spec.sweep_sensors)]
            sweeps.append((engine, [caster.cast(data) for caster in casters]))
    for (_, tile), (_, own) in zip(sweeps[:2], sweeps[2:], strict=True):
        for one, other in zip(tile, own, strict=True):
            np.testing.assert_array_equal(one, other)
            assert (one < 60000).mean() > 0.3


def test_engines_share_a_signature():
    model, data = posed(random_geoms(np.random.default_rng(1), 10))
    tables = LIDAR.beam_tables()
    tile = TileCaster(model, *tables, ALL, LIDAR.range).cast(data, np.zeros(3), np.eye(3))
    own = MujocoCaster(model, beam_directions(*tables), ALL, LIDAR.range)
    distance, ids = own.cast(data, np.zeros(3), np.eye(3))
    beyond = distance > LIDAR.range
    np.testing.assert_allclose(tile[0], np.where(beyond, -1.0, distance), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(tile[1], np.where(beyond, -1, ids))


def test_nothing_is_compiled_after_the_warm_up():
    rays.warm_up()
    before = [len(kernel.signatures) for kernel in (kernels.cast_sweep, kernels.approach)]
    model, data = posed(random_geoms(np.random.default_rng(2), 10))
    caster = TileCaster(model, *LIDAR.beam_tables(), ALL, LIDAR.range)
    caster.cast(data, data.geom_xpos[0], data.geom_xmat[0].reshape(3, 3))
    assert before == [1, 1]
    assert before == [len(kernel.signatures) for kernel in (kernels.cast_sweep, kernels.approach)]
