"""Meshes and polylines, cut into convex pieces, and the insides of those that are not cut."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tests.models.world_files.gazebo_files import CUBE, box, ground, mesh, read, world, write
from wayproof.models.world_files import WorldFileError
from wayproof.models.world_files.hulls import prisms
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.meshes import (
    cell_parts,
    is_closed,
    mesh_parts,
    winding_number,
)
from wayproof.models.world_files.parts import Mesh, turned_by
from wayproof.models.world_files.solids import solid_of

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit meter="0.01"/><up_axis>{up}</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array>
   <technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
  </source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s">
  <node name="near"><instance_geometry url="#g"/></node>
  <node name="far"><translate>1000 0 0</translate><instance_geometry url="#g"/></node>
 </visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def test_collada_is_read_in_metres_with_its_nodes(tmp_path):
    write(tmp_path / "m.dae", DAE.format(up="Y_UP"))
    first, second = read(write(tmp_path / "m.sdf", mesh("m.dae")))[0].solids
    np.testing.assert_allclose(first.high, (1.0, 2.0, 3.0))  # Gazebo does not turn it
    np.testing.assert_allclose(second.low, (10.0, 0.0, 0.0), atol=1e-6)
    more = "<submesh><name>far</name><center>true</center></submesh><scale>1 2 1</scale>"
    (alone,) = read(write(tmp_path / "s.sdf", mesh("m.dae", more)))[0].solids
    np.testing.assert_allclose((alone.low, alone.high), ((-0.5, -2, -1.5), (0.5, 2, 1.5)))
    with pytest.raises(WorldFileError, match=r"no submesh 'x' \(available: near, far\)"):
        read(write(tmp_path / "x.sdf", mesh("m.dae", "<submesh><name>x</name></submesh>")))
    by_itself, notes = read(tmp_path / "m.dae")
    np.testing.assert_allclose(by_itself.solids[0].high, (1.0, 0.0, 2.0), atol=1e-6)
    assert notes[0] == "m.dae: its y axis is up, turned to z"


def test_gltf_is_read(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "m.glb")
    (solid,) = read(write(tmp_path / "m.sdf", mesh("m.glb")))[0].solids
    np.testing.assert_allclose(solid.high, (0.5, 1.0, 1.5))
    np.testing.assert_allclose(read(tmp_path / "m.glb")[0].solids[0].high, (0.5, 1.5, 1.0))


@pytest.mark.parametrize("text", ["<!DOCTYPE b [<!ENTITY a 'ha'>]><COLLADA/>", "<COLLADA", "x"])
def test_broken_collada_is_one_line(tmp_path, text):
    with pytest.raises(
        WorldFileError, match=r"m\.dae(:1)?: (document type|no mesh|no XML)"
    ) as error:
        read(write(tmp_path / "m.dae", text))
    assert "\n" not in str(error.value)


def room(path):
    """Write four walls in one piece, 9 m wide and 0.2 m thick."""
    lines, faces = [], []
    for r in (4.5, 4.3):
        for z in (0, 2):
            lines += [f"v {x} {y} {z}" for x, y in ((-r, -r), (r, -r), (r, r), (-r, r))]
    for k in range(4):
        n = (k + 1) % 4
        for a, b, c, d in ((k, n, 4 + n, 4 + k), (8 + n, 8 + k, 12 + k, 12 + n),
                           (4 + k, 4 + n, 12 + n, 12 + k), (n, k, 8 + k, 8 + n)):  # fmt: skip
            faces += [f"f {a + 1} {b + 1} {c + 1}", f"f {a + 1} {c + 1} {d + 1}"]
    return write(path, "\n".join(lines + faces))


def test_a_hollow_mesh_that_is_no_prisms_is_taken_as_boxes(tmp_path):
    path = room(tmp_path / "room.obj")
    path.write_text(path.read_text().replace("v 4.5 4.5 2\n", "v 4.5 4.5 2.5\n"))
    found, notes = import_world(path)
    assert len(found.solids) <= 80
    assert "room.obj: 1 of 1 pieces not convex: taken as boxes of cells, within 0.087 m" in notes
    for point in (found.start, found.goal):
        assert np.abs(point[:2]).max() < 4.0  # inside
    nearest = min(solid.distance([[0.0, 0.0, 1.0]])[0] for solid in found.solids)
    assert nearest == pytest.approx(4.3, abs=0.051)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -0.5, 1.0)])
def test_a_wall_with_a_door_is_cut_exactly(tmp_path, turn):
    """Two points in the wall, beside and above its door, and one in the door."""
    wall = [(0, 0), (2, 0), (2, 2), (3, 2), (3, 0), (9, 0), (9, 2.5), (0, 2.5)]
    caps = [(0, 1, 2), (0, 2, 7), (7, 2, 6), (2, 3, 6), (3, 5, 6), (3, 4, 5)]
    R = turned_by(*turn)
    points = [R @ (x, y, z) for y in (0.0, 0.2) for x, z in wall]
    faces = [*caps, *(tuple(8 + n for n in cap[::-1]) for cap in caps)]
    for n in range(8):
        after = (n + 1) % 8
        faces += [(n, 8 + after, after), (n, 8 + n, 8 + after)]
    text = "".join("v {} {} {}\n".format(*point) for point in points)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    parts = mesh_parts(write(tmp_path / "w.obj", text), np.ones(3), notes := [])
    assert notes == ["w.obj: 1 of 1 pieces not convex: cut into prisms, within 0.000 m"]
    inside = np.array([(1.0, 0.1, 1.0), (2.5, 0.1, 2.2), (2.5, 0.1, 1.0)]) @ R.T
    nearest = np.min([solid_of(part).distance(inside) for part in parts], axis=0)
    np.testing.assert_allclose(nearest, (0.0, 0.0, 0.5), atol=1e-6)


def test_pieces_by_their_kind(tmp_path):
    parts = mesh_parts(write(tmp_path / "c.obj", CUBE), np.ones(3), notes := [])
    assert (len(parts), notes) == (1, [])
    sheet = write(tmp_path / "f.obj", "v 0 0 1\nv 9 0 1\nv 9 9 1\nv 0 9 1\nf 1 2 3\nf 1 3 4\n")
    (part,) = mesh_parts(sheet, np.ones(3), notes)
    assert part.bounds[:, 2].tolist() == [0.99, 1.0]
    hills = [f"v {x} {y} {(x * y) % 3}" for y in range(7) for x in range(7)]
    faces = [f"f {a} {a + 1} {a + 8}\nf {a} {a + 8} {a + 7}"
             for y in range(6) for a in range(7 * y + 1, 7 * y + 7)]  # fmt: skip
    path = write(tmp_path / "h.obj", "\n".join(hills + faces))
    (part,) = mesh_parts(path, np.ones(3), notes)
    assert (part.shape, part.kind) == ("heights", "floor")
    below = [" ".join(["f", *line.split()[:0:-1]]) for line in "\n".join(faces).splitlines()]
    path = write(tmp_path / "h.obj", "\n".join([*hills, *faces, *below]))  # from both sides
    (part,) = mesh_parts(path, np.ones(3), notes)
    assert (part.shape, part.kind) == ("heights", "floor")
    assert notes[-1].endswith("within 0.000 m")


def test_a_piece_close_to_its_hull_is_that_hull(tmp_path):
    dented = CUBE.replace("v 0 1 1", "v 0.03 0.97 0.97")  # one corner pushed in by 3 cm
    (part,) = mesh_parts(write(tmp_path / "c.obj", dented), np.ones(3), notes := [])
    assert part.bounds[1].tolist() == [1.0, 1.0, 1.0]
    assert notes == ["c.obj: 1 of 1 pieces taken as their convex hull, within 0.018 m"]


def test_meshes_in_the_media_folder_of_a_package(tmp_path):
    write(tmp_path / "p/package.xml", "<package><name>p</name></package>")
    write(tmp_path / "p/Media/models/c.obj", CUBE)
    found, _ = read(write(tmp_path / "p/worlds/a.world", mesh("file://c.obj")))
    assert len(found.solids) == 1


def test_polylines_fill_their_outline(tmp_path):
    corners = [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (0, 1)]  # an L
    points = "".join(f"<point>{x} {y}</point>" for x, y in corners)
    shape = box().replace(
        "<box><size>1 1 1</size></box>", f"<polyline>{points}<height>2</height></polyline>"
    )
    found, _ = read(write(tmp_path / "a.world", world(ground(), shape)))
    near = [min(float(s.distance([[x, y, 1.0]])[0]) for s in found.solids)
            for x, y in ((3.5, 2.5), (1.0, 0.5), (1.0, 2.0))]  # fmt: skip
    np.testing.assert_allclose(near, (0.0, 0.0, 1.0), atol=1e-12)
    with pytest.raises(ValueError, match="crosses itself"):
        prisms([np.array([(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0), (1.0, 3.0)])], 1.0)


FRAME = [[(0, 0), (6, 0), (6, 4), (0, 4)], [(1, 1), (5, 1), (5, 3), (3, 2), (1, 3)]]
"""A frame about a hole with a corner that points into it."""


def polylines(*rings, heights=(2, 2, 2)):
    texts = []
    for ring, height in zip(rings, heights, strict=False):
        points = "".join(f"<point>{x} {y}</point>" for x, y in ring)
        texts.append(f"<polyline>{points}<height>{height}</height></polyline>")
    return box().replace("<box><size>1 1 1</size></box>", "".join(texts))


def test_an_outline_in_another_is_a_hole_and_one_in_that_stands(tmp_path):
    island = [(3, 1.2), (3.4, 1.2), (3.2, 1.4)]
    found, _ = read(write(tmp_path / "a.world", world(ground(), polylines(*FRAME, island))))
    points = {(0.5, 2.0): True, (1.5, 2.0): False, (3.0, 2.5): True, (3.2, 1.25): True,
              (3.2, 1.6): False, (5.5, 3.9): True, (2.0, 2.4): False}  # fmt: skip
    for (x, y), solid in points.items():
        nearest = min(float(one.distance([[x, y, 1.0]])[0]) for one in found.solids)
        assert (nearest == 0.0) == solid, (x, y)


def test_the_pieces_of_outlines_with_holes_have_their_area():
    rng = np.random.default_rng(1)
    square = np.array([(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)])
    triangle = np.array([(-5.0, -3.0), (3.0, -5.0), (4.0, 8.0)])
    for count in range(50):
        turns, away = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9)), rng.uniform(0.1, 0.8, (9, 1))
        inner = away * np.column_stack([np.cos(turns), np.sin(turns)])
        outer = (square, triangle)[count % 2]
        pieces = prisms([outer, inner], 1.0)
        filled = sum(ConvexHull(piece.vertices).volume for piece in pieces)
        assert filled == pytest.approx(area(outer) - abs(area(inner)), abs=1e-9)


def area(corners):
    x, y = corners.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2.0


@pytest.mark.parametrize(
    ("rings", "heights", "said"),
    [
        (FRAME, (2, 1), "outlines of 2 heights"),
        ([FRAME[0], [(5, 1), (9, 1), (9, 2)]], (2, 2), "outlines that cross"),
        ([FRAME[0], [(1, 1), (2, 1)]], (2, 2), "got 2 corners, expected 3"),
    ],
)
def test_holes_that_are_none_are_refused(tmp_path, rings, heights, said):
    path = write(tmp_path / "a.world", world(ground(), polylines(*rings, heights=heights)))
    with pytest.raises(WorldFileError, match=f"<polyline>: {said}"):
        read(path)


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
    [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip
"""A cube of 1 m, counter-clockwise from outside."""

CELL = 0.05


def volume(parts):
    return sum(8.0 * np.prod(part.size) for part in parts)


def shell():
    """A room: walls of 0.2 m around a hollow that no way leads to."""
    inner = 0.2 + 0.6 * CORNERS
    return Mesh(np.vstack([CORNERS, inner]), np.vstack([FACES, FACES[:, ::-1] + 8]))


def test_a_surface_winds_once_around_what_is_inside():
    inside, outside = np.array([0.5, 0.5, 0.5]), np.array([1.5, 0.5, 0.5])
    for surface, point, times in (
        (Mesh(CORNERS, FACES), inside, 1), (Mesh(CORNERS, FACES), outside, 0),
        (Mesh(CORNERS, FACES[:, ::-1]), inside, -1), (shell(), inside, 0),
        (shell(), np.array([0.01, 0.9, 0.4]), 1),
    ):  # fmt: skip
        assert winding_number(surface, point) == pytest.approx(times, abs=1e-9)


def test_closed_surfaces_are_told_from_open_ones():
    assert is_closed(FACES)
    assert is_closed(FACES[:, ::-1])
    assert not is_closed(FACES[1:])
    assert not is_closed(np.vstack([FACES[1:], FACES[0, ::-1]]))  # one triangle is turned
    assert not is_closed(np.vstack([FACES, FACES]))


def test_a_closed_mesh_is_solid_and_a_room_in_it_is_not():
    cube, outer = Mesh(CORNERS, FACES), 1.05**3  # its far faces lie in a layer of their own
    assert volume(cell_parts("m", cube, CELL)) == pytest.approx(outer)
    assert volume(cell_parts("m", shell(), CELL)) == pytest.approx(outer - 0.55**3)


@pytest.mark.parametrize("faces", [FACES[:, ::-1], FACES[1:]])
def test_what_is_open_or_faces_inwards_stays_hollow(faces):
    assert volume(cell_parts("m", Mesh(CORNERS, faces), CELL)) < 1.05**3 - 0.9**3


def test_what_is_drawn_from_both_sides_stays_hollow(tmp_path):
    """A finely cut cube with a notch, so that it is neither convex nor cut."""
    trimesh = pytest.importorskip("trimesh")
    block = trimesh.creation.box((2.0, 2.0, 2.0)).subdivide_to_size(0.1)
    vertices = block.vertices.copy()
    vertices[(vertices[:, 2] > 0.99) & (np.abs(vertices[:, :2]).max(axis=1) < 0.5), 2] = 0.0
    for faces, filled in (
        (block.faces, True),
        (np.vstack([block.faces, block.faces[:, ::-1]]), False),
    ):
        trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "m.stl")
        parts = mesh_parts(tmp_path / "m.stl", np.ones(3), [])
        at_middle = [
            part
            for part in parts
            if (np.abs(np.array([0.8, 0.8, -0.5]) - part.position) < part.size).all()
        ]
        assert bool(at_middle) == filled
