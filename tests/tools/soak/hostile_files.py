"""Hostile files for imports and studies: small files that take much, or reach outside.

Each maker writes its file into a folder and returns the arguments of the command that reads it.
"""

from __future__ import annotations

import pickle
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

from tests.models.world_files.test_hostile_meshes import HOSTILE, gltf
from wayproof.models.robots import custom

Maker = Callable[[Path], list[str]]

FILES: dict[str, Maker] = {}
"""Name of a hostile file -> function that makes it."""

BOX = "<geom type='box' size='1 1 1' pos='3 3 1'/>"
BODY = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ENTITIES = "".join(f"<!ENTITY e{k} '{(f'&e{k - 1};' if k else 'ha') * 10}'>" for k in range(10))
DAE_LAUGHS = f"<!DOCTYPE a [{ENTITIES}]><COLLADA>&e9;</COLLADA>"
MAP = "image: {image}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n" \
      "occupied_thresh: 0.65\nfree_thresh: 0.2\n"  # fmt: skip
STUDY = 'name = "hostile"\nworlds = ["empty"]\nrobots = ["drone"]\n'
AXES = (
    "costmap.localization_margin",
    "costmap.cost_range",
    "behaviour.blend_length",
    "motion.altitude_low",
)
SDF = "<sdf version='1.6'><world name='w'>{}</world></sdf>"
MODEL = "<sdf version='1.6'><model name='m'><static>1</static>{}</model></sdf>"
LINK = "<link name='l'><collision name='c'><geometry>{}</geometry></collision></link>"
DOUBLINGS = 20


SQUARE_NODE = "<node><instance_geometry url='#g'/></node>"
POLYLIST = (
    "<geometry id='g'><mesh><source id='p'><float_array id='a' count='12'>0 0 0 1 0 0 1 1 0 0 1 0"
    "</float_array><technique_common><accessor source='#a' count='4' stride='3'>"
    "<param name='X' type='float'/><param name='Y' type='float'/><param name='Z' type='float'/>"
    "</accessor></technique_common></source><vertices id='v'><input semantic='POSITION' "
    "source='#p'/></vertices><polylist count='1'><input semantic='VERTEX' source='#v' offset='0'/>"
    "<vcount>{count}</vcount><p>0 1 2 3</p></polylist></mesh></geometry>"
)
PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS {}\nDATA {}\n"
PLY = (
    "ply\nformat binary_little_endian 1.0\n{}property float x\nproperty float y\n"
    "property float z\nend_header\n"
)


def collada(nodes: str, library: str = "", geometry: str = "") -> str:
    """Return a COLLADA scene of nodes, with more of them in its library."""
    return (
        "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'>"
        f"<library_geometries>{geometry}</library_geometries>"
        f"<library_nodes>{library}</library_nodes><library_visual_scenes><visual_scene id='s'>"
        f"{nodes}</visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url='#s'/></scene></COLLADA>"
    )


def mjcf(content: str, head: str = "") -> str:
    """Return a scene with a floor, a box and the given content."""
    floor = "<geom name='floor' type='plane' size='9 9 1'/>"
    return f"<mujoco>{head}<worldbody>{floor}{BOX}{content}</worldbody></mujoco>"


def png(side: int, bits: int, rows: bytes) -> bytes:
    """Return an image of grey levels of some bits; each row begins with a zero."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", side, side, bits, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


def _white(path: Path, side: int) -> None:
    """Write a white image of one bit per pixel."""
    path.write_bytes(png(side, 1, (b"\0" + b"\xff" * (side // 8)) * side))


def _import(path: Path, *more: str) -> list[str]:
    """Return the command that imports a file."""
    return ["import", str(path), "--out", str(path.parent / "out.xml"), *more]


def _text(name: str, ending: str, text: str | bytes, *more: str) -> None:
    def make(folder: Path) -> list[str]:
        path = folder / f"hostile{ending}"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        words = _import(path, *more)
        return ["study", *words[1:]] if ending == ".toml" else words

    FILES[name] = make


def _maker(name: str) -> Callable[[Maker], Maker]:
    def add(maker: Maker) -> Maker:
        FILES[name] = maker
        return maker

    return add


def _scene(name: str, content: str, head: str = "") -> None:
    _text(name, ".xml", mjcf(content, head))


for name, (content, _) in HOSTILE.items():
    _text(f"mesh: {name}", Path(name).suffix, content)
for size in ("nuser_body", "nuser_geom", "nuser_site"):
    _scene(f"scene: {size} 4e8", "", f"<size {size}='400000000'/>")
_scene("scene: nuserdata 2e9", "", "<size nuserdata='2000000000'/>")
_scene("scene: memory 900G", "", "<size memory='900G'/>")
_scene(
    "scene: numeric of 4e8", "", "<custom><numeric name='a' size='400000000' data='1'/></custom>"
)
_scene("scene: ccd_iterations 2e9", "", "<option ccd_iterations='2000000000'/>")
_scene("scene: 20,000 bodies in one another", "<body>" * 20_000 + "</body>" * 20_000)
_scene("scene: 30,000 bodies side by side", "<body><geom size='.1'/></body>" * 30_000)
_scene(
    "scene: height field 40000 x 40000",
    "<geom type='hfield' hfield='h'/>",
    "<asset><hfield name='h' nrow='40000' ncol='40000' size='1 1 1 1'/></asset>",
)
_scene(
    "scene: texture 40000 x 40000",
    "",
    "<asset><texture name='t' type='2d' builtin='flat' width='40000' height='40000'/></asset>",
)
_scene(
    "scene: replicate 2000 x 2000 x 100",
    "<replicate count='2000' offset='1 0 0'><replicate count='2000' offset='0 1 0'>"
    "<replicate count='100' offset='0 0 1'><geom size='.1'/></replicate></replicate></replicate>",
)
_scene(
    "scene: replicate 1e6 bodies",
    "<replicate count='1000000' offset='1 0 0'><body><geom size='.1'/></body></replicate>",
)
_scene(
    "scene: flexcomp 400 x 400 x 400",
    "<flexcomp name='f' type='grid' count='400 400 400' spacing='1 1 1' radius='.1' mass='1'/>",
)
_scene("scene: a plugin", "", "<extension><plugin plugin='mujoco.elasticity.cable'/></extension>")
_text(
    "scene: billion laughs",
    ".xml",
    f"<!DOCTYPE a [{ENTITIES}]><mujoco model='&e9;'><worldbody>{BOX}</worldbody></mujoco>",
)
_text(
    "scene: billion laughs in UTF-16",
    ".xml",
    f"<?xml version='1.0' encoding='utf-16'?><!DOCTYPE a [{ENTITIES}]>"
    "<mujoco model='&e9;'/>".encode("utf-16"),
)
_text("SDF: billion laughs", ".sdf", f"<!DOCTYPE a [{ENTITIES}]>{SDF.format('&e9;')}")
_text("SDF: an external entity", ".world",
      f"<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>{SDF.format('&x;')}")  # fmt: skip
_text(
    "SDF: a mesh outside",
    ".world",
    SDF.format(
        "<model name='m'>" + LINK.format("<mesh><uri>file:///etc/passwd</uri></mesh>") + "</model>"
    ),
)
_text("voxels: 100000 x 100000 x 100000", ".3dmap", "voxel 100000 100000 100000\n0 0 0\n")
_text(
    "heights: an array of 100000 x 1000000",
    ".npy",
    b"\x93NUMPY\x01\x00\x76\x00"
    + b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000, 1000000), }".ljust(117)
    + b"\n",
    "--resolution",
    "0.1",
)
_text("mesh: STL of 4e9 triangles", ".stl", bytes(80) + b"\xff" * 4 + bytes(50))
_text("mesh: OBJ of a vertex that is not there", ".obj", BODY + "f 1 2 4000000000\n")
_text(
    "OctoMap: 4e18 nodes",
    ".bt",
    b"# Octomap OcTree binary file\nid OcTree\nsize 4000000000000000000\nres 0.1\ndata\n\xaa\xaa",
)
_text(
    "OctoMap: a cell of 32768 x 32768 x 32768",
    ".bt",
    b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.1\ndata\n\x02\x00",
)
_text(
    "OctoMap: a chain of 4e6 nodes",
    ".bt",
    b"# Octomap OcTree binary file\nid OcTree\nsize 4000000\nres 0.1\ndata\n"
    + b"\x03\x00" * 4_000_000,
)
_text(
    "OctoMap: a chain of 1.6e6 nodes with log-odds",
    ".ot",
    b"# Octomap OcTree file\nid OcTree\nsize 1600000\nres 0.1\ndata\n"
    + b"\x00\x00\x80\x3f\x01" * 1_600_000,
)
_text("cloud: PCD of 1e12 points", ".pcd", PCD.format(1_000_000_000_000, "binary"))
_text("cloud: PCD of 1e12 points in text", ".pcd", PCD.format(1_000_000_000_000, "ascii") + "0 0 0")
_text("cloud: PCD of two points 1e12 m apart", ".pcd", PCD.format(2, "ascii") + "0 0 0 1e12 0 0")
_text("mesh: glTF of 4e9 vertices without a buffer", ".gltf",
      gltf(accessors=[{"componentType": 5126, "count": 4 * 10**9, "type": "VEC3"}]))  # fmt: skip
_text("mesh: COLLADA, billion laughs", ".dae", DAE_LAUGHS)
_text(
    "mesh: COLLADA, billion laughs in UTF-16",
    ".dae",
    ("<?xml version='1.0' encoding='utf-16'?>" + DAE_LAUGHS).encode("utf-16"),
)
_text(
    "mesh: COLLADA, a document type in UTF-7",
    ".dae",
    b"<?xml version='1.0' encoding='utf-7'?>+ADwAIQ-DOCTYPE a SYSTEM 'file:///etc/passwd'+AD4-"
    b"<COLLADA/>",
)
_text("mesh: COLLADA, 50,000 nodes in one another", ".dae",
      collada("<node>" * 50_000 + "</node>" * 50_000))  # fmt: skip
_text("mesh: COLLADA, nodes that hold each other", ".dae", collada(
    "<node><instance_node url='#a'/></node>",
    "<node id='a'><instance_node url='#b'/></node><node id='b'><instance_node url='#a'/></node>",
))  # fmt: skip
_text("mesh: COLLADA, a polygon of 2e9 corners", ".dae",
      collada(SQUARE_NODE, geometry=POLYLIST.format(count=2_000_000_000)))  # fmt: skip
_text(
    "SDF: an actor of 200,000 waypoints",
    ".world",
    SDF.format("<actor name='a'><script><trajectory id='0'>" + "".join(
        f"<waypoint><time>{k}</time><pose>{k % 9} 0 1 0 0 0</pose></waypoint>"
        for k in range(200_000)
    ) + "</trajectory></script></actor>"),
)  # fmt: skip
_text("SDF: 30,000 actors", ".world", SDF.format("<actor name='a'/>" * 30_000))
_text("URDF: billion laughs", ".urdf", f"<!DOCTYPE a [{ENTITIES}]><robot name='&e9;'/>")
_text("map: an alias of an alias", ".yaml", "image: &a [*a, *a]\n" + MAP.format(image="a.png"))
_text("study: 1e11 seeds", ".toml", STUDY + "seeds = 100000000000\n")
_text(
    "study: 4 axes of 200",
    ".toml",
    STUDY
    + "seeds = 1\n[axes]\n"
    + "".join(f'"{axis}" = {[round(0.1 + 0.001 * k, 3) for k in range(200)]}\n' for axis in AXES),
)
_text("study: lists in one another", ".toml", STUDY + f"seeds = {'[' * 50_000}{']' * 50_000}\n")
_text("study: code", ".toml", STUDY + 'seeds = 1\n[set]\n"planner.name" = "hostile:Planner"\n')


@_maker("heights: a pickle")
def _pickle(folder: Path) -> list[str]:
    path = folder / "hostile.npy"
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(117) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00\x76\x00" + header + pickle.dumps([Path]))
    return _import(path, "--resolution", "0.1")


def _image(side: int) -> None:
    @_maker(f"map: PNG of {side} x {side}")
    def _map(folder: Path) -> list[str]:
        _white(folder / "map.png", side)
        (folder / "hostile.yaml").write_text(MAP.format(image="map.png"))
        return _import(folder / "hostile.yaml")

    @_maker(f"scene: texture of a PNG of {side} x {side}")
    def _texture(folder: Path) -> list[str]:
        _white(folder / "wide.png", side)
        head = "<asset><texture name='t' type='2d' file='wide.png'/></asset>"
        (folder / "hostile.xml").write_text(mjcf("", head))
        return _import(folder / "hostile.xml")

    @_maker(f"scene: height field of a PNG of {side} x {side}")
    def _field(folder: Path) -> list[str]:
        _white(folder / "high.png", side)
        head = "<asset><hfield name='h' file='high.png' size='1 1 1 1'/></asset>"
        (folder / "hostile.xml").write_text(mjcf("<geom type='hfield' hfield='h'/>", head))
        return _import(folder / "hostile.xml")


_image(13_000)
_image(16_384)


def _heightmap(name: str, ending: str, write: Callable[[Path], None]) -> None:
    @_maker(f"SDF: height map of a {name}")
    def make(folder: Path) -> list[str]:
        write(folder / f"high{ending}")
        shape = f"<heightmap><uri>high{ending}</uri><size>9 9 1</size></heightmap>"
        path = folder / "hostile.world"
        path.write_text(SDF.format(f"<model name='m'>{LINK.format(shape)}</model>"))
        return _import(path)


def _tiff(path: Path) -> None:
    """Write a TIFF of 8000 x 8000 real numbers, of which each strip is the same packed zeros."""
    side, rows = 8000, 80
    strip = zlib.compress(bytes(4 * side * rows), 9)
    count = side // rows
    entries = [
        (256, 4, 1, side), (257, 4, 1, side), (258, 3, 1, 32), (259, 3, 1, 8), (262, 3, 1, 1),
        (273, 4, count, 8 + len(strip)), (277, 3, 1, 1), (278, 4, 1, rows),
        (279, 4, count, 8 + len(strip) + 4 * count), (339, 3, 1, 3),
    ]  # fmt: skip
    body = strip + struct.pack("<I", 8) * count + struct.pack("<I", len(strip)) * count
    directory = struct.pack("<H", len(entries))
    directory += b"".join(struct.pack("<HHII", *entry) for entry in entries) + bytes(4)
    path.write_bytes(b"II*\0" + struct.pack("<I", 8 + len(body)) + body + directory)


_heightmap("PNG of 8000 x 8000", ".png", lambda path: _white(path, 8000))
_heightmap("DEM of 8000 x 8000", ".tif", _tiff)


@_maker("map: an image outside")
def _map_outside(folder: Path) -> list[str]:
    (folder / "hostile.yaml").write_text(MAP.format(image="../../../etc/passwd"))
    return _import(folder / "hostile.yaml")


@_maker("map: PGM of 16000 x 16000")
def _pgm(folder: Path) -> list[str]:
    (folder / "map.pgm").write_bytes(b"P5 16000 16000 255\n" + bytes(100))
    (folder / "hostile.yaml").write_text(MAP.format(image="map.pgm"))
    return _import(folder / "hostile.yaml")


def attached(folder: Path, sub: str, name: str = "sub.xml") -> Path:
    """Write a scene in its own folder that attaches another one; beside the folder lie secrets."""
    inner = folder / "scene"
    inner.mkdir(exist_ok=True)
    (folder / "secret.obj").write_text(BODY)
    (folder / "secret.xml").write_text("<mujoco><worldbody><body name='b'/></worldbody></mujoco>")
    (inner / "inside.obj").write_text(BODY)
    (inner / "sub.xml").write_text(sub)
    head = f"<asset><model name='sub' file='{name}'/></asset>"
    path = inner / "hostile.xml"
    path.write_text(mjcf("<frame><attach model='sub' body='b' prefix='s_'/></frame>", head))
    return path


def with_mesh(file: str) -> str:
    """Return a model of one body, whose mesh is a file."""
    return (
        f"<mujoco model='sub'><asset><mesh name='m' file='{file}'/></asset><worldbody>"
        "<body name='b'><geom type='mesh' mesh='m'/></body></worldbody></mujoco>"
    )


@_maker("scene: attached model with a mesh outside")
def _attached_mesh(folder: Path) -> list[str]:
    path = attached(folder, with_mesh(str(folder / "secret.obj")))
    return _import(path)


@_maker("scene: attached model that includes a file outside")
def _attached_include(folder: Path) -> list[str]:
    path = attached(folder, "<mujoco><include file='../secret.xml'/></mujoco>")
    return _import(path)


@_maker("scene: attached model outside")
def _attached_outside(folder: Path) -> list[str]:
    path = attached(folder, with_mesh("inside.obj"), "../secret.xml")
    return _import(path)


@_maker(f"scene: {DOUBLINGS} files that include the next one twice")
def _doubled_scene(folder: Path) -> list[str]:
    for k in range(DOUBLINGS):
        text = f"<include file='{k + 1}.xml'/>" * 2 if k + 1 < DOUBLINGS else BOX
        (folder / f"{k}.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    return _import(folder / "0.xml")


@_maker(f"SDF: {DOUBLINGS - 2} models that include the next one twice")
def _doubled_models(folder: Path) -> list[str]:
    for k in range(DOUBLINGS - 2):
        twice = f"<include><uri>model://{k + 1}.sdf</uri></include>" * 2
        (folder / f"{k}.sdf").write_text(MODEL.format(twice if k + 3 < DOUBLINGS else ""))
    return _import(folder / "0.sdf")


@_maker("robot: a model with nuser_geom 4e8")
def _robot(folder: Path) -> list[str]:
    spec = Path(custom.__file__).parent / "examples" / "spot.toml"
    lines = [
        'mjcf = "hostile.xml"' if line.startswith("mjcf") else line
        for line in spec.read_text().splitlines()
    ]
    (folder / "robot.toml").write_text("\n".join(lines))
    (folder / "hostile.xml").write_text(mjcf("", "<size nuser_geom='400000000'/>"))
    robot = str(folder / "robot.toml")
    return ["run", "empty", "--robot", robot, "--seed", "1", "--log", str(folder / "out.mcap")]


@_maker("world: an operating area of 1e6 m")
def _area(folder: Path) -> list[str]:
    (folder / "sound.xml").write_text(mjcf(""))
    (folder / "hostile.xml").write_text(mjcf("<geom size='1' pos='1000000 1000000 1'/>"))
    return _import(folder / "hostile.xml")
