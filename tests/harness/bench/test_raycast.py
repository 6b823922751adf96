"""Rays that share nothing, against MuJoCo's own, one by one."""

import mujoco
import numpy as np
import pytest

from tests.models.interpreting import interpret_kernels
from wayproof.harness.bench.raycast.caster import RayCaster
from wayproof.harness.bench.raycast.scenes import clutter

ALL = np.ones(mujoco.mjNGROUP, np.uint8)
PRIMITIVES = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
HEAD = """
<asset>
  <mesh name="wedge" vertex="0 0 0  1 0 0  0 1.2 0  0.1 0.2 0.9  0.6 0.7 0.5"/>
  <mesh name="stretched" vertex="0 0 0  1 0 0  0 1 0  0 0 1" scale="0.5 2 -1" refpos="1 0 0"/>
  <hfield name="hills" nrow="3" ncol="4" size="1 1.5 0.6 0.2"
          elevation="0 1 2 1  1 3 0 1  0 0 2 4"/>
</asset>
"""


def posed(worldbody, head=HEAD):
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{head}<worldbody>{worldbody}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def everything(rng, count=36):
    """Every shape a ray can meet but SDFs, at rest, on mocap bodies and on hinges, over a floor."""
    shapes = [f'type="{shape}"' for shape in PRIMITIVES]
    shapes += ['type="mesh" mesh="wedge"', 'type="mesh" mesh="stretched"']
    shapes += ['type="hfield" hfield="hills"', 'type="plane"']
    lines = ['<geom type="plane" size="0 0 1" pos="0 0 -2"/>']
    for index in range(count):
        shape = shapes[index % len(shapes)]
        sized = "mesh" not in shape and "hfield" not in shape
        size = f'size="{numbers(rng.uniform(0.1, 0.9, 3))}"' if sized else ""
        pose = f'pos="{numbers(rng.normal(size=3) * 3)}" quat="{numbers(rng.normal(size=4))}"'
        moves = index // len(shapes) if "plane" not in shape and "hfield" not in shape else 0
        if moves == 1:
            lines.append(f'<body mocap="true" {pose}><geom {shape} {size}/></body>')
        elif moves == 2:
            joint = f'<joint type="hinge" axis="{numbers(rng.normal(size=3))}" pos="1 0 0"/>'
            inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
            lines.append(f"<body {pose}>{joint}{inertia}<geom {shape} {size}/></body>")
        else:
            lines.append(f"<geom {shape} {size} {pose}/>")
    return "\n".join(lines)


def random_rays(rng, count, about):
    origins = 3.0 * rng.normal(size=(count, 3))
    directions = about[rng.integers(0, len(about), count)] - origins + rng.normal(size=(count, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def assert_as_mujoco(model, data, caster, origins, directions, limit, groups=ALL):
    distance, ids = caster.cast(data, origins, directions)
    geom = np.zeros(1, np.int32)
    for ray in range(len(origins)):
        found = mujoco.mj_ray(model, data, origins[ray], directions[ray], groups, 1, -1, geom)
        if not 0.0 <= found <= limit:
            found, geom[0] = -1.0, -1
        assert ids[ray] == geom[0]
        assert abs(distance[ray] - found) <= 1e-9
    return ids


@pytest.mark.parametrize("seed", range(6))
def test_whole_scenes_as_mujoco_casts_them(seed):
    rng = np.random.default_rng(seed)
    model, data = posed(everything(rng))
    assert model.nmocap > 0
    assert model.nq > 0
    caster = RayCaster(model, ALL, range=8.0)
    kinds = set()
    for _ in range(3):
        rays = random_rays(rng, 700, data.geom_xpos)
        ids = assert_as_mujoco(model, data, caster, *rays, 8.0)
        kinds |= set(model.geom_type[ids[ids >= 0]].tolist())
        data.mocap_pos[:] += rng.normal(size=data.mocap_pos.shape)
        data.qpos[:] = rng.uniform(-3, 3, model.nq)
        mujoco.mj_kinematics(model, data)
    assert kinds == set(model.geom_type.tolist())


@pytest.mark.parametrize("seed", range(4))
def test_axis_parallel_rays(seed):
    """Two components are exactly 0, here in the world and, where nothing is turned, everywhere."""
    rng = np.random.default_rng(seed)
    geoms = "".join(
        f'<geom type="{shape}" size="0.5 0.4 0.3" pos="{numbers(rng.normal(size=3) * 2)}"/>'
        for shape in (*PRIMITIVES, "plane")
    )
    model, data = posed(geoms + '<geom type="mesh" mesh="wedge"/>')
    origins = rng.normal(size=(600, 3))
    directions = np.eye(3)[rng.integers(0, 3, 600)] * rng.choice([-1.0, 1.0], (600, 1))
    ids = assert_as_mujoco(model, data, RayCaster(model, ALL, 50.0), origins, directions, 50.0)
    assert (ids >= 0).sum() > 60


def test_many_geoms_and_far_starts():
    rng = np.random.default_rng(0)
    model = mujoco.MjModel.from_xml_string(clutter(300, moving=20))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    origins, directions = random_rays(rng, 1000, data.geom_xpos)
    origins[:500] -= 100.0 * directions[:500]
    ids = assert_as_mujoco(model, data, RayCaster(model, ALL, 200.0), origins, directions, 200.0)
    assert (ids >= 0).sum() > 500


def test_a_tie_goes_to_the_lower_id():
    """Four boxes share the face that is met; a mesh and a box do as well."""
    box = '<geom type="box" size="1 1 1"/>'
    model, data = posed(4 * box)
    ray = np.array([[0.1, 0.2, 3.0]]), np.array([[0.0, 0.0, -1.0]])
    assert [int(x[0]) for x in RayCaster(model, ALL, 9.0).cast(data, *ray)] == [2, 0]


@pytest.mark.parametrize(
    ("attributes", "seen"),
    [
        ("", True),
        ('rgba="1 1 1 0"', False),
        ('material="glass"', False),
        ('material="glass" rgba="1 1 1 1"', False),
        ('group="2"', False),
        ('group="3"', True),
    ],
)
@pytest.mark.parametrize("shape", ['type="sphere" size="0.5"', 'type="mesh" mesh="wedge"'])
def test_groups_and_alpha(shape, attributes, seen):
    head = HEAD.replace("<asset>", '<asset><material name="glass" rgba="1 1 1 0"/>')
    model, data = posed(f"<geom {shape} {attributes}/>", head)
    groups = ALL.copy()
    groups[2] = 0
    caster = RayCaster(model, groups, 9.0)
    direction = np.array([[0.1, 0.2, -1.0]]) / np.sqrt(1.05)
    origins = data.geom_xpos - 3.0 * direction
    ids = assert_as_mujoco(model, data, caster, origins, direction, 9.0, groups)
    assert (ids[0] == 0) == seen


def test_nothing_to_meet_and_no_rays():
    model, data = posed("")
    distance, ids = RayCaster(model, ALL, 9.0).cast(data, np.zeros((2, 3)), np.eye(3)[:2])
    assert distance.tolist() == [-1.0, -1.0]
    assert ids.tolist() == [-1, -1]
    assert len(RayCaster(model, ALL, 9.0).cast(data, np.empty((0, 3)), np.empty((0, 3)))[0]) == 0


@pytest.mark.parametrize(
    ("origin", "direction", "message"),
    [
        ([0, 0, 0], [0, 0, 0], "direction 1: got length 0, expected 1"),
        ([0, 0, 0], [0, 0, 2], "direction 1: got length 2, expected 1"),
        ([0, 0, 0], [0, 0, np.nan], "direction 1: got length nan, expected 1"),
        ([0, 0, 0], [0, 0, np.inf], "direction 1: got length inf, expected 1"),
        ([0, np.inf, 0], [0, 0, 1], "origin 1: got .*inf.*, expected finite numbers"),
        ([np.nan, 0, 0], [0, 0, 1], "origin 1: got .*nan.*, expected finite numbers"),
    ],
)
def test_a_ray_that_is_none_is_refused(origin, direction, message):
    model, data = posed("")
    caster = RayCaster(model, ALL, 9.0)
    with pytest.raises(ValueError, match=message):
        caster.cast(
            data, np.array([[0, 0, 0], origin], float), np.array([[1, 0, 0], direction], float)
        )


def test_shapes_ranges_and_sdfs_are_refused():
    model, data = posed("")
    with pytest.raises(ValueError, match=r"rays: got origins \(2, 3\) and directions \(1, 3\)"):
        RayCaster(model, ALL, 9.0).cast(data, np.zeros((2, 3)), np.eye(3)[:1])
    for limit in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"range: got .*, expected a finite length > 0 m"):
            RayCaster(model, ALL, limit)
    with pytest.raises(ValueError, match=r"group_mask: got shape \(2,\), expected \(6,\)"):
        RayCaster(model, ALL[:2], 9.0)
    model, _ = posed('<geom name="blob" type="sdf" mesh="wedge"/>')
    with pytest.raises(
        ValueError, match="geom 'blob': got shape sdf, expected a primitive, a mesh"
    ):
        RayCaster(model, ALL, 9.0)


def test_the_same_rays_give_the_same_bits_in_any_company():
    rng = np.random.default_rng(4)
    model, data = posed(everything(rng))
    origins, directions = random_rays(rng, 400, data.geom_xpos)
    whole = RayCaster(model, ALL, 9.0).cast_with_normals(data, origins, directions)
    order = rng.permutation(400)
    caster = RayCaster(model, ALL, 9.0)
    mixed = caster.cast_with_normals(data, origins[order], directions[order])
    for one, other in zip(whole, mixed, strict=True):
        assert one[order].tobytes() == other.tobytes()


def test_compiled_kernels_equal_their_python(monkeypatch):
    rng = np.random.default_rng(8)
    model, data = posed(everything(rng))
    origins, directions = random_rays(rng, 40, data.geom_xpos)
    compiled = RayCaster(model, ALL, 9.0).cast(data, origins, directions)
    interpret_kernels(monkeypatch, "wayproof.harness.bench.raycast")
    with np.errstate(all="ignore"):
        interpreted = RayCaster(model, ALL, 9.0).cast(data, origins, directions)
    assert (compiled[1] >= 0).sum() > 15
    for one, other in zip(compiled, interpreted, strict=True):
        assert one.tobytes() == other.tobytes()
