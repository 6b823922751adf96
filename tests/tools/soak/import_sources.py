"""Small sound files of every format that is imported, to be broken: each with the files it names.

All that they hold is smaller than a robot, so that no mesh is cut into convex pieces.
"""

from __future__ import annotations

import base64
import io
import struct
from collections.abc import Callable

import numpy as np

from tests.tools.soak.hostile_files import (
    LINK,
    MAP,
    PCD,
    PLY,
    POLYLIST,
    SDF,
    SQUARE_NODE,
    collada,
    gltf,
    png,
)

Files = dict[str, bytes]
"""Content by name; the first is imported."""

CORNERS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
"""A tetrahedron."""

ACTOR = (
    "<actor name='a'><script><delay_start>1</delay_start><trajectory id='0'><waypoint><time>0"
    "</time><pose>1 2 1 0 0 0</pose></waypoint><waypoint><time>4</time><pose>3 2 1 0 0 0</pose>"
    "</waypoint></trajectory></script></actor>"
)


def _sdf(shape: str, more: str = "") -> bytes:
    ground = "<include><uri>model://ground_plane</uri></include>"
    model = f"<model name='m'><pose>2 1 0 0 0 0.3</pose>{LINK.format(shape)}</model>"
    return SDF.format(ground + model + more).encode()


def _stl() -> bytes:
    rows = np.zeros(len(FACES), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = CORNERS[FACES]
    return bytes(80) + struct.pack("<I", len(FACES)) + rows.tobytes()


def _obj() -> bytes:
    lines = ["v {} {} {}".format(*corner) for corner in CORNERS.tolist()]
    return "\n".join(lines + ["f {} {} {}".format(*face) for face in (FACES + 1).tolist()]).encode()


def _ply() -> bytes:
    head = PLY.format("element vertex 4\n")
    faces = "element face 4\nproperty list uchar int vertex_indices\nend_header"
    body = b"".join(b"\x03" + face.astype("<i4").tobytes() for face in FACES)
    head = head.replace("end_header", faces)
    return head.encode() + CORNERS.astype("<f4").tobytes() + body


def _gltf() -> bytes:
    data = base64.b64encode(CORNERS[:3].astype("<f4").tobytes()).decode()
    uri = "data:application/octet-stream;base64," + data
    return gltf(buffers=[{"byteLength": 36, "uri": uri}]).encode()


def _glb() -> bytes:
    text = gltf(buffers=[{"byteLength": 36}]).encode()
    text += b" " * (-len(text) % 4)
    data = CORNERS[:3].astype("<f4").tobytes()
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _png() -> bytes:
    """Return an image of 17 x 17 grey levels of 8 bits."""
    return png(17, 8, b"".join(b"\0" + bytes(range(n, n + 17)) for n in range(17)))


def _tiff() -> bytes:
    """Return a DEM of 9 x 9 real numbers, not packed."""
    heights = np.add.outer(np.arange(9), np.arange(9)).astype("<f4") * 0.1
    entries = [
        (256, 4, 1, 9), (257, 4, 1, 9), (258, 3, 1, 32), (259, 3, 1, 1), (262, 3, 1, 1),
        (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, 9), (279, 4, 1, 324), (339, 3, 1, 3),
    ]  # fmt: skip
    directory = b"".join(struct.pack("<HHII", *entry) for entry in entries) + bytes(4)
    head = b"II*\0" + struct.pack("<I", 332)
    return head + heights.tobytes() + struct.pack("<H", len(entries)) + directory


def _octree(ending: str) -> bytes:
    """Return an OctoMap of one occupied cell, at the end of a chain of 15 nodes."""
    name = "OcTree binary file" if ending == ".bt" else "OcTree file"
    head = f"# Octomap {name}\nid OcTree\nsize 17\nres 0.1\ndata\n".encode()
    if ending == ".bt":
        return head + b"\x03\0" * 15 + b"\x02\0"
    node = struct.pack("<f", 1.0)
    return head + (node + b"\x01") * 16 + node + b"\0"


def _pcd(kind: str) -> bytes:
    points = np.vstack([CORNERS, CORNERS + 1.0])
    if kind == "ascii":
        rows = "\n".join(" ".join(map(str, point)) for point in points.tolist())
        return (PCD.format(8, kind) + rows).encode()
    data = points.astype("<f4")
    if kind == "binary":
        return PCD.format(8, kind).encode() + data.tobytes()
    columns = data.T.tobytes()
    packed = b"".join(bytes([31]) + columns[n : n + 32] for n in range(0, 96, 32))
    head = PCD.format(8, kind).encode()
    return head + struct.pack("<II", len(packed), len(columns)) + packed


def _mesh_in_sdf(name: str, data: bytes) -> Files:
    return {"a.world": _sdf(f"<mesh><uri>{name}</uri></mesh>"), name: data}


def _heightmap(name: str, data: bytes) -> Files:
    shape = f"<heightmap><uri>{name}</uri><size>9 9 0.4</size></heightmap>"
    return {"a.world": _sdf(shape), name: data}


DAE = collada(SQUARE_NODE, geometry=POLYLIST.format(count=4)).encode()

SOURCES: dict[str, Callable[[], Files]] = {
    "sdf": lambda: {"a.world": _sdf("<box><size>1 1 1</size></box>", ACTOR)},
    "sdf with dae": lambda: _mesh_in_sdf("m.dae", DAE),
    "sdf with png": lambda: _heightmap("h.png", _png()),
    "sdf with tif": lambda: _heightmap("h.tif", _tiff()),
    "urdf": lambda: {
        "a.urdf": b"<robot><link name='a'><collision><geometry><mesh filename='m.stl' "
                  b"scale='1 1 1'/></geometry></collision></link><link name='b'/><joint><parent "
                  b"link='a'/><child link='b'/><origin xyz='0 0 1' rpy='0 0 1'/></joint></robot>",
        "m.stl": _stl(),
    },
    "dae": lambda: {"a.dae": DAE},
    "gltf": lambda: {"a.gltf": _gltf()},
    "glb": lambda: {"a.glb": _glb()},
    "stl": lambda: {"a.stl": _stl()},
    "obj": lambda: {"a.obj": _obj()},
    "ply": lambda: {"a.ply": _ply()},
    "ply cloud": lambda: {
        "a.ply": PLY.format("element vertex 4\n").encode() + CORNERS.astype("<f4").tobytes()
    },
    "pcd text": lambda: {"a.pcd": _pcd("ascii")},
    "pcd": lambda: {"a.pcd": _pcd("binary")},
    "pcd packed": lambda: {"a.pcd": _pcd("binary_compressed")},
    "bt": lambda: {"a.bt": _octree(".bt")},
    "ot": lambda: {"a.ot": _octree(".ot")},
    "npy": lambda: {"a.npy": _npy(np.add.outer(np.arange(9), np.arange(9)) * 0.02)},
    "png": lambda: {"a.png": _png()},
    "map": lambda: {"a.yaml": MAP.format(image="m.png").encode(), "m.png": _png()},
    "map of pgm": lambda: {
        "a.yaml": MAP.format(image="m.pgm").encode(),
        "m.pgm": b"P5 17 17 255\n" + bytes(150) + bytes([254]) * 139,
    },
}  # fmt: skip
"""Format -> maker of a sound file of it."""
