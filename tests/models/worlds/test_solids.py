"""Solids against MuJoCo: where its distance, its rays and its bounds say they are."""

from math import pi, sqrt

import mujoco
import numpy as np
import pytest

from wayproof.models.classes import CLASSES
from wayproof.models.worlds import (
    Box,
    Capsule,
    Cylinder,
    HeightField,
    Mover,
    Sphere,
    TriangleMesh,
    World,
)
from wayproof.models.worlds.solids.surfaces import distance_to_triangles

RNG = np.random.default_rng(3)
TETRAHEDRON = TriangleMesh(
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
    "structure",
)
GROUND = HeightField.from_array(
    (1.0, -1.0, 0.2), (0.5, 0.4), RNG.uniform(0.0, 0.6, (5, 4)), "floor"
)
SOLIDS = {
    "box": Box((1.0, 2.0, 0.4), (0.5, 0.2, 0.4), 0.7, "crate"),
    "turned box": Box((1.0, 2.0, 1.4), (0.5, 0.2, 0.4), 0.7, "bar", pitch=0.4, roll=-1.1),
    "cylinder": Cylinder((1.0, 2.0, 0.0), (1.0, 2.0, 2.0), 0.3, "trunk"),
    "lying cylinder": Cylinder((1.0, 2.0, 1.0), (2.0, 2.5, 1.4), 0.3, "bar"),
    "capsule": Capsule((1.0, 2.0, 1.0), (2.0, 2.5, 1.4), 0.2, "branch"),
    "sphere": Sphere((1.0, 2.0, 0.8), 0.6, "hedge"),
    "mesh": TETRAHEDRON,
    "height field": GROUND,
}
CONVEX = [name for name in SOLIDS if name not in ("mesh", "height field")]


def world_of(*solids, **fields):
    named = {"name": "test", "seed": 0, "low": (-9.0, -9.0, -0.5), "high": (9.0, 9.0, 3.0)}
    ends = {"start": (-8.0, 0.0, 0.0), "start_heading": 0.0, "goal": (8.0, 0.0, 0.0)}
    return World(**named, **ends, solids=solids, **fields)


def compiled(world):
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("name", CONVEX)
def test_distance_is_that_of_a_tiny_sphere_in_mujoco(name):
    solid = SOLIDS[name]
    spec = mujoco.MjSpec.from_string(world_of(solid).mjcf())
    probe = spec.worldbody.add_body(name="probe", mocap=True)
    probe.add_geom(name="probe", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-6, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    points = RNG.uniform([-1.0, 0.0, -1.0], [3.0, 4.0, 3.0], (60, 3))
    for point, distance in zip(points, solid.distance(points), strict=True):
        data.mocap_pos[0] = point
        mujoco.mj_kinematics(model, data)
        geoms = model.geom("probe").id, model.geom(f"{solid.kind}_0").id
        measured = mujoco.mj_geomDistance(model, data, *geoms, 9.0, np.zeros(6))
        assert distance == pytest.approx(max(measured, 0.0), abs=1e-4)


@pytest.mark.parametrize("name", SOLIDS)
def test_rays_end_on_the_solid(name):
    """Every ray of MuJoCo's ends at distance 0 and is outside before."""
    solid = SOLIDS[name]
    model, data = compiled(world_of(solid))
    middle, hits = np.add(solid.low, solid.high) / 2, 0
    for beam in RNG.normal(size=(80, 3)):
        direction = np.array([*beam[:2], abs(beam[2])]) / np.linalg.norm(beam)
        origin = middle + 4.0 * direction
        target = middle + RNG.uniform(-0.3, 0.3, 3)
        direction = (target - origin) / np.linalg.norm(target - origin)
        geom = np.zeros(1, np.int32)
        length = mujoco.mj_ray(model, data, origin, direction, None, 1, -1, geom)
        if geom[0] != model.geom(f"{solid.kind}_0").id:
            continue
        hits += 1
        ends = origin + np.outer([length, length - 0.01], direction)
        if ends[0][2] > solid.bottom + 1e-6 and name == "height field":
            inner = np.abs(ends[0][:2] - middle[:2]) < np.subtract(solid.high, middle)[:2] - 1e-6
            if not inner.all():
                continue  # its side, which counts as no ground from outside
        at, before = solid.distance(ends)
        assert at < 1e-6
        assert before > 0.0
    assert hits > 20


@pytest.mark.parametrize("name", SOLIDS)
def test_bounds_hold_the_solid_and_touch_it(name):
    solid = SOLIDS[name]
    low, high = np.array(solid.low), np.array(solid.high)
    assert (solid.bottom, solid.top) == (low[2], high[2])
    points = RNG.uniform(low - 0.5, high + 0.5, (4000, 3))
    near = points[solid.distance(points) == 0.0]
    assert ((near >= low) & (near <= high)).all()
    axis = {"box": 0, "mesh": 0}.get(name)
    if axis is not None:
        beyond = np.array([[high[0] + 1.0, y, z] for y in (low[1], high[1]) for z in (0.0, 0.4)])
        assert solid.distance(beyond).min() >= 1.0 - 1e-9


@pytest.mark.parametrize("name", SOLIDS)
def test_the_footprint_is_never_farther_than_the_solid(name):
    solid = SOLIDS[name]
    points = RNG.uniform([-1.0, -1.0, 0.0], [3.0, 4.0, 3.0], (500, 3))
    in_plane = solid.distance_in_plane(points[:, :2], (0.0, 3.0))
    assert (in_plane <= solid.distance(points) + 1e-9).all()


def test_a_band_takes_the_part_of_a_leaning_bar_that_stands_in_it():
    bar = Capsule((0.0, 0.0, 0.0), (2.0, 0.0, 2.0), 0.1, "bar")
    point = [(2.0, 0.0)]
    # Up to 0.5 m and a radius along its axis, then its radius.
    assert bar.distance_in_plane(point, (0.0, 0.5))[0] == pytest.approx(2.0 - 0.6 - 0.1)
    assert bar.distance_in_plane(point, (0.0, 2.0))[0] == 0.0


def test_hand_computed_distances():
    cylinder = Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, "pole")
    points = [(1.5, 0.0, 0.5), (0.0, 0.0, 1.2), (0.8, 0.0, 1.4), (0.1, 0.1, 0.5)]
    assert cylinder.distance(points) == pytest.approx([1.0, 0.2, 0.5, 0.0])
    assert cylinder.distance_in_plane([(0.3, 1.5)], (0.0, 1.0)) == pytest.approx([sqrt(2.34) - 0.5])
    box = Box((0.0, 0.0, 1.0), (1.0, 0.1, 0.1), 0.0, "bar", pitch=-pi / 2)  # stands on its end
    assert (box.bottom, box.top) == pytest.approx((0.0, 2.0))
    assert box.distance([(1.1, 0.0, 1.9), (0.0, 0.0, 2.5)]) == pytest.approx([1.0, 0.5])
    assert TETRAHEDRON.distance([(1.0, 1.0, 1.0), (0.2, 0.2, -0.3)]) == pytest.approx(
        [2.0 / sqrt(3.0), 0.3]
    )


def test_triangles_match_a_dense_sampling():
    for dimensions in (2, 3):
        triangle = RNG.uniform(-1.0, 1.0, (1, 3, dimensions))
        points = RNG.uniform(-2.0, 2.0, (100, dimensions))
        share = RNG.dirichlet(np.ones(3), 20000)
        naive = np.linalg.norm(points[:, None] - (share @ triangle[0])[None], axis=2).min(axis=1)
        exact = distance_to_triangles(points, triangle)
        assert (exact <= naive + 1e-12).all()
        assert (naive <= exact + 0.05).all()


def test_every_geom_carries_its_class():
    world = world_of(
        *SOLIDS.values(), movers=(Mover("walker", (SOLIDS["capsule"],), ((0, 0, 0),)),)
    )
    model, _ = compiled(world)
    classes = {model.geom(i).name: CLASSES[int(model.geom_user[i, 0])] for i in range(model.ngeom)}
    assert classes["floor"] == classes["floor_0"] == "floor"
    assert classes["crate_0"] == "crate"
    assert classes["trunk_0"] == "vegetation"
    assert classes["walker/0"] == "vegetation"
    assert model.body("walker").mocapid[0] == 0


def test_a_hole_stops_a_walking_body_and_not_a_flying_one():
    from wayproof.models.worlds import is_solvable

    slabs = (
        Box.between((-9.0, -9.0, -0.3), (-1.0, 9.0, 0.0), "floor"),
        Box.between((1.0, -9.0, -0.3), (9.0, 9.0, 0.0), "floor"),
    )
    ends = ((-8.0, 0.0), (8.0, 0.0))
    holed = world_of(floor=slabs)
    assert not is_solvable(holed, 0.4, (0.03, 0.5), *ends)
    assert is_solvable(holed, 0.4, (0.8, 1.6), *ends)
    bridge = Box.between((-1.0, -0.5, -0.3), (1.0, 0.5, 0.0), "floor")
    bridged = world_of(floor=(*slabs, bridge))
    assert is_solvable(bridged, 0.4, (0.03, 0.5), *ends)
    assert not is_solvable(bridged, 0.55, (0.03, 0.5), *ends)
    model, _ = compiled(bridged)
    assert [model.geom(i).name for i in range(model.ngeom)] == ["floor_0", "floor_1", "floor_2"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Sphere((0.0, 0.0, 0.0), 0.0, "x"), "radius: got 0"),
        (lambda: Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1, "x"), "head: got"),
        (lambda: TriangleMesh(((0.0, 0.0, 0.0),), ((0, 0, 0),), "x"), "vertices: got 1"),
        (lambda: TriangleMesh(TETRAHEDRON.vertices, ((0, 1, 4),), "x"), "faces: expected"),
        (lambda: HeightField((0, 0, 0), (1, 1), ((0.0,),), "x"), "heights: expected"),
        (lambda: HeightField((0, 0, 0), (0, 1), ((0, 0), (0, 0)), "x"), "spacing, base: got"),
    ],
)
def test_bad_solids_are_refused_in_one_line(make, said):
    with pytest.raises(ValueError, match=said):
        make()
