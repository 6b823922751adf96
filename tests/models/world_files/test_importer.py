"""Foreign files become worlds that beams meet exactly where the file says, or one clear line."""

import base64
import contextlib
import json
import re

import mujoco
import numpy as np
import pytest

from wayproof.models.world_files import (
    ImportOptions,
    WorldFileError,
    import_world,
    read_world_file,
    world_of,
)
from wayproof.models.world_files.clouds import decompress_lzf, read_pcd
from wayproof.models.world_files.octomaps import read_octomap
from wayproof.models.world_files.parts import Part, quaternion_of, rotation_of, turned_by
from wayproof.models.world_files.solids import solid_of
from wayproof.models.world_files.voxel_maps import merged_boxes, read_voxels
from wayproof.models.worlds import WORLDS
from wayproof.models.worlds.solids import TriangleMesh

ENDS = {"start": (0.0, 0.0, 0.0), "goal": (3.0, 0.0, 0.0)}

SDF = """<sdf version='1.6'><world name='default'>
  <light name='sun' type='directional'/>
  <model name='ground_plane'><static>1</static><link name='link'><collision name='c'><geometry>
    <plane><normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>
  {models}
</world></sdf>
"""

PILLAR = """<model name='pillar'><static>1</static><pose frame=''>{pose}</pose>
  <link name='link'><collision name='c'><geometry><cylinder><radius>0.075000</radius>
  <length>1</length></cylinder></geometry></collision></link></model>"""


def write(folder, name, text):
    path = folder / name
    if isinstance(text, bytes):
        path.write_bytes(text)
    else:
        path.write_text(text)
    return path


def sdf(folder, *models, name="some.world"):
    return write(folder, name, SDF.format(models="\n".join(models)))


def imported(path, **more):
    options = ImportOptions(**more)
    return import_world(path, options, **ENDS)[0]


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


def one_ray(world, origin, ray):
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hit = np.zeros(1, np.int32)
    return mujoco.mj_ray(model, data, np.array(origin), np.array(ray), None, 1, -1, hit)


# ---- round trips


@pytest.mark.parametrize("name", WORLDS)
def test_a_saved_world_gives_the_same_rays(tmp_path, name):
    saved = WORLDS[name](3)
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


# ---- SDF


def test_pillars_of_barn_stand_where_they_are_published(tmp_path):
    poses = ["1 0.5 0 0 0 0", "2 -0.525000 0 0 0 0"]
    world = imported(sdf(tmp_path, *(PILLAR.format(pose=pose) for pose in poses)))
    first, second = world.solids
    assert (first.tail, first.head, first.radius) == ((1.0, 0.5, -0.5), (1.0, 0.5, 0.5), 0.075)
    assert second.tail[:2] == (2.0, -0.525)
    assert one_ray(world, (0.0, 0.5, 0.4), (1.0, 0.0, 0.0)) == pytest.approx(0.925, abs=1e-12)
    assert one_ray(world, (0.0, 0.5, 0.6), (1.0, 0.0, 0.0)) == -1.0  # it looks over them


def test_beams_meet_the_pillars_of_barn_where_the_circles_are(tmp_path):
    rng = np.random.default_rng(4)
    middles = np.round(rng.uniform((-4.0, -4.0), (4.0, 4.0), (30, 2)), 6)
    poses = [f"{x} {y} 0 0 0 0" for x, y in middles.tolist()]
    world = imported(sdf(tmp_path, *(PILLAR.format(pose=pose) for pose in poses)))
    again = read_world_file(write(tmp_path, "pillars.xml", world.text))
    met = 0
    for origin in rng.uniform((-4.0, -4.0), (4.0, 4.0), (120, 2)):
        if np.linalg.norm(middles - origin, axis=1).min() < 0.1:
            continue
        angle = rng.uniform(0.0, 2.0 * np.pi)
        ray = np.array([np.cos(angle), np.sin(angle)])
        along = (middles - origin) @ ray  # the circle |origin + t ray - middle| = radius
        inside = along**2 - np.square(middles - origin).sum(axis=1) + 0.075**2
        ends = along - np.sqrt(np.maximum(inside, 0.0))
        expected = np.where((inside > 0.0) & (along > 0.0), ends, np.inf).min()
        hit = one_ray(again, (*origin, 0.4), (*ray, 0.0))
        assert hit == pytest.approx(-1.0 if np.isinf(expected) else expected, abs=1e-9)
        met += hit >= 0.0
    assert met > 15


def test_poses_nest_and_frames_are_resolved(tmp_path):
    # A box 1 m ahead of a frame that stands at (1, 2) and is turned left: so at (1, 3).
    model = """<model name='m'><static>true</static><pose>0 2 0 0 0 0</pose>
      <frame name='f'><pose>1 0 0 0 0 1.5707963267948966</pose></frame>
      <link name='a'><pose relative_to='f'>1 0 0.5 0 0 0</pose>
        <collision name='c'><geometry><box><size>0.4 0.2 1</size></box></geometry></collision>
      </link>
      <link name='b'><pose relative_to='a'>1 0 0 0 0 0</pose>
        <collision name='c'><pose>0 0 1 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere>
        </geometry></collision></link></model>"""
    box, sphere = imported(sdf(tmp_path, model)).solids
    np.testing.assert_allclose(box.centre, (1.0, 3.0, 0.5), atol=1e-12)
    np.testing.assert_allclose(box.high[:2], (1.1, 3.2), atol=1e-12)
    np.testing.assert_allclose(sphere.centre, (1.0, 4.0, 1.5), atol=1e-12)


def test_a_saved_state_holds_the_poses_that_count(tmp_path):
    state = """<state world_name='default'><model name='pillar'><pose>2 0 0 0 0 0</pose>
      <scale>1 1 1</scale><link name='link'><pose>2 0.25 0 0 0 0</pose></link></model></state>"""
    world = imported(sdf(tmp_path, PILLAR.format(pose="1 0 0 0 0 0"), state))
    assert world.solids[0].tail == (2.0, 0.25, -0.5)


def test_included_models_are_looked_for_beside(tmp_path):
    (tmp_path / "post").mkdir()
    body = PILLAR.format(pose="0 0 0 0 0 0")
    write(tmp_path / "post", "model.sdf", f"<sdf version='1.6'>{body}</sdf>")
    include = "<include><uri>model://{}</uri><pose>2 1 0 0 0 0</pose></include>"
    world = imported(sdf(tmp_path, include.format("post"), include.format("sun")))
    assert [solid.tail[:2] for solid in world.solids] == [(2.0, 1.0)]
    path = sdf(tmp_path, include.format("cafe"), PILLAR.format(pose="2 0 0 0 0 0"))
    with pytest.raises(WorldFileError, match=r"some\.world:5: <include>: no model 'cafe'"):
        imported(path)
    world, notes = import_world(path, ImportOptions(skip_missing=True), **ENDS)
    assert len(world.solids) == 1
    assert notes == ["<include> 'model://cafe' (some.world:5): not there, left out"]


BOMB = "<!DOCTYPE b [<!ENTITY a 'ha'><!ENTITY c '&a;&a;&a;'>]>\n<sdf>&c;</sdf>"
GEOMETRY = (
    "<model name='m'><static>1</static>{pose}<link name='l'><collision name='c'><geometry>"
    "{shape}</geometry></collision></link></model>"
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, r":1: document type 'b'"),
        ("<sdf><world>", r":1: no XML"),
        ("<robot/>", r":1: <robot>: expected <sdf>"),
        ("<sdf><world/></sdf>", "nothing solid"),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<polyline/>")),
            r":5: <polyline>: got 0 corners, expected 3 to",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<rope/>")),
            r":5: <rope>: cannot be taken over \(available: box",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<box><size>1 1</size></box>")),
            r":5: <size>: got '1 1', expected 3 numbers",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<box><size>1 1 0</size></box>")),
            r":5: <box>: box: got lengths",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="<pose relative_to='x'/>", shape="<plane/>")),
            r":5: <pose>: no frame 'x'",
        ),
        (
            SDF.format(
                models=GEOMETRY.format(pose="", shape="<mesh><uri>../../x.stl</uri></mesh>")
            ),
            r"no file '../../x.stl'",
        ),
        (SDF.format(models="<frame name='f'><pose relative_to='f'/></frame>"
                    + GEOMETRY.format(pose="<pose relative_to='f'/>", shape="<empty/>")),
         r"frames in a circle: f -> f"),
    ],
)  # fmt: skip
def test_what_cannot_be_taken_over_is_named(tmp_path, text, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "some.world", text))


# ---- MJCF


def test_includes_and_assets_are_inlined(tmp_path):
    (tmp_path / "parts").mkdir()
    write(tmp_path / "parts", "post.xml", "<mujoco><worldbody><body pos='2 0 0' euler='0 0 90'>"
          "<joint/><geom name='post_7' type='box' size='.1 .3 .5' pos='0 0 .5'/></body>"
          "<geom type='sphere' size='.2' pos='0 0 1' contype='0' conaffinity='0'/>"
          "</worldbody></mujoco>")  # fmt: skip
    top = (
        "<mujoco><include file='parts/post.xml'/><asset>"
        "<hfield name='h' nrow='2' ncol='2' size='1 1 .5 .1' elevation='0 0 1 1'/></asset>"
        "<worldbody><geom type='plane' size='5 5 1'/>"
        "<geom type='hfield' hfield='h' pos='0 3 0'/></worldbody></mujoco>"
    )
    world, notes = import_world(write(tmp_path, "top.xml", top), None, **ENDS)
    assert world.solid_names == ("structure_0", "post_0")
    np.testing.assert_allclose(world.solids[1].high, (2.3, 0.1, 1.0), atol=1e-12)
    assert notes == ["1 geoms that nothing collides with: left out",
                     "1 joints: everything stands still here"]  # fmt: skip
    scene = tmp_path / "alone"
    scene.mkdir()
    again = read_world_file(write(scene, "top.xml", world.text))
    # MuJoCo takes the first row for the far side in y, as in a picture: 0.025 m high at y = 3.9.
    assert one_ray(again, (0.0, 3.9, 2.0), (0.0, 0.0, -1.0)) == pytest.approx(1.975, abs=1e-6)
    assert again.solids[0].distance([[0.0, 2.0, 2.0]])[0] == pytest.approx(1.5, abs=1e-6)
    assert again.solids[0].distance([[0.0, 4.0, 2.0]])[0] > 1.6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><include file='../up.xml'/></mujoco>", "lies outside the scene's folder"),
        ("<mujoco><asset><mesh name='m' file='/etc/passwd'/></asset></mujoco>", "lies outside"),
        (
            "<mujoco><compiler meshdir='..'/><asset><mesh name='m' file='x.stl'/></asset></mujoco>",
            "lies outside",
        ),
        ("<mujoco><include file='top.xml'/></mujoco>", "in a circle"),
        ("<mujoco><extension/></mujoco>", "<extension>: loads code"),
        ("<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", "top.xml: "),
    ],
)  # fmt: skip
def test_scenes_that_reach_out_are_refused(tmp_path, text, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "top.xml", text))


def test_a_world_file_names_no_other_file(tmp_path):
    text = imported(sdf(tmp_path, PILLAR.format(pose="2 0 0 0 0 0"))).text
    reaching = text.replace("<asset>", "<asset><mesh name='m' file='m.stl'/>")
    with pytest.raises(WorldFileError, match="<mesh>: not of a world file"):
        read_world_file(write(tmp_path, "a.xml", reaching))
    with pytest.raises(WorldFileError, match="not a world file; 'wayproof import' makes one of it"):
        read_world_file(write(tmp_path, "b.xml", "<mujoco/>"))
    other = text.replace('format" data="1"', 'format" data="9"')
    with pytest.raises(WorldFileError, match="format '9', expected '1'"):
        world_of(other)


# ---- maps, tables, meshes, heights


def test_merged_boxes_fill_exactly_the_occupied_cells():
    rng = np.random.default_rng(1)
    for density in (0.1, 0.5, 0.9):
        occupied = rng.uniform(size=(7, 6, 5)) < density
        filled = np.zeros(occupied.shape, int)
        for low, high in merged_boxes(occupied):
            filled[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] += 1
        np.testing.assert_array_equal(filled, occupied)
    assert merged_boxes(np.ones((4, 3, 2), bool)).tolist() == [[[0, 0, 0], [4, 3, 2]]]


def test_a_voxel_map_stands_on_the_origin(tmp_path):
    path = write(tmp_path, "m.3dmap", "voxel 9 5 4\n4 1 0\n4 2 0\n5 1 0\n5 2 0\n")
    (box,) = imported(path, resolution=0.25).solids
    assert (box.low, box.high) == ((1.0, 0.25, 0.0), (1.5, 0.75, 0.25))
    with pytest.raises(WorldFileError, match=r"m\.3dmap:3: got '9 0 0', expected a cell within"):
        read_voxels(write(tmp_path, "m.3dmap", "voxel 9 5 4\n4 1 0\n9 0 0\n"))


MAP = "image: m.pgm\nresolution: 0.5\norigin: [1.0, 0.0, {yaw}]\nnegate: {negate}\n" \
      "occupied_thresh: 0.65\nfree_thresh: 0.196 # usual\n"  # fmt: skip


def test_a_flat_map_is_extruded(tmp_path):
    # Two rows of three: the upper left is occupied, the lower right unknown.
    write(
        tmp_path, "m.pgm", b"P5\n# made by hand\n3 2\n255\n" + bytes([0, 254, 254, 254, 254, 205])
    )
    path = write(tmp_path, "m.yaml", MAP.format(yaw=0.0, negate=0))
    world, notes = import_world(path, ImportOptions(height=1.2), **ENDS)
    assert notes == ["1 cells occupied, 1 unknown, taken as occupied"]
    assert [solid.low for solid in world.solids] == [(1.0, 0.5, 0.0), (2.0, 0.0, 0.0)]
    assert world.solids[0].high == (1.5, 1.0, 1.2)
    (alone,) = imported(path, unknown="free").solids
    assert alone.low[:2] == (1.0, 0.5)
    turned = write(tmp_path, "t.yaml", MAP.format(yaw=np.pi / 2, negate=0))
    (box,) = imported(turned, unknown="free").solids
    np.testing.assert_allclose(box.low[:2], (0.0, 0.0), atol=1e-12)  # x = 1 - v, y = u
    negated = write(tmp_path, "n.yaml", MAP.format(yaw=0.0, negate=1))
    assert len(imported(negated, unknown="free").solids) == 2  # bright is occupied now


@pytest.mark.parametrize("negate", [0, 1])
def test_a_raw_map_has_percentages_whatever_negate_says(tmp_path, negate):
    write(tmp_path, "m.pgm", b"P5 6 1 255\n" + bytes([0, 19, 50, 66, 100, 255]))
    text = MAP.format(yaw=0.0, negate=negate) + "mode: raw\n"
    path = write(tmp_path, "m.yaml", text)
    world, notes = import_world(path, ImportOptions(height=1.2, unknown="free"), **ENDS)
    assert notes == ["2 cells occupied, 2 unknown, taken as free"]  # unknown: 50 and 255
    (box,) = world.solids
    assert (box.low[0], box.high[0]) == (2.5, 3.5)


def test_a_png_map_reads_as_its_pgm(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    levels = np.array([[0, 254, 254], [254, 254, 205]], np.uint8)
    pillow.fromarray(levels).save(tmp_path / "m.png")
    write(tmp_path, "m.pgm", "P2 3 2 255 0 254 254 254 254 205")
    text = MAP.format(yaw=0.0, negate=0)
    worlds = [
        imported(write(tmp_path, f"m{n}.yaml", text.replace("pgm", ending)))
        for n, ending in enumerate(("png", "pgm"))
    ]
    assert worlds[0].solids == worlds[1].solids


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("image: m.pgm\n", "no resolution, origin"),
        (MAP.format(yaw=0, negate=0).replace("0.65", "2"), r":5: occupied_thresh: got '2'"),
        (MAP.format(yaw=0, negate=0).replace("m.pgm", "../m.pgm"), "lies outside"),
        (MAP.format(yaw=0, negate=0).replace("[1.0", "[1.0, 2"), r":3: origin: got"),
        ("a: b\n  - c\n", r":2: got '- c'"),
        (MAP.format(yaw=0, negate=0) + "mode: row\n", r":7: mode: got 'row', expected trinary, sc"),
    ],
)
def test_broken_map_files_are_named(tmp_path, text, said):
    write(tmp_path, "m.pgm", b"P5 1 1 255\n\x00")
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "m.yaml", text))


def octomap(tmp_path, ending):
    """Write a room of OctoMap's own, by its library, and return its occupied cells."""
    pyoctomap = pytest.importorskip("pyoctomap")
    tree = pyoctomap.OcTree(0.1)
    rng = np.random.default_rng(4)
    for place in rng.integers(-20, 20, (400, 3)):
        tree.updateNode(((place + 0.5) * 0.1).tolist(), bool(rng.random() < 0.6))
    for cell in np.stack(np.meshgrid(*3 * [np.arange(4)]), axis=-1).reshape(-1, 3):  # is pruned
        tree.updateNode(((cell + 40.5) * 0.1).tolist(), True)
    tree.updateInnerOccupancy()
    path = tmp_path / f"m{ending}"
    if ending == ".bt":
        assert tree.writeBinary(str(path))
    else:
        path.write_bytes(tree.write())
    cells = set()
    for leaf in tree.begin_leafs():
        if tree.isNodeOccupied(leaf):
            side = round(leaf.getSize() / 0.1)
            low = np.rint(np.array(leaf.getCoordinate()) / 0.1 - side / 2.0).astype(int)
            cells |= {tuple(low + step) for step in np.ndindex(side, side, side)}
    return path, cells


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_an_octomap_gives_the_cells_that_its_library_says_are_occupied(tmp_path, ending):
    path, expected = octomap(tmp_path, ending)
    found = set()
    for box in read_octomap(path, ImportOptions()).parts:
        low, high = (np.rint(corner / 0.1).astype(int) for corner in box.bounds)
        found |= {tuple(low + step) for step in np.ndindex(*(high - low))}
    assert found == expected
    with pytest.raises(WorldFileError, match="expected a file that begins with '# Octomap"):
        imported(write(tmp_path, f"n{ending}", b"AcTree"))
    with pytest.raises(WorldFileError, match="ends within its tree"):
        imported(write(tmp_path, f"cut{ending}", path.read_bytes()[:-40]))


CLOUD = np.array([[2.05, 0.05, 0.35], [2.15, 0.05, 0.35], [2.17, 0.02, 0.31], [3.05, 0.05, 0.35]])
PCD_HEAD = "# .PCD v0.7\nFIELDS x y z intensity\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 1\n"


def cloud_file(tmp_path, kind):
    if kind == "ply":
        head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        rows = "".join(" ".join(map(str, point)) + "\n" for point in CLOUD.tolist())
        return write(tmp_path, "c.ply", head + "property float z\nend_header\n" + rows)
    if kind == "ascii":
        rows = "".join(" ".join(map(str, point)) + " 7\n" for point in CLOUD.tolist())
        return write(tmp_path, "c.pcd", PCD_HEAD + "POINTS 5\nDATA ascii\n" + rows + "nan 0 0 7\n")
    rows = np.zeros(4, [("p", "<f4", 3), ("i", "u1")])
    rows["p"] = CLOUD
    head = PCD_HEAD + "POINTS 4\nDATA binary\n"
    return write(tmp_path, "c.pcd", head.encode() + rows.tobytes())


@pytest.mark.parametrize("kind", ["ply", "ascii", "binary"])
def test_a_point_cloud_gives_the_cells_of_its_points(tmp_path, kind):
    near, far = sorted(imported(cloud_file(tmp_path, kind)).solids, key=lambda box: box.low[0])
    np.testing.assert_allclose([near.low, near.high], [(2.0, 0.0, 0.3), (2.2, 0.1, 0.4)], atol=1e-6)
    np.testing.assert_allclose([far.low, far.high], [(3.0, 0.0, 0.3), (3.1, 0.1, 0.4)], atol=1e-6)


@pytest.mark.parametrize("up", ["0", "0.6"])
def test_infinite_walls_enclose_what_they_face(tmp_path, up):
    """Nothing is chosen behind a plane, where MuJoCo has the solid side of it."""
    walls = "".join(
        f"<geom name='w{n}' type='plane' size='5 5 1' pos='{at}' zaxis='{normal}'/>"
        for n, (at, normal) in enumerate((
            ("-5 0 0", f"1 0 {up}"), ("5 0 0", f"-1 0 {up}"), ("0 -4 0", f"0 1 {up}"),
            ("0 4 0", f"0 -1 {up}"),
        ))
    )  # fmt: skip
    floor = "<geom name='floor' type='plane' size='9 9 1'/>"
    text = f"<mujoco><worldbody>{floor}{walls}<geom size='.2' pos='0 0 .2'/></worldbody></mujoco>"
    world, _ = import_world(write(tmp_path, "a.xml", text))
    assert (np.abs([world.start[:2], world.goal[:2]]) < (5.0, 4.0)).all()
    assert np.hypot(*np.subtract(world.goal, world.start)[:2]) > 6.0
    np.testing.assert_allclose(world.low[:2], (-5.0, -4.0))
    np.testing.assert_allclose(world.high[:2], (5.0, 4.0))
    if up == "0":
        walls = [box for box in world.solids if box.kind == "wall"]
        np.testing.assert_allclose(np.min([box.low[:2] for box in walls], axis=0), (-5.5, -4.5))
        np.testing.assert_allclose(np.max([box.high[:2] for box in walls], axis=0), (5.5, 4.5))


def test_cells_up_to_the_floor_are_the_floor(tmp_path):
    """A few cells of a scanned floor below 0, too few to find it by, and a post."""
    points = [(x, y, -0.05) for x in (0.05, 0.15, 0.25) for y in (0.05, 0.15)]
    points += [(5.05, 0.05, z) for z in (-0.05, 0.05, 0.15)]
    rows = "".join("{} {} {} 7\n".format(*point) for point in points)
    head = PCD_HEAD + f"POINTS {len(points)}\nDATA ascii\n"
    world = imported(write(tmp_path, "c.pcd", head + rows))
    assert [(box.low[2], box.high[2]) for box in world.solids] == [(0.0, pytest.approx(0.2))]


LZF = base64.b64decode(
    "DwAAAADNzMw9zcxMPpqZmT4gCwA+IBIIP5qZGT8zMzM/IBcHP2ZmZj8AAIAgCwCMIBcAmSAPAKYgGwCzIBMAwCATAMwg"
    "EwDZIBMA5iATAPMgE+D/T+H/P+K5L+BDACMvI2vgQwMATCOz4EEDIa/gRAMg6+BEAyGLRGPgQANDp+BDA0Uz4EMDIdvg"
    "RANFy+BDAyGP4P8A4P8A4P8AIAABAAA="
)
"""A floor of 20 x 10 points, 0.1 m apart, as python-lzf 0.2.4 compresses its three columns."""

FLOOR_HEAD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 200\nDATA binary_compressed\n"


def compressed(packed=LZF, size=2400, length=None):
    sizes = np.array([len(packed) if length is None else length, size], "<u4")
    return FLOOR_HEAD.encode() + sizes.tobytes() + packed


def test_a_compressed_cloud_is_that_of_its_columns(tmp_path):
    found = read_pcd(write(tmp_path, "c.pcd", compressed()), ImportOptions(resolution=0.1))
    assert found.notes[0].startswith("200 points as ")
    columns = np.empty(2400, np.uint8)
    assert decompress_lzf(np.frombuffer(LZF, np.uint8).copy(), columns) == 2400
    x, y, z = columns.view("<f4").reshape(3, 200)
    np.testing.assert_array_equal(x, np.tile(np.arange(20) * 0.1, 10).astype(np.float32))
    np.testing.assert_array_equal(y, np.repeat(np.arange(10) * 0.1, 20).astype(np.float32))
    assert not z.any()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (compressed(LZF[:-9]), "damaged"),
        (compressed(b"\xff" * 24), "damaged"),
        (compressed(b"\x20\x00" * 30), "damaged"),  # copies from before the beginning
        (compressed(LZF, 2_400_000), "expected 2400 by the header"),
        (compressed(LZF, 2400, 4_000_000_000), "expected 2400 by the header"),
        (compressed(b"\x00" * 8), "2400 bytes of 8 are none"),
    ],
)
def test_damaged_compressed_clouds_are_refused(tmp_path, data, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "c.pcd", data))


def test_no_byte_of_damaged_lzf_is_read_or_written_out_of_bounds():
    rng = np.random.default_rng(3)
    for _ in range(300):
        data = np.frombuffer(LZF, np.uint8).copy()
        data[rng.integers(len(data), size=4)] = rng.integers(256, size=4, dtype=np.uint8)
        guarded = np.full(2500, 7, np.uint8)
        length = decompress_lzf(data, guarded[50:2450])
        assert length == decompress_lzf.py_func(data, guarded[50:2450].copy())
        assert (guarded[:50] == 7).all()
        assert (guarded[2450:] == 7).all()


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("c.pcd", PCD_HEAD + "POINTS 9\nDATA binary\n123", "POINTS 9, but 0 are there"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA ascii\n0 0 0 1 x", "a word that is no number"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA ascii\n0 0 0 1", "but 4 numbers are there"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA lzma\n", "expected ascii, binary or binary_compr"),
        ("c.pcd", PCD_HEAD + "POINTS 2\nDATA binary_compressed\n", "0 bytes of 0, of which 0 are"),
        ("c.pcd", PCD_HEAD.replace("F F F U", "Q F F U") + "POINTS 2\nDATA ascii\n", "Q4"),
        ("c.pcd", "VERSION 0.7\n", "no line DATA"),
        ("c.las", "LASF", "pdal translate c.las cloud.pcd"),
    ],
)
def test_broken_clouds_are_refused_by_name(tmp_path, name, text, said):
    with pytest.raises(WorldFileError, match=re.escape(said)):
        imported(write(tmp_path, name, text))


ROBOT_SCENE = """<mujoco><compiler meshdir="assets"/><asset><mesh file="rock.obj"/>
<mesh name="hull" file="robot.obj"/></asset><worldbody><geom type="plane" size="9 9 1"/>
<geom type="box" size="1 1 1" pos="5 0 1"/><geom type="mesh" mesh="rock" pos="-3 0 1"/>
<body name="robot"><freejoint/><geom type="mesh" mesh="hull"/></body></worldbody></mujoco>
"""


def test_meshes_of_a_robot_that_is_left_out_need_not_be_there(tmp_path):
    (tmp_path / "assets").mkdir()
    write(tmp_path / "assets", "rock.obj", TETRAHEDRON)
    scene = write(tmp_path, "scene.xml", ROBOT_SCENE)
    with pytest.raises(WorldFileError, match=r"no file 'robot\.obj', which it names; .*--without"):
        imported(scene)
    world = imported(scene, without=("robot",))
    assert sorted(type(solid).__name__ for solid in world.solids) == ["Box", "ConvexMesh"]


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


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


# ---- parts and ends


@pytest.mark.parametrize("seed", range(20))
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
