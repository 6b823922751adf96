"""Gazebo worlds become worlds: models, files, geometry, poses and kinds."""

import numpy as np
import pytest

from tests.models.world_files.gazebo_files import CUBE, box, ground, mesh, read, world, write
from wayproof.models.world_files import ImportOptions, WorldFileError
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.meshes import mesh_parts
from wayproof.models.world_files.solids import solid_of

INCLUDE = "<include><uri>{}</uri><pose>2 1 0 0 0 0</pose></include>"


FUEL = "https://fuel.gazebosim.org/1.0/Open/models/A%20Post"
PACKAGE = "<package><name>hall_worlds</name></package>"


@pytest.mark.parametrize(("name", "uri", "files"), [
    ("a.world", "model://post", {"post/model.sdf": mesh("model://post/meshes/c.obj"),
                                 "post/meshes/c.obj": CUBE}),
    ("a.world", "model://post", {"post/model.sdf": mesh("meshes/c.obj"),
                                 "post/meshes/c.obj": CUBE}),
    ("src/halls/worlds/a.world", "model://post", {
        "src/halls/package.xml": PACKAGE, "src/halls/meshes/c.obj": CUBE,
        "src/halls/models/post/model.sdf": mesh("model://hall_worlds/meshes/c.obj")}),
    ("w/a.sdf", FUEL, {
        f"{cache}/open/models/a post/{file}": text
        for cache in (".gz/fuel/fuel.gazebosim.org",)
        for file, text in (("1/model.sdf", "no model any more"), ("2/meshes/c.obj", CUBE),
                           ("2/model.sdf", mesh("meshes/c.obj")))}),
    ("w/a.sdf", FUEL, {
        ".gz/fuel/fuel.gazebosim.org/another/models/a post/1/model.sdf": "of another owner",
        ".gz/fuel/fuel.gazebosim.org/open/models/a post/1/model.sdf": mesh(f"{FUEL}/1/files/c.obj"),
        ".gz/fuel/fuel.gazebosim.org/open/models/a post/1/c.obj": CUBE}),
])  # fmt: skip
def test_models_are_found_as_their_tools_lay_them_out(tmp_path, monkeypatch, name, uri, files):
    monkeypatch.setenv("HOME", str(tmp_path))
    for file, text in files.items():
        write(tmp_path / file, text)
    found, _ = read(write(tmp_path / name, world(ground(), INCLUDE.format(uri))))
    assert [solid.low for solid in found.solids] == [(2.0, 1.0, 0.0)]


def test_models_are_found_on_the_path_of_the_user(tmp_path, monkeypatch):
    write(tmp_path / "elsewhere/post/model.sdf", mesh("model://post/c.obj"))
    write(tmp_path / "elsewhere/post/c.obj", CUBE)
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked/post").symlink_to(tmp_path / "elsewhere/post")
    path = write(tmp_path / "worlds/a.world", world(ground(), INCLUDE.format("model://post")))
    with pytest.raises(
        WorldFileError, match=r"a\.world:3: <include>: no model 'post'; expected --"
    ):
        read(path)
    for folder in ("elsewhere", "linked"):
        assert len(read(path, model_paths=(tmp_path / folder,))[0].solids) == 1
    monkeypatch.setenv("GAZEBO_MODEL_PATH", str(tmp_path / "elsewhere"))
    assert len(read(path)[0].solids) == 1


def test_what_fuel_calls_ground_and_sun_is_known(tmp_path):
    server = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/"
    uris = [INCLUDE.format(server + name) for name in ("Ground Plane", "Sun")]
    found, notes = read(write(tmp_path / "a.sdf", world(*uris, box())))
    assert found.floor is None
    assert len(found.solids) == 1
    assert not notes


def test_what_is_missing_is_listed(tmp_path):
    includes = [INCLUDE.format(f"model://{name}") for name in ("cafe", "cafe", "bar")]
    path = write(tmp_path / "a.world", world(*includes))
    with pytest.raises(
        WorldFileError, match=r"nothing solid.*model://cafe'.*'model://bar'.*--model-path with"
    ):
        read(path, skip_missing=True)
    write(tmp_path / "m.sdf", mesh("model://m/none.dae"))
    with pytest.raises(WorldFileError, match=r"m\.sdf:2: <mesh>: no file 'm/none\.dae'"):
        read(tmp_path / "m.sdf")


def test_a_file_outside_of_the_project_is_refused(tmp_path):
    write(tmp_path / "secret.obj", CUBE)
    path = write(tmp_path / "project/a.sdf", mesh("../secret.obj"))
    with pytest.raises(WorldFileError, match="lies outside the world's project"):
        read(path)
    (tmp_path / "project/link.obj").symlink_to(tmp_path / "secret.obj")
    with pytest.raises(WorldFileError, match="lies outside the world's project"):
        read(write(tmp_path / "project/b.sdf", mesh("link.obj")))


def test_blank_lines_before_the_declaration_are_no_error(tmp_path):
    text = "\n \n<?xml version='1.0'?>" + world(ground(), box())
    assert len(read(write(tmp_path / "a.world", text))[0].solids) == 1


def test_a_drawn_plane_that_is_no_floor_ends_where_it_is_drawn(tmp_path):
    sticker = ground(pose="<pose>0 3 1 1.5707963267948966 0 0</pose>").replace(
        "<size>20 20</size>", "<size>0.4 0.2</size>"
    ).replace("'ground'", "'sticker'")  # fmt: skip
    found, notes = read(write(tmp_path / "a.world", world(ground(), sticker)))
    (solid,) = found.solids
    np.testing.assert_allclose(np.subtract(solid.high, solid.low), (0.4, 0.01, 0.2), atol=1e-9)
    assert "plane of 'sticker': a box 0.4 x 0.2 x 0.01 m behind it" in notes
    level = sticker.replace("1.5707963267948966", "0")
    found, _ = read(write(tmp_path / "b.world", world(ground(), level)))
    assert found.solids[0].high[2] == pytest.approx(1.0)  # the large plane is the floor


def test_hyphens_in_a_comment(tmp_path):
    text = world("<!-- gz sim --levels\n -->", ground(), box(pose="<pose>9 0 0.5 0 0 0</pose>"))
    assert len(read(write(tmp_path / "a.world", text))[0].solids) == 1
    with pytest.raises(WorldFileError, match=r"a\.world:5: <size>"):
        read(write(tmp_path / "a.world", text.replace("<size>1 1 1</size>", "<size>1</size>")))


LINK = "<pose>1 0 0 0 0 0</pose>"
POSED = box(link="<pose>1 0 0.5 0 0 0</pose>").replace(
    "<collision name='c'>", "<collision name='c'><pose relative_to='l'>0 2 0 0 0 0</pose>"
)
PLACED = ("<include><uri>model://m</uri><placement_frame>l</placement_frame>"
          "<pose>2 2 0.5 0 0 0</pose></include>")  # fmt: skip
TURNED = f"<pose rotation_format='quat_xyzw'>1 0 0.5  0 0 {0.5**0.5} {0.5**0.5}</pose>"


@pytest.mark.parametrize(("content", "centre", "high"), [
    (POSED, (1.0, 2.0, 0.5), (1.5, 2.5, 1.0)),
    (POSED.replace("relative_to='l'", "relative_to='__model__'"), (0, 2, 0), (0.5, 2.5, 0.5)),
    (box(attribute=" placement_frame='l'", pose="<pose>0 0 0.5 0 0 0</pose>", link=LINK),
     (0.0, 0.0, 0.5), (0.5, 0.5, 1.0)),
    (PLACED, (2.0, 2.0, 0.5), (2.5, 2.5, 1.0)),
    (box(size="2 1 1", pose=TURNED), (1.0, 0.0, 0.5), (1.5, 1.0, 1.0)),
])  # fmt: skip
def test_poses_in_frames(tmp_path, content, centre, high):
    write(tmp_path / "m/model.sdf", f"<sdf version='1.7'>{box(link=LINK)}</sdf>")
    (solid,) = read(write(tmp_path / "a.world", world(ground(), content)))[0].solids
    np.testing.assert_allclose((solid.centre, solid.high), (centre, high), atol=1e-9)


def test_a_saved_state_scales_inserts_and_deletes(tmp_path):
    state = (
        "<state world_name='w'><model name='box'><pose>1 0 1 0 0 0</pose><scale>2 1 2</scale>"
        f"</model><insertions>{box('late', pose='<pose>5 0 0.5 0 0 0</pose>')}</insertions>"
        "<deletions><name>gone</name></deletions></state>"
    )
    path = write(tmp_path / "a.world", world(ground(), box(), box("gone"), state))
    found, _ = read(path)
    assert [solid.high for solid in found.solids] == [(2.0, 0.5, 2.0), (5.5, 0.5, 1.0)]


def test_planes_at_any_height_and_tilt(tmp_path):
    low = ground("<pose>0 0 -97 0 0 0</pose>")
    wall = ground("<pose>4 0 -96 0 0 0</pose>", "-1 0 0")
    found, notes = read(
        write(tmp_path / "a.world", world(low, wall, box(pose="<pose>0 3 -96.5 0 0 0</pose>")))
    )
    assert found.solids[0].centre == pytest.approx((0.0, 3.0, 0.5))
    assert found.solids[1].low[0] == pytest.approx(4.0)
    assert [note for note in notes if note.startswith("floor at -97 m")]
    assert [note for note in notes if note.startswith("plane of 'ground': a box ")]


def test_a_slab_that_ends_at_the_floor_is_the_floor(tmp_path):
    slab = box("hall", "20 20 0.2", "<pose>0 0 -0.066 0 0 0</pose>")
    path = write(tmp_path / "a.world", world(slab, box(pose="<pose>0 3 0.534 0 0 0</pose>")))
    assert read(path)[1] == ["no plane in it: floor at 0 m; --floor for another"]
    found, notes = read(path, floor=0.034)
    assert notes == ["floor at 0.034 m: the scene is moved by -0.034 m in z"]
    assert len(found.floor) == 1
    assert found.solids[0].low[2] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(WorldFileError, match=r"no such model \(available: box, hall\)"):
        read(path, kinds=(("floor", "cafe"),))


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        ("<collide_without_contact>true</collide_without_contact>", "collide_without_contact"),
        ("<collide_bitmask>0x00</collide_bitmask>", "collide_bitmask 0"),
    ],
)
def test_what_nothing_collides_with_is_left_out(tmp_path, surface, said):
    ghost = box("ghost", surface=f"<surface><contact>{surface}</contact></surface>")
    found, notes = read(write(tmp_path / "a.world", world(ground(), box(), ghost)))
    assert [solid.kind for solid in found.solids] == ["box"]
    assert notes == [f"1 collisions with {said}: left out; --visuals makes them solid"]


def test_visuals_are_solid_only_where_they_are_to_be(tmp_path):
    seen = box("marker").replace("collision", "visual")
    path = write(tmp_path / "a.world", world(ground(), box(), seen, "<actor name='walker'/>"))
    found, notes = read(path)
    assert len(found.solids) == 1
    assert any("visuals only: left out; --visuals makes them solid" in note for note in notes)
    assert notes[0].startswith("<actor> 'walker' (line ")
    assert len(read(path, visuals=True)[0].solids) == 2


def test_what_lies_below_the_floor_is_no_obstacle(tmp_path):
    """A slab drawn as its top and its bottom, 0.1 m apart, with a wall and a high roof on it."""
    sheet = "v -4 -4 {0}\nv 4 -4 {0}\nv 4 4 {0}\nv -4 4 {0}\n"
    text = sheet.format(0.0) + sheet.format(-0.1) + "f 1 2 3\nf 1 3 4\nf 5 7 6\nf 5 8 7\n"
    write(tmp_path / "m" / "s.obj", text)
    write(tmp_path / "m" / "model.sdf", mesh("s.obj"))
    slab = "<include><uri>model://m</uri></include>"
    wall = box(size="0.2 6 2", pose="<pose>1 1 1 0 0 0</pose>")
    roof = box("roof", "8 8 0.2", "<pose>0 0 3 0 0 0</pose>")
    found, notes = import_world(write(tmp_path / "a.world", world(slab, wall, roof)))
    assert not [note for note in notes if "the scene is moved" in note]
    assert [name for name in found.solid_names if not name.startswith("m_")] == ["box_0", "roof_0"]
    raised = box("slab", "8 8 0.2", "<pose>0 0 0 0 0 0</pose>")
    path = write(tmp_path / "b.world", world(ground(), raised, wall))
    moved, notes = import_world(path, ImportOptions(floor=0.1))
    assert "floor at 0.1 m: the scene is moved by -0.1 m in z" in notes
    assert moved.floor[0].high[2] == pytest.approx(0.0)
    with pytest.raises(WorldFileError, match="--floor for another"):
        import_world(path, ImportOptions(robot_radius=13.0))


def test_a_scene_far_from_its_floor_is_refused(tmp_path):
    path = write(tmp_path / "a.world", world(box(pose="<pose>0 0 12.5 0 0 0</pose>")))
    with pytest.raises(WorldFileError, match=r"solids from 12 to 13 m; expected --floor Z"):
        import_world(path)
    assert import_world(path, ImportOptions(floor=12.0))[0].solids[0].low[2] == 0.0


def test_a_model_that_flew_off_before_the_world_was_saved_is_left_out(tmp_path):
    away = box("book", pose="<pose>1 1 343582.7 0 0 0</pose>")
    path = write(tmp_path / "a.world", world(ground(), box(pose="<pose>2 2 1 0 0 0</pose>"), away))
    found, notes = read(path)
    assert found.solid_names == ("box_0",)
    assert "more than 100 km away: left out (book)" in notes
    with pytest.raises(WorldFileError, match="a solid up to 343583 m away"):
        read(write(tmp_path / "b.world", world(ground(), away)))


def test_an_empty_plane_is_a_world(tmp_path):
    found, _ = import_world(write(tmp_path / "a.world", world(ground())))
    assert found.solids == ()
    assert found.low[:2] == (-10.0, -10.0)


def test_urdf_is_read_with_its_joints(tmp_path):
    text = """<robot name='r'><link name='base'><collision><geometry><box size='1 1 1'/></geometry>
      </collision></link><link name='arm'><collision><origin xyz='0 0 1'/><geometry>
      <cylinder radius='0.2' length='2'/></geometry></collision></link>
      <joint name='j' type='fixed'><parent link='base'/><child link='arm'/>
      <origin xyz='2 0 0' rpy='0 1.5707963267948966 0'/></joint></robot>"""
    _, arm = read(write(tmp_path / "r.urdf", text))[0].solids
    np.testing.assert_allclose((arm.tail, arm.head), ((2, 0, 0), (4, 0, 0)), atol=1e-9)
    circle = text.replace("<link name='base'>", "<link name='base'/><link name='b'>")
    circle = circle.replace("parent link='base'", "parent link='arm'")
    with pytest.raises(WorldFileError, match=r"frames in a circle.* arm"):
        read(write(tmp_path / "c.urdf", circle))


def test_heightmaps_span_their_size(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    levels = np.zeros((33, 33), np.uint8)
    levels[:8] = 200  # the far side in y
    pillow.fromarray(levels).save(tmp_path / "h.png")
    shape = box("hills").replace(
        "<box><size>1 1 1</size></box>",
        "<heightmap><uri>file://h.png</uri><size>32 32 5</size><pos>0 0 1</pos></heightmap>",
    )
    found, notes = import_world(write(tmp_path / "a.sdf", world(shape)))
    assert found.ground_height(found.start) == pytest.approx(0.0, abs=1e-6)
    assert found.ground_height((0.0, 15.0)) == pytest.approx(5.0, abs=1e-6)
    assert notes[-1] == "ground at 1 m at the start: the scene is moved by -1 m in z"
    assert abs(found.goal[2]) < 0.3


def test_ends_are_inside_a_building(tmp_path):
    walls = [
        ("20 0.2 2", "0 5"),
        ("20 0.2 2", "0 -5"),
        ("0.2 10 2", "10 0"),
        ("0.2 7 2", "-10 1.5"),
    ]
    models = [box(f"wall_{n}", size, f"<pose>{at} 1 0 0 0</pose>")
              for n, (size, at) in enumerate(walls)]  # fmt: skip
    path = write(tmp_path / "a.world", world(ground(), *models))
    found, notes = import_world(path)
    for point in (found.start, found.goal):
        assert abs(point[0]) < 10.4  # as far as into the door
        assert abs(point[1]) < 4.5
    assert notes[-1].startswith("way from start to goal: 2")
    with pytest.raises(WorldFileError, match=r"no space for a radius of 9 m .* widest place is"):
        import_world(path, ImportOptions(robot_radius=9.0))


def test_solids_are_what_bodies_meet(tmp_path):
    (part,) = mesh_parts(write(tmp_path / "c.obj", CUBE), np.ones(3), [])
    solid = solid_of(part)
    points = np.random.default_rng(0).uniform(-1.0, 2.0, (200, 3))
    expected = np.linalg.norm(np.maximum(np.maximum(-points, points - 1.0), 0.0), axis=1)
    np.testing.assert_allclose(solid.distance(points), expected, atol=1e-12)
    expected = np.linalg.norm(np.maximum(np.maximum(-points, points - 1.0), 0.0)[:, :2], axis=1)
    near = solid.distance_in_plane(points[:, :2], (0.4, 0.6))
    np.testing.assert_allclose(near, expected, atol=1e-12)
    assert np.isinf(solid.distance_in_plane(points[:, :2], (1.4, 1.6))).all()
