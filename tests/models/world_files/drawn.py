"""Worlds of boxes drawn at random, written as the tools of others write them, and rays at them."""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import dataclass

import mujoco
import numpy as np

from tests.models.world_files.written import write

UNIT = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
QUADS = np.array(
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)
TRIANGLES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])
CELL = 0.1
FLOOR_REACH = 7.0
"""Half the side of the floor that the imported world has at least, m."""

FLOOR = (np.array([0.0, 0.0, -1.0]), np.eye(3), np.array([1e5, 1e5, 2.0]))


@dataclass
class Drawn:
    """Boxes (centre, rotation, size), and a file with them.

    Attributes:
        boxes: What the file means.
        path: The file.
        options: Options of its import.
        near: Distance within which a surface may be imported, m.
    """

    boxes: list
    path: object = None
    options: dict = None
    near: float = 2e-3


def rotation(roll, pitch, yaw):
    """Return the rotation of fixed-axis angles, rad, written out."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles(R):
    """Return roll, pitch, yaw of a rotation, rad."""
    return np.arctan2(R[2, 1], R[2, 2]), np.arcsin(-R[2, 0]), np.arctan2(R[1, 0], R[0, 0])


def quaternion(R):
    """Return w, x, y, z of a rotation whose angle is below a half turn."""
    w = np.sqrt(max(1.0 + np.trace(R), 1e-12)) / 2
    return np.array(
        [w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w))]
    )


def boxes(rng, upright):
    """Draw boxes; upright ones stand on the floor, 2 m high, as a flat map means them."""
    listed = []
    for _ in range(rng.integers(1, 5)):
        size, place = rng.uniform(0.3, 1.5, 3), rng.uniform(-3, 3, 3)
        turn = rng.uniform(-1.4, 1.4, 3)
        if upright:
            size[2], place[2], turn[:2] = 2.0, 1.0, 0.0
        else:
            place[2] = rng.uniform(0.3, 1.5)
        listed.append((place, rotation(*turn), size))
    return listed


def first_hits(solids, origins, rays, grown):
    """Return the distances (n,) of boxes, grown by a length on each side, along rays, m."""
    best = np.full(len(origins), np.inf)
    for centre, R, size in solids:
        half = size / 2 + grown
        if (half <= 0).any():
            continue
        start, along = (origins - centre) @ R, rays @ R
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-half - start) / along, (half - start) / along
        enter = np.minimum(one, other).max(axis=1)
        leave = np.maximum(one, other).min(axis=1)
        met = (enter <= leave) & (leave > 0)
        best = np.where(met, np.minimum(best, np.maximum(enter, 0)), best)
    return best


def wrong_rays(world, drawn, seed, count=80):
    """Return how many rays end before the grown boxes or within the shrunk ones, of how many."""
    rng = np.random.default_rng(seed)
    solids = [*drawn.boxes, FLOOR]
    origins = np.column_stack([rng.uniform(-5, 5, (count, 2)), rng.uniform(0.3, 1.6, count)])
    centres = np.array([centre for centre, _, _ in drawn.boxes])
    rays = (
        centres[rng.integers(len(centres), size=count)] + rng.normal(0, 0.6, (count, 3)) - origins
    )
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    outside = first_hits(solids, origins, rays, 2 * drawn.near + 0.01) > 0
    origins, rays = origins[outside], rays[outside]
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hit = np.zeros(1, np.int32)
    lines = zip(origins, rays, strict=True)
    found = np.array([mujoco.mj_ray(model, data, o, r, None, 1, -1, hit) for o, r in lines])
    found[found < 0] = np.inf
    low = first_hits(solids, origins, rays, drawn.near)
    high = first_hits(solids, origins, rays, -drawn.near)
    ends = origins + np.minimum(high, 1e3)[:, None] * rays
    known = (np.abs(ends[:, :2]) < FLOOR_REACH).all(axis=1) | np.isinf(high)
    wrong = (found < low - 1e-6) | (found > high + 1e-6)
    return int((wrong & known).sum()), int(known.sum())


def split(rng, centre, R):
    """Return a pose as two, one in the other: (p, R), (p, R)."""
    outer = rng.uniform(-2, 2, 3), rotation(*rng.uniform(-0.6, 0.6, 3))
    return outer, (outer[1].T @ (centre - outer[0]), outer[1].T @ R)


def sdf_pose(rng, place, R, more=""):
    values = angles(R)
    if rng.random() < 0.3:
        more, values = more + " degrees='true'", np.degrees(values)
    return f"<pose{more}>{' '.join(f'{v:.9f}' for v in (*place, *values))}</pose>"


def sdf(rng, drawn, folder):
    models = []
    for k, (centre, R, size) in enumerate(drawn.boxes):
        outer, inner = split(rng, centre, R)
        middle, last = split(rng, *inner)
        box = f"<geometry><box><size>{' '.join(f'{v:.9f}' for v in size)}</size></box></geometry>"
        collision = f"<collision name='c'>{sdf_pose(rng, *last)}{box}</collision>"
        form = rng.integers(3)
        if form == 0:  # model, link, collision
            body = f"<link name='l'>{sdf_pose(rng, *middle)}{collision}</link>"
        elif form == 1:  # a model in the model
            link = f"<link name='l'>{collision}</link>"
            body = f"<link name='a'/><model name='n'>{sdf_pose(rng, *middle)}{link}</model>"
        else:  # a link in a frame
            frame = f"<frame name='f'>{sdf_pose(rng, *middle)}</frame>"
            body = f"{frame}<link name='l'><pose relative_to='f'/>{collision}</link>"
        models.append(f"<model name='m{k}'><static>1</static>{sdf_pose(rng, *outer)}{body}</model>")
    drawn.path = write(
        folder, "w.sdf", f"<sdf version='1.9'><world name='w'>{''.join(models)}</world></sdf>"
    )


def urdf(rng, drawn, folder):
    def origin(place, R):
        return (
            f"<origin xyz='{' '.join(f'{v:.9f}' for v in place)}' "
            f"rpy='{' '.join(f'{v:.9f}' for v in angles(R))}'/>"
        )

    parts = ["<link name='root'/>"]
    for k, (centre, R, size) in enumerate(drawn.boxes):
        outer, inner = split(rng, centre, R)
        middle, last = split(rng, *inner)
        listed = " ".join(f"{v:.9f}" for v in size)
        parts.append(
            f"<link name='a{k}'/><link name='b{k}'><collision>{origin(*last)}<geometry>"
            f"<box size='{listed}'/></geometry></collision></link>"
            f"<joint name='j{k}' type='fixed'><parent link='root'/><child link='a{k}'/>"
            f"{origin(*outer)}</joint><joint name='k{k}' type='fixed'><parent link='a{k}'/>"
            f"<child link='b{k}'/>{origin(*middle)}</joint>"
        )
    drawn.path = write(folder, "w.urdf", f"<robot name='w'>{''.join(parts)}</robot>")


def corners(rng, drawn):
    """Return vertices (n, 3), m, and faces of all boxes, some turned inside out."""
    points, faces = [], []
    for centre, R, size in drawn.boxes:
        own = QUADS[:, ::-1] if rng.random() < 0.3 else QUADS
        faces += (own + len(points)).tolist()
        points += (centre + (UNIT * size) @ R.T).tolist()
    return np.array(points), faces


def scaled(rng, drawn):
    drawn.options["scale"] = float(rng.choice([1.0, 0.001, 0.0254, 2.0]))
    return drawn.options["scale"]


def cut(rng, faces):
    """Return faces of four corners, some cut in two triangles."""
    listed = []
    for a, b, c, d in faces:
        listed += [(a, b, c, d)] if rng.random() < 0.5 else [(a, b, c), (a, c, d)]
    return listed


def obj(rng, drawn, folder):
    points, faces = corners(rng, drawn)
    lines = [f"v {' '.join(f'{v:.9f}' for v in p)}" for p in points / scaled(rng, drawn)]
    back = rng.random() < 0.3
    texts = ["{}", "{}//1", "{}/1", "{}/1/1"]
    text = texts[rng.integers(4)]
    lines += ["vn 0 0 1", "vt 0 0", "o all", "s off", "usemtl none"]
    for face in cut(rng, faces):
        listed = [k - len(points) if back else k + 1 for k in face]
        lines.append("f " + " ".join(text.format(k) for k in listed))
    drawn.path = write(folder, "w.obj", "\n".join(lines) + "\n")


def stl(rng, drawn, folder):
    points, faces = corners(rng, drawn)
    points = points / scaled(rng, drawn)
    halves = [half for quad in faces for half in (quad[:3], [quad[0], *quad[2:]])]
    triangles = [points[half] for half in halves]
    if rng.random() < 0.5:
        rows = [struct.pack("<12fH", 0, 0, 0, *one.ravel(), 0) for one in triangles]
        head = b"solid of a tool".ljust(80, b" ") + struct.pack("<I", len(rows))
        drawn.path = write(folder, "w.stl", head + b"".join(rows))
        return
    text = ["solid w"]
    for one in triangles:
        text += ["facet normal 0 0 0", "outer loop"]
        text += [f"vertex {' '.join(f'{v:.9e}' for v in p)}" for p in one]
        text += ["endloop", "endfacet"]
    drawn.path = write(folder, "w.stl", "\n".join([*text, "endsolid w"]) + "\n")


def ply(rng, drawn, folder):
    points, faces = corners(rng, drawn)
    points, faces = points / scaled(rng, drawn), cut(rng, faces)
    form = ["ascii", "binary_little_endian", "binary_big_endian"][rng.integers(3)]
    order = ">" if "big" in form else "<"
    strips = rng.random() < 0.3
    name = rng.choice(["vertex_indices", "vertex_index"])
    head = [f"ply\nformat {form} 1.0\nelement vertex {len(points)}"]
    head += ["property float x", "property float y", "property float z"]
    if strips:
        joined = []
        for face in faces:
            joined += [*((face[0], face[1], face[3], face[2]) if len(face) == 4 else face), -1]
        head += ["element tristrips 1", f"property list int int {name}", "end_header\n"]
        lists, count = [joined], "i"
    else:
        head += [f"element face {len(faces)}", f"property list uchar int {name}", "end_header\n"]
        lists, count = faces, "B"
    data = "\n".join(head).encode()
    if form == "ascii":
        rows = [" ".join(f"{v:.9e}" for v in p) for p in points]
        rows += [" ".join(map(str, (len(face), *face))) for face in lists]
        data += ("\n".join(rows) + "\n").encode()
    else:
        data += points.astype(f"{order}f4").tobytes()
        data += b"".join(
            struct.pack(f"{order}{count}{len(face)}i", len(face), *face) for face in lists
        )
    drawn.path = write(folder, "w.ply", data)


Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""Rotation of points z up to points y up, as glTF has them."""


def gltf(rng, drawn, folder):
    mode = int(rng.choice([4, 4, 5]))
    triangles = TRIANGLES[:, ::-1] if rng.random() < 0.3 else TRIANGLES
    numbers = triangles.ravel()
    if mode == 5:  # one strip, whose triangles are joined by ones without an area
        numbers = np.concatenate([[a, a, b, c, c, c] for a, b, c in triangles])
    whole = UNIT.astype("<f4").tobytes() + numbers.astype("<u2").tobytes()
    nodes, roots = [], []
    for centre, R, size in drawn.boxes:
        outer, inner = split(rng, Y_UP @ centre, Y_UP @ R)
        sign = np.ones(3) if rng.random() < 0.7 else rng.choice([-1.0, 1.0], 3)
        leaf = {"mesh": 0, "translation": inner[0].tolist()}
        w, *xyz = quaternion(inner[1])
        leaf |= {"rotation": [*xyz, w], "scale": (size * sign).tolist()}
        if rng.random() < 0.5:
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = outer[1], outer[0]
            top = {"matrix": matrix.T.ravel().tolist()}
        else:
            w, *xyz = quaternion(outer[1])
            top = {"rotation": [*xyz, w], "translation": outer[0].tolist()}
        nodes += [top | {"children": [len(nodes) + 1]}, leaf]
        roots.append(len(nodes) - 2)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "buffers": [{"byteLength": len(whole)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": len(whole) - 96},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3",
             "min": [-0.5] * 3, "max": [0.5] * 3},
            {"bufferView": 1, "componentType": 5123, "count": len(numbers), "type": "SCALAR"},
        ],
    }  # fmt: skip
    if rng.random() < 0.5:
        uri = "data:application/octet-stream;base64," + base64.b64encode(whole).decode()
        document["buffers"][0]["uri"] = uri
        drawn.path = write(folder, "w.gltf", json.dumps(document))
        return
    text = json.dumps(document).encode()
    text, whole = text.ljust(-(-len(text) // 4) * 4), whole.ljust(-(-len(whole) // 4) * 4, b"\0")
    length = 12 + 8 + len(text) + 8 + len(whole)
    data = struct.pack("<4sII", b"glTF", 2, length) + struct.pack("<I4s", len(text), b"JSON")
    data += text + struct.pack("<I4s", len(whole), b"BIN\0") + whole
    drawn.path = write(folder, "w.glb", data)


UP = {
    "Z_UP": np.eye(3),
    "Y_UP": Y_UP,
    "X_UP": np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
}
"""Rotations of points z up to the axes of COLLADA: right and in are -y and z of `X_UP`."""


def dae(rng, drawn, folder):
    up = str(rng.choice(list(UP)))
    metre = float(rng.choice([1.0, 0.01, 0.0254]))
    nodes = []
    for k, (centre, R, size) in enumerate(drawn.boxes):
        outer, inner = split(rng, UP[up] @ centre, UP[up] @ R)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = outer[1], outer[0] / metre
        x, y, z = np.degrees(angles(inner[1]))
        nodes.append(
            f"<node id='o{k}'><matrix>{' '.join(f'{v:.9f}' for v in matrix.ravel())}</matrix>"
            f"<node id='i{k}'><translate>{' '.join(f'{v:.9f}' for v in inner[0] / metre)}"
            f"</translate><rotate>0 0 1 {z:.9f}</rotate><rotate>0 1 0 {y:.9f}</rotate>"
            f"<rotate>1 0 0 {x:.9f}</rotate>"
            f"<scale>{' '.join(f'{v:.9f}' for v in size / metre)}</scale>"
            "<instance_geometry url='#cube'/></node></node>"
        )
    points = " ".join(f"{v}" for v in UNIT.ravel())
    source = "<input semantic='VERTEX' source='#v' offset='0'/>"
    if rng.random() < 0.5:
        listed = " ".join(map(str, TRIANGLES.ravel()))
        faces = f"<triangles count='12'>{source}<p>{listed}</p></triangles>"
    else:
        listed = " ".join(map(str, QUADS.ravel()))
        faces = f"<polylist count='6'>{source}<vcount>{'4 ' * 6}</vcount><p>{listed}</p></polylist>"
    drawn.path = write(
        folder,
        "w.dae",
        "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'>"
        f"<asset><unit meter='{metre}'/><up_axis>{up}</up_axis></asset><library_geometries>"
        f"<geometry id='cube'><mesh><source id='p'><float_array id='a' count='24'>{points}"
        "</float_array><technique_common><accessor source='#a' count='8' stride='3'>"
        "<param name='X' type='float'/><param name='Y' type='float'/>"
        "<param name='Z' type='float'/></accessor></technique_common></source>"
        "<vertices id='v'><input semantic='POSITION' source='#p'/></vertices>"
        f"{faces}</mesh></geometry></library_geometries><library_visual_scenes>"
        f"<visual_scene id='s'>{''.join(nodes)}</visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url='#s'/></scene></COLLADA>",
    )


def inside(solids, points):
    """Return whether points (n, 3) lie in a box."""
    found = np.zeros(len(points), bool)
    for centre, R, size in solids:
        found |= (np.abs((points - centre) @ R) <= size / 2).all(axis=1)
    return found


def ros_map(rng, drawn, folder):
    count, yaw = 120, float(rng.choice([0.0, rng.uniform(-3, 3)]))
    corner = np.array([0.0, 0.0]) - rotation(0, 0, yaw)[:2, :2] @ np.full(2, count * CELL / 2)
    own = (np.stack(np.meshgrid(np.arange(count), np.arange(count)), -1) + 0.5) * CELL
    flat = own.reshape(-1, 2) @ rotation(0, 0, yaw)[:2, :2].T + corner
    closed = inside(drawn.boxes, np.column_stack([flat, np.ones(len(flat))])).reshape(count, count)
    negate = int(rng.random() < 0.5)
    grey = np.where(closed ^ bool(negate), 0, 254)[::-1]  # the first row is the one at the top
    if rng.random() < 0.5:
        data = f"P5\n# by a tool\n{count} {count}\n255\n".encode() + grey.astype(np.uint8).tobytes()
    else:
        rows = "\n".join(" ".join(map(str, row)) for row in grey)
        data = f"P2\n{count} {count}\n255\n{rows}\n".encode()
    write(folder, "w.pgm", data)
    x, y = corner
    numbers = [f"{v:.9f}" for v in (x, y, yaw)]
    origin = f"origin: [{', '.join(numbers)}]", "origin:\n- " + "\n- ".join(numbers)
    text = f"image: w.pgm\nresolution: {CELL}\n{origin[rng.integers(2)]}\nnegate: {negate}\n"
    text += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    drawn.path, drawn.near = write(folder, "w.yaml", text), CELL


def octomap(rng, drawn, folder):
    from pyoctomap import OcTree

    tree = OcTree(CELL)
    for point in lattice(drawn.boxes):
        tree.updateNode(point, True)
    drawn.path = folder / ("w.bt" if rng.random() < 0.5 else "w.ot")
    if drawn.path.suffix == ".bt":
        tree.writeBinary(str(drawn.path))
    else:
        tree.write(str(drawn.path))
    drawn.near = CELL * np.sqrt(3.0)


def lattice(solids):
    """Return the centres of cells in boxes and above the floor."""
    axes = np.arange(-5, 5, CELL) + CELL / 2, np.arange(-5, 5, CELL) + CELL / 2
    grid = np.stack(np.meshgrid(*axes, np.arange(0, 3.5, CELL) + CELL / 2), -1).reshape(-1, 3)
    return grid[inside(solids, grid)]


def pcd(rng, drawn, folder):
    points = lattice(drawn.boxes) + rng.uniform(-0.03, 0.03)
    form = rng.choice(["ascii", "binary"])
    wide = "8" if rng.random() < 0.3 else "4"
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\n"
        f"SIZE {wide} {wide} {wide} 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {form}\n"
    ).encode()
    if form == "ascii":
        data = "".join(" ".join(f"{v:.6f}" for v in p) + " 0\n" for p in points).encode()
    else:
        rows = np.zeros(len(points), [(name, f"<f{wide}") for name in "xyz"] + [("rgb", "<f4")])
        for k, name in enumerate("xyz"):
            rows[name] = points[:, k]
        data = rows.tobytes()
    drawn.path, drawn.near = write(folder, "w.pcd", head + data), CELL * np.sqrt(3.0)


FORMATS = {
    "sdf": (sdf, False),
    "urdf": (urdf, False),
    "obj": (obj, False),
    "stl": (stl, False),
    "ply": (ply, False),
    "gltf": (gltf, False),
    "dae": (dae, False),
    "ros map": (ros_map, True),
    "octomap": (octomap, True),
    "pcd": (pcd, True),
}
"""Format -> writer, and whether its boxes stand upright."""


def draw(name, seed, folder):
    """Draw boxes, and write them in a format."""
    rng = np.random.default_rng(seed)
    writer, upright = FORMATS[name]
    drawn = Drawn(boxes(rng, upright), options={})
    writer(rng, drawn, folder)
    return drawn
