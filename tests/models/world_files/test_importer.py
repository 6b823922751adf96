"""Foreign files become worlds that beams meet exactly where the file says, or one clear line."""

import contextlib
import json

import mujoco
import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from tests.models.world_files.written import (
    MAP,
    PILLAR,
    SDF,
    TETRAHEDRON,
    imported,
    one_ray,
    sdf,
    write,
)
from wayproof.models.world_files import ImportOptions, WorldFileError, read_world_file
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.parts import Part, quaternion_of, rotation_of, turned_by
from wayproof.models.world_files.solids import solid_of
from wayproof.models.worlds import WORLDS
from wayproof.models.worlds.solids import TriangleMesh


def cast(mjcf, count=400, seed=0, low=(-4.0, -4.0, 0.05), high=(6.0, 4.0, 2.0)):
    """Distances of seeded rays in a scene, -1 for a miss."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rng = np.random.default_rng(seed)
    distances = []
    for origin, ray in zip(
        rng.uniform(low, high, (count, 3)), rng.normal(size=(count, 3)), strict=True
    ):
        ray /= np.linalg.norm(ray)
        hit = np.zeros(1, np.int32)
        distances.append(mujoco.mj_ray(model, data, origin, ray, None, 1, -1, hit))
    return np.array(distances)


@pytest.mark.parametrize("name", WORLDS)
def test_a_saved_world_gives_the_same_rays(tmp_path, name):
    saved = drawn(name, 3)
    path = write(tmp_path, "hall.xml", saved.mjcf())
    world = import_world(path, None, saved.start, saved.goal)[0]
    low, high = np.add(saved.low, (0.5, 0.5, 0.6)), np.subtract(saved.high, (0.5, 0.5, 0.1))
    ours, theirs = (cast(text, low=low, high=high) for text in (world.mjcf(), saved.mjcf()))
    assert (theirs >= 0.0).sum() > 200
    meshes = any(isinstance(solid, TriangleMesh) for solid in saved.solids)
    near = 1e-8 if meshes else 1e-9  # MuJoCo keeps vertices in single precision
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=near)
    fixed = len(saved.solid_names)
    moving = [name for mover in saved.movers for name in mover.solid_names]
    assert world.solid_names[:fixed] == saved.solid_names
    assert len(world.solid_names) == fixed + len(moving)


def test_a_world_file_reads_back_as_the_same_world(tmp_path):
    world = imported(sdf(tmp_path, PILLAR.format(pose="2 0.1 0 0 0 0.3")))
    path = write(tmp_path, "some.xml", world.text)
    again = read_world_file(path)
    assert again == world
    assert again.identity == world.identity
    renamed = import_world(write(tmp_path, "some.mjcf", world.text))[0]
    np.testing.assert_array_equal(cast(renamed.mjcf()), cast(world.mjcf()))
    assert (renamed.start, renamed.goal, renamed.low) == (world.start, world.goal, world.low)


@pytest.mark.parametrize("seed", range(3))
def test_numbers_survive_to_the_last_bit(tmp_path, seed):
    rng = np.random.default_rng(seed)
    rows = [
        f"rpg, {x}, {y}, {z}, 1, 0, 0, 0, {d}, {d}, {d}"
        for x, y, z, d in rng.uniform(0.5, 5.0, (20, 4)).tolist()
    ]
    world = imported(write(tmp_path, "field.csv", "\n".join(rows)))
    read = [[*sphere.centre, 2.0 * sphere.radius] for sphere in world.solids]
    expected = [[float(row.split(",")[n]) for n in (1, 2, 3, 8)] for row in rows]
    assert read == expected


def test_a_mesh_comes_in_connected_pieces(tmp_path):
    pytest.importorskip("trimesh")
    moved = "".join(
        f"v {float(x) + 3} {y} {z}\n" for _, x, y, z in map(str.split, TETRAHEDRON.split("\n")[:4])
    )
    faces = "f 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n"
    world = imported(write(tmp_path, "two.obj", TETRAHEDRON + moved + faces), scale=2.0)
    lows = [solid.low for solid in world.solids]
    np.testing.assert_allclose(lows, [(0.0, 0.0, 0.0), (6.0, 0.0, 0.0)], atol=1e-6)
    assert one_ray(world, (0.2, 0.2, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(1.4, abs=1e-6)
    with pytest.raises(WorldFileError, match=r"no\.obj: "):
        imported(write(tmp_path, "no.obj", "nothing"))


def test_heights_rise_where_the_array_says(tmp_path):
    np.save(tmp_path / "h.npy", np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))  # high at x 2, y 1
    world = imported(tmp_path / "h.npy", resolution=1.0)
    assert one_ray(world, (1.999, 0.999, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(2.0, abs=0.01)
    assert one_ray(world, (0.1, 0.9, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(3.0, abs=0.01)
    assert world.solids == ()  # ground, to be stepped on
    np.save(tmp_path / "f.npy", np.zeros((3, 3)))
    flat = import_world(tmp_path / "f.npy", ImportOptions(resolution=4.0))[0]
    assert flat.floor is not None
    assert one_ray(flat, (4.0, 4.0, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(3.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.txt", "x", r"unknown format '\.txt' \(available: \.xml"),
        ("a.csv", "", "empty file"),
        ("a.csv", "a,1,2", r"a\.csv:1: 3 columns"),
        ("a.csv", "a,0,0,0,1,0,0,0,1,2,1", r"a\.csv:1: a sphere of 1 x 2 x 1 m"),
        ("a.npy", "x", "no array"),
        ("a.world", b"\xff\xfe", "no UTF-8"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, name, text, said):
    with pytest.raises(WorldFileError, match=said) as error:
        imported(write(tmp_path, name, text))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seed", range(3))
def test_quaternions_turn_as_their_matrix(seed):
    angles = np.random.default_rng(seed).uniform(-np.pi, np.pi, 3)
    R = turned_by(*angles)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation_of(quaternion_of(R)), R, atol=1e-14)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, R.ravel())
    assert abs(quaternion @ quaternion_of(R)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("shape", ["box", "cylinder", "capsule", "sphere"])
@pytest.mark.parametrize("pitch", [0.0, 0.7, np.pi / 2])
def test_a_part_and_its_solid_are_the_same(shape, pitch):
    sizes = {
        "box": (0.3, 0.2, 0.5),
        "cylinder": (0.2, 0.5),
        "capsule": (0.2, 0.5),
        "sphere": (0.4,),
    }
    turn = quaternion_of(turned_by(0.3, pitch, 1.1))
    part = Part(shape, sizes[shape], (1.0, 0.5, 0.9), turn)
    solid = solid_of(part)
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><geom type='{shape}' size='{' '.join(map(str, part.size))}' "
        f"pos='1 .5 .9' quat='{' '.join(map(str, turn))}'/>"
        "<body mocap='true'><geom size='.001'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    points = np.random.default_rng(2).uniform(-1.0, 3.0, (40, 3))
    for point, distance in zip(points, solid.distance(points), strict=True):
        data.mocap_pos[0] = point
        mujoco.mj_kinematics(model, data)
        near = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, np.zeros(6))
        assert distance == pytest.approx(max(near + 0.001, 0.0), abs=2e-3)


def test_start_and_goal_are_chosen_where_a_file_tells_none(tmp_path):
    walls = [f"w,{x},{y},0,1,0,0,0,0.2,0.2,0.2" for x in (0, 8) for y in (0, 6)]
    world, notes = import_world(write(tmp_path, "f.csv", "\n".join(walls)))
    assert [note.split(":")[0] for note in notes] == [
        "start chosen", "goal chosen", "way from start to goal",
    ]  # fmt: skip
    for point in (world.start, world.goal):
        assert world.contains_obstacle(point, 0.7) is None
    assert np.hypot(*np.subtract(world.goal, world.start)[:2]) > 7.0


def test_where_all_is_steep_the_refusal_says_so(tmp_path):
    x, y = np.meshgrid(np.arange(60), np.arange(60))
    np.save(tmp_path / "waves.npy", 0.5 * np.sin(0.5 * x) * np.sin(0.5 * y))
    with pytest.raises(WorldFileError, match=r"ground less steep than 0\.35 rad; expected --start"):
        import_world(tmp_path / "waves.npy", ImportOptions(resolution=0.1))


def test_the_file_tells_what_it_was_made_from(tmp_path):
    world = imported(sdf(tmp_path, PILLAR.format(pose="2 0 0 0 0 0"), name="a & b.world"))
    assert world.source.startswith("a & b.world, sha256 ")
    assert world.name == "a & b"
    assert json.dumps(world.low) == "[-1.0, -1.075, -0.5]"


SOUND = {
    "a.world": SDF.format(models=PILLAR.format(pose="2 0.1 0 0 0 0.3")),
    "a.csv": "s, 1, 2, 3, 1, 0, 0, 0, 1, 1, 1\n",
    "a.3dmap": "voxel 9 5 4\n4 1 0\n4 2 0\n",
    "a.yaml": MAP.format(yaw=0.5, negate=0),
    "a.xml": "<mujoco><worldbody><geom name='a_0' type='box' size='1 1 1'/></worldbody></mujoco>",
}


@pytest.mark.parametrize("name", sorted(SOUND))
def test_damaged_files_are_read_or_refused_and_nothing_else(tmp_path, name):
    write(tmp_path, "m.pgm", b"P5 3 2 255\n" + bytes([0, 254, 254, 254, 254, 205]))
    rng = np.random.default_rng(len(name))
    for _ in range(60):
        text = SOUND[name]
        for _ in range(rng.integers(1, 4)):
            at, length = int(rng.integers(len(text))), int(rng.integers(0, 12))
            new = "".join(rng.choice(list("0-9.e<>/ \n[]na"), size=rng.integers(0, 3)))
            text = text[:at] + new + text[at + length :] or "x"
        with contextlib.suppress(WorldFileError):
            imported(write(tmp_path, name, text))
