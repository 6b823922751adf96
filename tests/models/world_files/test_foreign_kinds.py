"""Kinds of public files that were once read wrongly: each is read right, or refused by name."""

import struct

import numpy as np
import pytest

from tests.models.world_files.gazebo_files import ENDS, box, ground, world
from tests.models.world_files.written import MAP, one_ray, write
from wayproof.models.world_files import ImportOptions, WorldFileError, world_of
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.occupancy_maps import read_occupancy_grid
from wayproof.models.world_files.ply import read_ply

FAR = {"start": (-3.0, -3.0, 0.0), "goal": (-3.0, 3.0, 0.0)}

MODEL = """<sdf version='1.8'><model name='box'><static>1</static><link name='link'>
  <collision name='c'><pose>{x} 0 0.5 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry>
  </collision></link><frame name='corner'><pose>0.5 0.5 0 0 0 0</pose></frame></model></sdf>"""
LINK = """<link name='l2'><pose{relative}>2 0 0 0 0 0</pose><collision name='c'>
  <pose>0 0 .5 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry></collision></link>"""
INCLUDE = "<include><name>base</name><uri>model://box</uri><pose>2 1 0 0 0 0</pose></include>"
NEXT = "<include><name>next</name><uri>model://box</uri><pose relative_to='{}'>{}</pose></include>"
CUBOID = [(x, y, z) for x in (2, 3) for y in (1, 2) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def model_folder(folder, listed="<sdf version='1.8'>model.sdf</sdf>", **files):
    own = folder / "models" / "box"
    own.mkdir(parents=True)
    write(own, "model.config", f"<model><name>box</name>{listed}</model>")
    for name, x in (files or {"model": 0.0}).items():
        write(own, f"{name}.sdf", MODEL.format(x=x))


def centres(path, **options):
    read, notes = import_world(path, ImportOptions(**options), **FAR)
    return sorted((one.centre[0], one.centre[1]) for one in read.solids), notes


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (INCLUDE + NEXT.format("base", "2 0 0 0 0 0"), [(2, 1), (4, 1)]),
        (INCLUDE + NEXT.format("base::link", "2 0 0 0 0 0"), [(2, 1), (4, 1)]),
        (INCLUDE + NEXT.format("base::corner", "1.5 0.5 0 0 0 0"), [(2, 1), (4, 2)]),
        (INCLUDE + f"<model name='m'><static>1</static>{LINK.format(relative='')}"
         "<pose relative_to='base'/></model>", [(2, 1), (4, 1)]),
        ("<model name='p'><static>1</static><pose>1 1 0 0 0 0</pose><include merge='true'>"
         "<uri>model://box</uri><pose>1 0 0 0 0 0</pose></include>"
         f"{LINK.format(relative=chr(32) + 'relative_to=' + repr('link'))}</model>",
         [(2, 1), (4, 1)]),
        ("<include merge='true'><uri>file://sub.sdf</uri></include>", [(2, 1)]),
        ("<include><uri>file://lamp.sdf</uri></include>" + INCLUDE, [(2, 1)]),
    ],
)  # fmt: skip
def test_frames_lead_through_includes(tmp_path, content, expected):
    model_folder(tmp_path)
    write(tmp_path, "sub.sdf", "<sdf version='1.11'><world name='x'><frame name='f'>"
          "<pose>2 1 0 0 0 0</pose></frame><include><name>b</name><uri>model://box</uri>"
          "<pose relative_to='f'/></include></world></sdf>")  # fmt: skip
    write(tmp_path, "lamp.sdf", "<sdf version='1.6'><light type='point' name='lamp'/></sdf>")
    found, _ = centres(write(tmp_path, "w.sdf", world(ground(), content)))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_frames_in_a_circle_through_models_are_refused(tmp_path):
    one = "<model name='{}'><pose relative_to='{}'>1 0 0 0 0 0</pose><link name='l'/></model>"
    content = world(ground(), one.format("a", "b::l"), one.format("b", "a::l"))
    with pytest.raises(WorldFileError, match=r"frames in a circle.*: b::l -> a::l"):
        centres(write(tmp_path, "w.sdf", content))


@pytest.mark.parametrize(
    ("versions", "x"),
    [(("1.4", "1.10", "1.9"), 11.0), (("1.9", "100.0", "1.4"), 2.0), (("", "", ""), 2.0)],
)
def test_the_highest_version_that_can_be_read_counts(tmp_path, versions, x):
    listed = "".join(
        f"<sdf version='{version}'>{name}.sdf</sdf>" if version else f"<sdf>{name}.sdf</sdf>"
        for version, name in zip(versions, "abc", strict=True)
    )
    model_folder(tmp_path, listed, a=0.0, b=9.0, c=-9.0)
    found, _ = centres(write(tmp_path, "w.sdf", world(ground(), INCLUDE)))
    np.testing.assert_allclose(found, [(x, 1.0)], atol=1e-12)


def test_a_world_of_which_nothing_is_left_says_why_and_how_it_comes_in(tmp_path):
    surface = "<surface><contact><collide_without_contact>1</collide_without_contact></contact>"
    path = write(tmp_path, "w.sdf", world(box(pose="<pose>2 1 .5 0 0 0</pose>",
                                              surface=f"{surface}</surface>")))  # fmt: skip
    said = "nothing solid in it: 1 collisions with collide_without_contact: left out; --visuals"
    with pytest.raises(WorldFileError, match=said):
        centres(path)
    found, _ = centres(path, visuals=True)
    assert found == [(2.0, 1.0)]


def test_an_included_actor_walks(tmp_path):
    write(tmp_path, "a.sdf", "<sdf version='1.6'><actor name='x'><pose>0 0 1 0 0 0</pose></actor>"
          "</sdf>")  # fmt: skip
    content = "<include><uri>file://a.sdf</uri><pose>1 2 1 0 0 0</pose></include>"
    read, _ = import_world(write(tmp_path, "w.sdf", world(ground(), content)), **FAR)
    assert read.movers[0].route == ((1.0, 2.0, 0.0),)


MAP_LEVELS = b"P5 2 2 255\n" + bytes([0, 254, 205, 254])


@pytest.mark.parametrize(
    ("text", "occupied", "unknown"),
    [
        (MAP.format(yaw=0, negate="yes"), 3, 0),
        (MAP.format(yaw=0, negate=0) + "mode: Trinary\nfrom:\n- ../a.json\n", 1, 1),
        (MAP.format(yaw=0, negate="Off").replace("[1.0, 0.0, 0]", "\n- 1.0\n- 0.0\n- 0"), 1, 1),
        (MAP.format(yaw=0, negate=0).replace("0.5\n", "5e-1\n", 1).replace("0.196", "0.25"), 1, 1),
    ],
)
def test_maps_are_yaml(tmp_path, text, occupied, unknown):
    write(tmp_path, "m.pgm", MAP_LEVELS)
    grid = read_occupancy_grid(write(tmp_path, "m.yaml", text))
    assert (grid.occupied.sum(), (~(grid.occupied | grid.free)).sum()) == (occupied, unknown)
    assert grid.resolution == 0.5
    assert tuple(grid.origin) == (1.0, 0.0, 0.0)


def test_the_grey_of_a_savers_unknown_is_said(tmp_path):
    write(tmp_path, "m.pgm", b"P5 40 40 255\n" + bytes([0] + [254] * 1200 + [205] * 399))
    text = MAP.format(yaw=0, negate=0).replace("0.196", "0.25")
    _, notes = import_world(write(tmp_path, "m.yaml", text))
    assert notes[0].startswith("1 cells occupied, 399 unknown")
    assert notes[1].startswith("399 of them have the grey 205")
    write(tmp_path, "m.pgm", b"P5 40 40 255\n" + bytes([0] + [230] * 1200 + [205] * 399))
    assert read_occupancy_grid(tmp_path / "m.yaml").saved_unknown == 0  # no saver's image


def ply(faces, strips=(), *, colours=False):
    """Return a binary PLY of the cuboid's vertices, each list as long as it is."""
    lines = ["ply", "format binary_little_endian 1.0", "element vertex 8"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += ["property uchar red"] * colours
    if strips:
        lines += [f"element tristrips {len(strips)}", "property list int int vertex_indices"]
    data = ("\n".join([*lines, "end_header"]) + "\n").encode()
    data += np.array(CUBOID, "<f4").tobytes()
    for face in faces:
        data += struct.pack(f"<B{len(face)}i", len(face), *face) + b"\xff" * colours
    for strip in strips:
        data += struct.pack(f"<i{len(strip)}i", len(strip), *strip)
    return data


SPLIT = [*QUADS[:3], *(tuple(q[i] for i in c) for q in QUADS[3:] for c in ((0, 1, 2), (2, 3, 0)))]
STRIP = (1, 0, 3, 2, -1, 4, 5, 6, 7, -1, 0, 1, 4, 5, -1, 2, 6, 3, 7, -1, 0, 4, 2, 6, -1, 1, 3, 5, 7)


@pytest.mark.parametrize(
    "data",
    [ply(QUADS, colours=True), ply(SPLIT), ply((), [STRIP]), ply((), [STRIP[:10], STRIP[10:]])],
)
def test_every_surface_of_a_ply_is_solid(tmp_path, data):
    path = write(tmp_path, "m.ply", data)
    assert len(read_ply(path).triangles) == 12
    read, _ = import_world(path, **FAR)
    assert one_ray(read, (2.5, 1.5, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(2.0, abs=1e-6)


DRAWN = "<visual><origin xyz='0 0 .5'/><geometry><box size='1 1 1'/></geometry></visual>"
CAPSULE = "<collision><geometry><capsule radius='.2' length='.6'/></geometry></collision>"


def test_capsules_and_visuals_of_urdf(tmp_path):
    text = (
        f"<robot name='r'><link name='w'>{CAPSULE}</link><link name='a'>{DRAWN}</link><joint "
        "name='j' type='fixed'><origin xyz='1 1 0'/><parent link='w'/><child link='a'/></joint>"
        "</robot>"
    )
    path = write(tmp_path, "r.urdf", text)
    _, notes = import_world(path, **FAR)
    assert (
        "1 links with visuals only: left out; --visuals makes them solid ('a' in line 1)" in notes
    )
    found, _ = import_world(path, ImportOptions(visuals=True), **FAR)
    assert [one.high[2] for one in found.solids] == pytest.approx([0.5, 1.0])


def test_the_links_of_an_included_urdf_are_frames(tmp_path):
    text = (
        f"<robot name='r'><link name='w'>{CAPSULE}</link><link name='a'/><joint name='j' "
        "type='revolute'><origin xyz='1 0 0'/><parent link='w'/><child link='a'/></joint></robot>"
    )
    write(tmp_path, "r.urdf", text)
    include = "<include><name>r</name><uri>file://r.urdf</uri><pose>1 1 0.5 0 0 0</pose></include>"
    placed = box(pose="<pose relative_to='r::a'>2 0 0 0 0 0</pose>")
    found, notes = import_world(write(tmp_path, "w.sdf", world(ground(), include, placed)), **FAR)
    np.testing.assert_allclose(found.solids[1].centre, (4.0, 1.0, 0.5), atol=1e-12)
    assert notes == ["1 models that can move: they stand still here"]


def test_compressed_gltf_is_refused_by_name(tmp_path):
    text = '{"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}'
    with pytest.raises(WorldFileError, match="glTF extension KHR_draco_mesh_compression: not read"):
        import_world(write(tmp_path, "m.gltf", text), **FAR)


SCENE = """<mujoco><worldbody><geom type="plane" size="9 9 .1"/><geom name="pane" type="box"
  size=".1 1 1" pos="3 3 1" rgba="1 1 1 {alpha}" friction="{friction}" group="{group}"/>
  </worldbody></mujoco>"""


def test_changes_of_an_mjcf_are_said(tmp_path):
    path = write(tmp_path, "a.xml", SCENE.format(alpha=0, friction=0.15, group=4))
    _, notes = import_world(path, **FAR)
    assert notes[:3] == [
        "1 geoms of alpha 0: beams meet them here (pane)",
        "2 geoms of another friction: 0.8 here (pane)",
        "1 geoms of other groups: of group 0 here (pane)",
    ]


def test_changes_of_an_sdf_are_said(tmp_path):
    pane = box(pose="<pose>2 1 .5 0 0 0</pose>", surface="<surface><friction><ode><mu>0.1</mu>"
               "</ode></friction></surface>")  # fmt: skip
    drawn = "<visual name='v'><transparency>0.7</transparency></visual></link>"
    content = world(
        ground(), pane.replace("</link>", drawn), box("b", pose="<pose>5 1 .5 0 0 0</pose>")
    )
    _, notes = centres(write(tmp_path, "w.sdf", content))
    assert notes[:2] == [
        "1 collisions of another friction: 0.8 here",
        "1 transparent visuals: opaque here, also to beams",
    ]


def test_a_geom_of_the_robots_group_is_refused(tmp_path):
    read, _ = import_world(write(tmp_path, "a.xml", SCENE.format(alpha=1, friction=1, group=3)),
                           **FAR)  # fmt: skip
    text = read.text.replace('name="pane_0"', 'name="x"')
    first, last = text.rsplit('group="0"', 1)
    with pytest.raises(WorldFileError, match="of group 3, which is a robot's own"):
        world_of(f'{first}group="3"{last}')


def test_a_skin_is_solid_in_its_bind_pose(tmp_path):
    pytest.importorskip("collada")
    path = write(tmp_path, "s.dae", SKINNED)
    read, notes = import_world(path, **ENDS)
    assert "s.dae: 1 skinned meshes taken in their bind pose" in notes
    assert one_ray(read, (2.5, 1.5, 3.0), (0.0, 0.0, -1.0)) == pytest.approx(2.0, abs=1e-6)


_PLACES = " ".join(f"{a} {b} {c}" for a, b, c in CUBOID)
_CORNERS = " ".join(f"{q[i]}" for q in QUADS for c in ((0, 1, 2), (2, 3, 0)) for i in c)
SKINNED = f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<unit meter="1" name="u"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="b"><mesh>
<source id="p"><float_array id="a" count="24">{_PLACES}</float_array><technique_common>
<accessor source="#a" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="12">
<input semantic="VERTEX" source="#v" offset="0"/><p>{_CORNERS}</p></triangles></mesh></geometry>
</library_geometries><library_controllers><controller id="ctl"><skin source="#b">
<bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>
<source id="j"><Name_array id="ja" count="1">root</Name_array><technique_common>
<accessor source="#ja" count="1" stride="1"><param name="JOINT" type="Name"/></accessor>
</technique_common></source><source id="ib"><float_array id="iba" count="16">
1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</float_array><technique_common><accessor source="#iba" count="1"
stride="16"><param name="TRANSFORM" type="float4x4"/></accessor></technique_common></source>
<source id="w"><float_array id="wa" count="1">1</float_array><technique_common>
<accessor source="#wa" count="1" stride="1"><param name="WEIGHT" type="float"/></accessor>
</technique_common></source><joints><input semantic="JOINT" source="#j"/>
<input semantic="INV_BIND_MATRIX" source="#ib"/></joints><vertex_weights count="8">
<input semantic="JOINT" source="#j" offset="0"/><input semantic="WEIGHT" source="#w" offset="1"/>
<vcount>1 1 1 1 1 1 1 1</vcount><v>0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0</v></vertex_weights></skin>
</controller></library_controllers><library_visual_scenes><visual_scene id="S">
<node id="root" sid="root" type="JOINT"/><node id="s"><instance_controller url="#ctl">
<skeleton>#root</skeleton></instance_controller></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#S"/></scene></COLLADA>"""
