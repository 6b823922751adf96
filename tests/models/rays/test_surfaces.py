"""Meshes and height fields under trees, against MuJoCo's own rays."""

import mujoco
import numpy as np
import pytest

from tests.models.interpreting import interpret_kernels
from tests.models.rays.cast import ALL
from wayproof.models.rays import TileCaster, cut_scattered

MESH, HEIGHT_FIELD = mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD
STAR = 24  # points about the axis of the non-convex solid


def star(rng):
    """A closed, non-convex solid: a ragged double cone about an axis beside the origin."""
    angle = 2.0 * np.pi * np.arange(STAR) / STAR
    radius = np.where(np.arange(STAR) % 2, 0.4, 1.0) * rng.uniform(0.8, 1.2, STAR)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(STAR)])
    vertices = np.concatenate([ring, [[0.0, 0.0, 0.7], [0.1, 0.1, -0.5]]])
    vertices += np.array([0.3, -0.2, 0.4])
    here, there = np.arange(STAR), (np.arange(STAR) + 1) % STAR
    top = np.column_stack([here, there, np.full(STAR, STAR)])
    bottom = np.column_stack([there, here, np.full(STAR, STAR + 1)])
    return vertices, np.concatenate([top, bottom])


def add_mesh(spec, name, vertices, faces, **options):
    mesh = spec.add_mesh(name=name, **options)
    mesh.uservert, mesh.userface = np.ravel(vertices), np.ravel(faces)


def add_hills(spec, name, rows, columns, size, heights):
    field = spec.add_hfield(name=name, nrow=rows, ncol=columns, size=size)
    field.userdata = np.ravel(heights)


def add_geom(body, asset, kind, **options):
    name = {"meshname": asset} if kind == MESH else {"hfieldname": asset}
    return body.add_geom(type=kind, **name, **options)


def posed(spec):
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def rugged(rng):
    """One of each: meshes stretched, mirrored, offset, sharing an asset; fields high and flat."""
    spec = mujoco.MjSpec()
    add_mesh(spec, "star", *star(rng))
    add_mesh(spec, "long", *star(rng), scale=[0.5, 1.5, 2.0])
    add_mesh(spec, "mirrored", *star(rng), scale=[-1.0, 0.7, 1.0], refpos=[0.4, 0.1, 0.0])
    add_hills(spec, "hills", 7, 5, [1.5, 1.0, 0.8, 0.3], rng.uniform(0.0, 1.0, 35))
    add_hills(spec, "flat", 2, 3, [0.8, 1.2, 0.5, 0.2], np.zeros(6))
    for index, asset in enumerate(["star", "long", "mirrored", "star", "hills", "flat", "hills"]):
        kind = HEIGHT_FIELD if asset in ("hills", "flat") else MESH
        pose = {"pos": 3.0 * rng.normal(size=3), "quat": rng.normal(size=4)}
        add_geom(spec.worldbody, asset, kind, name=f"g{index}", **pose)
    return spec


def random_rays(rng, count, spread=4.0, about=((0.0, 0.0, 0.0),)):
    """From anywhere to near one of the points (k, 3)."""
    origins = spread * rng.normal(size=(count, 3))
    aims = np.asarray(about)[rng.integers(0, len(about), count)]
    directions = aims - origins + rng.normal(size=(count, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def cast_rays(model, data, origins, directions, limit=30.0):
    """Hits of world rays, each a beam of its own scan pose."""
    count = len(origins)
    pattern, turns = cut_scattered(directions, np.arange(count)), np.tile(np.eye(3), (count, 1, 1))
    return TileCaster(model, ALL, limit).cast(data, pattern, origins, turns)


def by_mj_ray(model, data, origins, directions, limit=30.0):
    distance, ids = np.full(len(origins), -1.0), np.full(len(origins), -1, np.int32)
    geom = np.zeros(1, np.int32)
    for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        found = mujoco.mj_ray(model, data, origin, direction, ALL, 1, -1, geom)
        if 0.0 <= found <= limit:
            distance[ray], ids[ray] = found, geom[0]
    return distance, ids


def assert_as_mujoco(model, data, origins, directions, least_hits):
    distance, ids = cast_rays(model, data, origins, directions)
    expected, expected_ids = by_mj_ray(model, data, origins, directions)
    np.testing.assert_array_equal(ids, expected_ids)
    assert np.abs(distance - expected).max() <= 1e-9
    assert (ids >= 0).sum() >= least_hits


@pytest.mark.parametrize("seed", range(3))
def test_rugged_scenes_as_mujoco_casts_them(seed):
    rng = np.random.default_rng(seed)
    model, data = posed(rugged(rng))
    rays = random_rays(rng, 1500, about=data.geom_xpos)
    assert_as_mujoco(model, data, *rays, least_hits=300)


@pytest.mark.parametrize("asset", ["star", "hills"])
def test_starts_inside(asset):
    """From the middle of a solid everything is met from behind, a height field's base too."""
    rng = np.random.default_rng(5)
    spec = mujoco.MjSpec()
    add_mesh(spec, "star", *star(rng))
    add_hills(spec, "hills", 6, 6, [1.0, 1.0, 1.0, 1.0], rng.uniform(0.5, 1.0, 36))
    add_geom(spec.worldbody, asset, MESH if asset == "star" else HEIGHT_FIELD)
    model, data = posed(spec)
    _, directions = random_rays(rng, 500)
    for origin in ([0.0, 0.0, 0.05], [0.05, 0.0, -0.05], [0.0, 0.02, 0.0]):
        origins = np.tile(data.geom_xpos[0] + origin, (500, 1))
        assert_as_mujoco(model, data, origins, directions, 500)


@pytest.mark.parametrize(
    ("origin", "direction", "expected"),
    [
        ((0.5, 0.25, 3), (0, 0, -1), 2.25),  # on the ramp, whose height there is 0.75
        ((0, 0, 3), (0, 0, -1), 2.5),
        ((3, 0.1, 0.9), (-1, 0, 0), 2.0),  # the wall at the high end
        ((3, 0.1, 1.1), (-1, 0, 0), -1.0),  # over it
        ((-3, 0.1, 0.1), (1, 0, 0), 2.2),  # over the low end, onto the ramp
        ((0, 3, 0.2), (0, -1, 0), 2.0),  # a side wall, below its crest
        ((-0.9, 3, 0.2), (0, -1, 0), -1.0),  # and above
        ((0, 3, -0.2), (0, -1, 0), 2.0),  # the base
        ((0, 0, -3), (0, 0, 1), 2.5),  # the base from below
        ((0, 0, -0.4), (0, 0, 1), 0.4),  # inside the base: its top is met, under the ground too
        ((0, 0, 0.2), (0, 0, -1), 0.2),
        ((0, 0, 0.2), (0, 0, 1), 0.3),  # the ground from below
        ((5, 5, 5), (0, 0, -1), -1.0),
    ],
)
def test_a_ramp_by_hand(origin, direction, expected):
    """From height 0 at x = -1 to 1 at x = 1, on a base of 0.5 m."""
    spec = mujoco.MjSpec()
    add_hills(spec, "ramp", 2, 3, [1.0, 1.0, 1.0, 0.5], [0.0, 0.5, 1.0, 0.0, 0.5, 1.0])
    add_geom(spec.worldbody, "ramp", HEIGHT_FIELD)
    model, data = posed(spec)
    rays = np.array([origin], float), np.array([direction], float)
    assert cast_rays(model, data, *rays)[0][0] == pytest.approx(expected, abs=1e-12)
    assert by_mj_ray(model, data, *rays)[0][0] == pytest.approx(expected, abs=1e-12)


def test_grazing_rays():
    """Close over a height field, and past a mesh so closely that some hit its rim and some miss."""
    rng = np.random.default_rng(2)
    spec = mujoco.MjSpec()
    add_mesh(spec, "star", *star(rng))
    add_hills(spec, "hills", 30, 30, [5.0, 5.0, 0.1, 0.1], rng.uniform(0.0, 1.0, 900))
    add_geom(spec.worldbody, "star", MESH, pos=[0, 0, 3])
    add_geom(spec.worldbody, "hills", HEIGHT_FIELD)
    model, data = posed(spec)
    origins = np.column_stack([np.full(2000, -6.0), rng.uniform(-5, 5, (2000, 1)), [0.1] * 2000])
    directions = np.column_stack([np.ones(2000), 0.05 * rng.normal(size=(2000, 2))])
    directions[:, 2] *= 0.1
    corners = data.geom_xpos[0] + model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T
    towards = corners[rng.integers(0, len(corners), 2000)] + 1e-3 * rng.normal(size=(2000, 3))
    starts = towards + 4.0 * rng.normal(size=(2000, 3))
    origins = np.concatenate([origins, starts])
    directions = np.concatenate([directions, towards - starts])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, ids = cast_rays(model, data, origins, directions)
    assert 0.2 < (ids[2000:] == 0).mean() < 0.9
    assert 0.2 < (ids[:2000] == 1).mean() < 0.9
    assert_as_mujoco(model, data, origins, directions, 1500)


def test_no_gap_between_triangles():
    """Rays straight at edges and corners of a closed solid from inside: none may leave it."""
    rng = np.random.default_rng(11)
    spec = mujoco.MjSpec()
    add_mesh(spec, "star", *star(rng))
    add_geom(spec.worldbody, "star", MESH, pos=[0.1, 0.2, 0.3], quat=[0.9, 0.1, 0.3, 0.2])
    model, data = posed(spec)
    R, position = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    corners = position + model.mesh_vert.astype(float) @ R.T
    a, b = corners[model.mesh_face[:, 0]], corners[model.mesh_face[:, 1]]
    share = rng.uniform(size=(40, len(a), 1))
    targets = np.concatenate([corners, (share * a + (1.0 - share) * b).reshape(-1, 3)])
    origins = np.tile(position, (len(targets), 1))
    directions = targets - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, ids = cast_rays(model, data, origins, directions)
    assert (ids == 0).all()


def test_what_moves_is_met_where_it_is():
    """By mocap and by a joint, beside what stands; the same asset in three places."""
    rng = np.random.default_rng(3)
    spec = mujoco.MjSpec()
    add_mesh(spec, "star", *star(rng))
    carried = spec.worldbody.add_body(name="carried", mocap=True)
    hung = spec.worldbody.add_body(name="hung", pos=[2, 0, 0])
    hung.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], pos=[-2, 0, 0])
    for body in (spec.worldbody, carried, hung):
        add_geom(body, "star", MESH, quat=rng.normal(size=4))
    model, data = posed(spec)
    caster = TileCaster(model, ALL, 30.0)
    first = random_rays(np.random.default_rng(0), 800, 3.0)
    pattern, turns = cut_scattered(first[1], np.arange(800)), np.tile(np.eye(3), (800, 1, 1))
    before = caster.cast(data, pattern, first[0], turns)[0]
    for _ in range(3):
        data.mocap_pos[0], data.mocap_quat[0] = rng.normal(size=3), [0.6, 0.0, 0.8, 0.0]
        data.qpos[0] = rng.uniform(-3, 3)
        mujoco.mj_kinematics(model, data)
        assert_as_mujoco(model, data, *random_rays(rng, 800, 3.0), least_hits=100)
    after = caster.cast(data, pattern, first[0], turns)[0]
    assert after.tobytes() == cast_rays(model, data, *first)[0].tobytes()
    assert (before != after).sum() > 50


def test_of_equal_hits_the_lower_id_wins_also_among_primitives():
    spec = mujoco.MjSpec()
    add_hills(spec, "flat", 2, 2, [1.0, 1.0, 1.0, 1.0], np.zeros(4))
    places = [[0, 0, 0], [0, 0, 0], [5, 0, 0], [5, 0, 0]]
    for number, place in enumerate(places):
        if number in (0, 1, 3):
            add_geom(spec.worldbody, "flat", HEIGHT_FIELD, pos=place)
        else:
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], pos=place)
    model, data = posed(spec)
    origins, directions = (
        np.array([[0.2, 0.1, 2.0], [5.2, 0.1, 2.0]]),
        np.tile([0.0, 0, -1], (2, 1)),
    )
    distance, ids = cast_rays(model, data, origins, directions)
    assert distance.tolist() == [2.0, 2.0]
    assert ids.tolist() == [0, 2]


@pytest.mark.parametrize(("limit", "expected"), [(2.0, 2.0), (1.9999, -1.0)])
def test_range(limit, expected):
    spec = mujoco.MjSpec()
    add_hills(spec, "flat", 2, 2, [1.0, 1.0, 1.0, 1.0], np.zeros(4))
    add_geom(spec.worldbody, "flat", HEIGHT_FIELD)
    rays = np.array([[0.2, 0.1, 2.0]]), np.array([[0.0, 0.0, -1.0]])
    assert cast_rays(*posed(spec), *rays, limit)[0][0] == expected


def test_compiled_kernels_equal_their_python(monkeypatch):
    rng = np.random.default_rng(6)
    model, data = posed(rugged(rng))
    origins, directions = random_rays(rng, 21)
    compiled = cast_rays(model, data, origins, directions)
    interpret_kernels(monkeypatch, "wayproof.models.rays")
    with np.errstate(all="ignore"):
        interpreted = cast_rays(model, data, origins, directions)
    assert (compiled[1] >= 0).sum() > 5
    for one, other in zip(compiled, interpreted, strict=True):
        assert one.tobytes() == other.tobytes()


def test_rays_meet_triangles_as_plain_algebra_does():
    """Each ray and triangle solved as three linear equations."""
    rng = np.random.default_rng(9)
    corners = rng.normal(size=(40, 3, 3))
    spec = mujoco.MjSpec()
    add_mesh(
        spec, "loose", corners, np.arange(120), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    )
    add_geom(spec.worldbody, "loose", MESH)
    model, data = posed(spec)
    R, position = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    corners = position + model.mesh_vert[model.mesh_face].astype(float) @ R.T  # (40, 3, 3)
    origins, directions = random_rays(rng, 300, 1.0)
    naive = np.full(300, np.inf)
    for ray, (o, d) in enumerate(zip(origins, directions, strict=True)):
        for a, b, c in corners:
            x, u, v = np.linalg.solve(np.column_stack([-d, b - a, c - a]), o - a)
            if x >= 0.0 and u >= 0.0 and v >= 0.0 and u + v <= 1.0:
                naive[ray] = min(naive[ray], x)
    distance, ids = cast_rays(model, data, origins, directions)
    assert ((ids == 0) == np.isfinite(naive)).all()
    assert np.abs(distance - naive)[ids == 0].max() < 1e-9
    assert (ids == 0).sum() > 100
