"""Hostile glTF, PLY, COLLADA, URDF and SDF: each is refused in one line, before it takes much."""

import base64
import json
import re
import struct

import pytest

from wayproof.models.world_files import WorldFileError
from wayproof.models.world_files.importer import import_world

TRIANGLE = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
PLY = (
    "ply\nformat binary_little_endian 1.0\n{}property float x\nproperty float y\nproperty float z\n"
)
LINK = "<link name='{}'>{}</link>"
MESH = "<collision><geometry><mesh filename='{}'/></geometry></collision>"
JOINT = "<joint><parent link='{}'/><child link='{}'/></joint>"


def gltf(uri=None, count=3, **more):
    data = "data:application/octet-stream;base64," + base64.b64encode(TRIANGLE).decode()
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": uri or data}],
    } | more)  # fmt: skip


def doubled(count):
    below = "<instance_node url='#n{1}'/>" * 2
    nodes = "".join(f"<node id='n{k}'>{below}</node>".format(k, k + 1) for k in range(count))
    return (
        "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'>"
        f"<library_nodes>{nodes}<node id='n{count}'/></library_nodes><library_visual_scenes>"
        "<visual_scene id='s'><node><instance_node url='#n0'/></node></visual_scene>"
        "</library_visual_scenes><scene><instance_visual_scene url='#s'/></scene></COLLADA>"
    )


HOSTILE = {
    "count.gltf": (gltf(count=4_000_000_000), "12000000000 numbers, expected at most 67108864"),
    "outside.gltf": (gltf(uri="../../etc/passwd"), "'../../etc/passwd' lies outside"),
    "scheme.gltf": (gltf(uri="file:///etc/passwd"), "no such file"),
    "web.gltf": (gltf(uri="http://127.0.0.1:9/x"), "no such file"),
    "cycle.gltf": (gltf(nodes=[{"children": [1]}, {"children": [0]}]), "expected a tree"),
    "doubled.gltf": (
        gltf(nodes=[*({"children": [k + 1] * 2} for k in range(40)), {"mesh": 0}]),
        "node 1 has two parents, expected a tree",
    ),
    "deep.gltf": (
        gltf(nodes=[*({"children": [k + 1]} for k in range(9000)), {"mesh": 0}]),
        "nodes more than 60 deep",
    ),
    "fan.gltf": (
        gltf(nodes=[{"children": list(range(1, 301))}, *[{"mesh": 0}] * 300],
             meshes=[{"primitives": [{"attributes": {"POSITION": 0}}] * 100}]),
        "301 nodes with 30000 primitives, expected at most 20000 of each",
    ),
    "brackets.gltf": ("[" * 200_000, "no JSON"),
    "chunk.glb": (
        b"glTF" + struct.pack("<III", 2, 0xFFFFFFF0, 0xFFFFFFE0) + b"JSON{}",
        "a chunk of 4294967264 bytes",
    ),
    "count.ply": (PLY.format("element vertex 4000000000\n") + "end_header\n", "ends within"),
    "late.ply": (
        PLY.format("comment x\n" * 1000 + "element vertex 4000000000\n") + "end_header\n",
        "ends within its vertex elements",
    ),
    "list.ply": (
        (PLY.format("element vertex 3\n") + "element face 1\nproperty list uint int "
         "vertex_indices\nend_header\n").encode() + TRIANGLE + b"\xff" * 4,
        "a list of its face elements of no length",
    ),
    "doubled.dae": (doubled(30), "more than 20000 nodes"),
    "entity.urdf": ("<!DOCTYPE a [<!ENTITY a 'x'>]><robot name='&a;'/>", "document type"),
    "circle.urdf": (
        "<robot>" + LINK.format("a", "") + LINK.format("b", "") + JOINT.format("a", "b")
        + JOINT.format("b", "a") + "</robot>",
        "frames in a circle",
    ),
    "outside.urdf": (
        f"<robot>{LINK.format('a', MESH.format('file:///etc/passwd'))}</robot>",
        "lies outside the world's project",
    ),
    "package.urdf": (
        f"<robot>{LINK.format('a', MESH.format('package://x/../../../etc/passwd'))}</robot>",
        "no file 'package://x/../../../etc/passwd'",
    ),
    "links.urdf": ("<robot>" + "<link name='a'/>" * 6000 + "</robot>", "6000 links"),
    "far.urdf": (
        f"<robot>{LINK.format('a', MESH.replace('<mesh filename=', '<box size='))}</robot>"
        .format("1e308 1e308 1e308"),
        "a solid up to 5e+307 m away, expected 100000 at most",
    ),
    "comments.sdf": ("<!--a-->" * 60 + "<sdf version='1.6'/>", "expected <sdf> with one <world>"),
    "open.sdf": ("<!--" * 1_000_000, "no XML"),
}  # fmt: skip
"""Name of a file -> its content, and what its refusal says."""


@pytest.mark.parametrize("name", HOSTILE)
def test_refused_in_one_line(name, tmp_path):
    content, said = HOSTILE[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(WorldFileError, match=re.escape(said)) as caught:
        import_world(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_plain_gltf_is_taken(tmp_path):
    path = tmp_path / "a.gltf"
    path.write_text(gltf())
    found, _ = import_world(path)
    assert len(found.solids) == 1
