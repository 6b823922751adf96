"""Triangles of mesh files: STL, OBJ and glTF by trimesh, COLLADA by pycollada, PLY."""

from __future__ import annotations

import io
import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.ply import read_ply
from wayproof.models.world_files.reading import WorldFileError, check_file, read_text
from wayproof.models.world_files.xml_tree import parse_xml

MOST_FACES = 1_000_000
MOST_BYTES = 64 * 2**20
MAX_NODES = 20_000
"""Maximum number of placed surfaces in a COLLADA or glTF scene: nodes can repeat each other."""

MAX_NESTED_NODES = 60

MAX_NUMBERS = 2**26
"""Maximum number of numbers that the accessors of a glTF hold: they can overlap, or be of zeros."""

COMPONENTS = {
    "SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16,
}  # fmt: skip
"""Numbers of an element of a glTF accessor, by its type."""

TRIANGLES, FAN = (4, 5, 6), 6
"""Modes of a glTF primitive with a surface, and that of a fan."""

DECLARATION = re.compile(r"^\s*<\?xml[^>]*\?>")

SHAPELESS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "EXT_lights_", "KHR_xmp",
    "MSFT_texture_", "KHR_animation_",
)  # fmt: skip
"""Beginnings of the names of glTF extensions that no shape depends on."""

COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing")
"""glTF extensions without which the shapes are others."""

DRAWN_ONLY = ("image", "texture", "effect", "material", "light", "camera", "surface", "sampler")
"""Words in pycollada's errors about what no shape depends on."""

EXTRA = "pip install '.[imports]' in Wayproof's folder"


class Surface(NamedTuple):
    """Triangles of one node of a mesh file.

    Attributes:
        name: Name of the node, as a `<submesh>` names it.
        vertices: (n, 3) m, in the file's axes.
        faces: (m, 3) vertices of each triangle.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


class MeshFile(NamedTuple):
    """Content of a mesh file.

    Attributes:
        surfaces: Surfaces in the order of the file.
        up: Axis of the file that points up: x, y or z.
        notes: Notes on what was left out or taken otherwise than written.
    """

    surfaces: list[Surface]
    up: str = "z"
    notes: tuple[str, ...] = ()


def load_mesh_file(path: Path) -> MeshFile:
    """Read the triangles of a file, in metres.

    Raises:
        WorldFileError: Another format, a broken file, more than is allowed, or no library for it.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(READERS)
        raise WorldFileError(path, f"mesh format '{path.suffix}' (available: {known})")
    check_file(path, MOST_BYTES)
    loaded = _parsed(path, reader)
    return loaded._replace(surfaces=[_checked(path, surface) for surface in loaded.surfaces])


def cloud_points(path: Path) -> NDArray[np.float64] | None:
    """Return the points (n, 3) of a PLY without faces, in its units; None if it has faces.

    Raises:
        WorldFileError: A broken file.
    """
    check_file(path, MOST_BYTES)
    read = _parsed(path, read_ply)
    return None if read.polygons or read.strips else read.vertices


Parsed = TypeVar("Parsed")


def _parsed(path: Path, reader: Callable[[Path], Parsed]) -> Parsed:
    """Call a library's parser; raise its failure as one line."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused by name
            return reader(path)
    except WorldFileError:
        raise
    except ImportError as error:
        raise WorldFileError(path, f"needs {error.name}: {EXTRA}") from None
    except Exception as error:  # whatever it raises on a broken file
        text = " ".join(str(error).split()) or type(error).__name__
        raise WorldFileError(path, f"no mesh ({text[:100]})") from None


def _checked(path: Path, surface: Surface) -> Surface:
    _, vertices, faces = surface
    if len(faces) > MOST_FACES:
        raise WorldFileError(path, f"{len(faces)} triangles, expected 1 to {MOST_FACES}")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise WorldFileError(path, "a triangle of a vertex that is not there")
    if not np.isfinite(vertices).all():
        raise WorldFileError(path, "a vertex that is not finite")
    return surface


def _plain(path: Path) -> MeshFile:
    """Read STL or OBJ: one surface."""
    import trimesh

    data, kind = path.read_bytes(), path.suffix[1:].lower()
    if kind == "obj" and (count := data.count(b"\nf") + data.count(b"\nv ")) > 2 * MOST_FACES:
        what = f"{count} triangles and vertices, expected at most {2 * MOST_FACES}"
        raise WorldFileError(path, what)
    # Not by its name: so it looks for no materials.
    mesh: Any = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False)
    return MeshFile([_surface(path.stem, mesh.vertices, mesh.faces)])


def _ply(path: Path) -> MeshFile:
    """Read PLY: one surface of its polygons and strips."""
    read = read_ply(path)
    return MeshFile([_surface(path.stem, read.vertices, read.triangles)])


def _surface(name: str, vertices: Any, faces: Any) -> Surface:
    placed = np.array(vertices, np.float64).reshape(-1, 3)
    return Surface(name, placed, np.array(faces, np.int64).reshape(-1, 3))


def _collada(path: Path) -> MeshFile:
    """Read COLLADA: every geometry where the scene's nodes place it, in metres."""
    text = read_text(path, MOST_BYTES)  # UTF-8 alone: another parser could see other elements
    parse_xml(path, text)
    import collada

    data = DECLARATION.sub("", text, count=1).encode()
    file = collada.Collada(io.BytesIO(data), ignore=[collada.common.DaeError])
    unit, scene = float(file.assetInfo.unitmeter or 1.0), collada.scene
    surfaces: list[Surface] = []
    notes: Counter[str] = Counter()
    roots = file.scene.nodes if file.scene is not None else []
    waiting = [(node, "", np.diag([unit, unit, unit, 1.0]), 0) for node in reversed(roots)]
    visited = 0
    while waiting:
        node, name, T, depth = waiting.pop()
        visited += 1
        if depth > 2 * MAX_NESTED_NODES or max(visited, len(surfaces)) > MAX_NODES:
            raise WorldFileError(path, f"more than {MAX_NODES} nodes, or {MAX_NESTED_NODES} deep")
        if isinstance(node, (scene.GeometryNode, scene.ControllerNode)):
            geometry, bind = _bound(getattr(node, "controller", None) or node.geometry)
            own = name or str(geometry.name or geometry.id)
            surfaces += _geometry(path, own, geometry, T @ bind, notes)
            notes["skinned meshes taken in their bind pose"] += not hasattr(node, "geometry")
        elif isinstance(node, scene.NodeNode):
            waiting.append((node.node, name, T, depth + 1))
        elif isinstance(node, scene.Node):
            T, name = T @ np.asarray(node.matrix, np.float64), node.xmlnode.get("name") or ""
            waiting += [(child, name, T, depth + 1) for child in reversed(node.children)]
    for error in file.errors:
        if not any(word in str(error).lower() for word in DRAWN_ONLY):
            notes[f"faulty parts left out ({' '.join(str(error).split())[:100]})"] += 1
    up = str(file.assetInfo.upaxis or "Y_UP")[0].lower()
    return MeshFile(surfaces, up, _counted(notes))


def _bound(controller: Any) -> tuple[Any, NDArray[np.float64]]:
    """Return the geometry of a COLLADA skin or morph, and its bind shape matrix (4, 4)."""
    bind = np.eye(4)
    while not hasattr(controller, "primitives"):
        if hasattr(controller, "bind_shape_matrix"):
            bind = bind @ np.asarray(controller.bind_shape_matrix, np.float64).reshape(4, 4)
            controller = controller.geometry
        else:
            controller = controller.source_geometry
    return controller, bind


def _geometry(
    path: Path, name: str, geometry: Any, T: NDArray[np.float64], notes: Counter[str]
) -> Iterator[Surface]:
    """Yield the surfaces of a COLLADA geometry at T_world_geometry."""
    import collada

    for primitive in geometry.primitives:
        if isinstance(primitive, (collada.polylist.Polylist, collada.polygons.Polygons)):
            corners = int(np.asarray(primitive.vcounts, np.int64).sum())
            if corners > len(primitive.index):  # it would make arrays of that length
                what = f"polygons of {corners} corners, but {len(primitive.index)} are there"
                raise WorldFileError(path, what)
            primitive = primitive.triangleset()
        if not isinstance(primitive, collada.triangleset.TriangleSet):
            notes["lists of lines left out"] += 1
        elif len(primitive):
            placed = np.asarray(primitive.vertex, np.float64).reshape(-1, 3) @ T[:3, :3].T
            yield _surface(name, placed + T[:3, 3], primitive.vertex_index)


def _counted(notes: Counter[str]) -> tuple[str, ...]:
    return tuple(f"{count} {what}" for what, count in notes.items() if count)


def _gltf(path: Path) -> MeshFile:
    """Read glTF 2.0 or GLB: every mesh where the scene's nodes place it."""
    import trimesh
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        """Buffers in the file's own folder only."""

        def get(self, name: str) -> bytes:
            file = (path.parent / name).resolve()
            if not file.is_relative_to(path.parent.resolve()):
                raise WorldFileError(path, f"'{name}' lies outside the file's folder")
            check_file(file, MOST_BYTES)
            return file.read_bytes()

    notes = _check_gltf(path)
    with path.open("rb") as opened:
        scene = trimesh.load_scene(
            opened, file_type=path.suffix[1:].lower(), resolver=Beside(str(path)),
            process=False, skip_materials=True,
        )  # fmt: skip
    names = list(scene.graph.nodes_geometry)
    if len(names) > MAX_NODES:
        raise WorldFileError(path, f"{len(names)} nodes, expected at most {MAX_NODES}")
    surfaces = []
    for name in names:
        T, geometry = scene.graph[name]
        mesh = scene.geometry[geometry]
        if hasattr(mesh, "faces"):
            placed = np.asarray(mesh.vertices) @ T[:3, :3].T + T[:3, 3]
            surfaces.append(Surface(str(name), placed, np.array(mesh.faces, np.int64)))
    return MeshFile(surfaces, "y", notes)


def _check_gltf(path: Path) -> tuple[str, ...]:
    """Refuse what is not read, a node hierarchy that is no tree, and more than is allowed.

    Source: the glTF 2.0 specification, sections 3.5.1 (strict trees) and 4 (GLB).

    Returns:
        Notes on what is taken otherwise than written.

    Raises:
        WorldFileError: Naming the extension, the count, the node, or a primitive without data.
    """
    data = path.read_bytes()
    if data[:4] == b"glTF":
        length = int.from_bytes(data[12:16], "little")
        if length > len(data) - 20:
            raise WorldFileError(path, f"a chunk of {length} bytes in a file of {len(data)}")
        data = data[20 : 20 + length]
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise WorldFileError(path, f"no JSON ({' '.join(str(error).split())[:100]})") from None
    nodes, meshes, accessors = (content.get(key, []) for key in ("nodes", "meshes", "accessors"))
    required = [one for one in content.get("extensionsRequired", []) if not _is_shapeless(one)]
    if unread := required + [one for one in content.get("extensionsUsed", []) if one in COMPRESSED]:
        raise WorldFileError(
            path, f"glTF extension {unread[0][:60]}: not read; expected it exported without "
            "compression or instancing"
        )  # fmt: skip
    placed = sum(len(meshes[one["mesh"]].get("primitives", [])) for one in nodes if "mesh" in one)
    if len(nodes) > MAX_NODES or placed > MAX_NODES:
        what = f"{len(nodes)} nodes with {placed} primitives, expected at most {MAX_NODES} of each"
        raise WorldFileError(path, what)
    numbers = sum(one["count"] * COMPONENTS[one["type"]] for one in accessors)
    if numbers > MAX_NUMBERS:
        raise WorldFileError(path, f"{numbers} numbers, expected at most {MAX_NUMBERS}")
    _check_tree(path, [list(node.get("children", [])) for node in nodes])
    counts: Counter[str] = Counter()
    for primitive in (one for mesh in meshes for one in mesh["primitives"]):
        place, mode = primitive["attributes"].get("POSITION"), primitive.get("mode", 4)
        if mode not in TRIANGLES:
            counts["primitives of points or lines left out"] += 1
        elif place is None or not {"bufferView", "sparse"} & set(accessors[place]):
            raise WorldFileError(path, "a primitive without data of its POSITION")
        elif mode == FAN:
            raise WorldFileError(path, "a primitive of mode TRIANGLE_FAN: not read")
    skins = sum("skin" in node and "mesh" in node for node in nodes)
    counts["skinned meshes taken unbent, where their nodes are"] = skins
    return _counted(counts)


def _check_tree(path: Path, children: list[list[int]]) -> None:
    parents = Counter(itertools.chain.from_iterable(children))
    twice = next((node for node, count in parents.items() if count > 1), None)
    if twice is not None:
        raise WorldFileError(path, f"node {twice} has two parents, expected a tree")
    level, seen = [node for node in range(len(children)) if not parents[node]], 0
    for _ in range(MAX_NESTED_NODES + 1):
        seen, level = seen + len(level), [child for node in level for child in children[node]]
    if level:
        raise WorldFileError(path, f"nodes more than {MAX_NESTED_NODES} deep")
    if seen < len(children):
        raise WorldFileError(path, "nodes in a circle, expected a tree")


def _is_shapeless(extension: object) -> bool:
    return isinstance(extension, str) and extension.startswith(SHAPELESS)


READERS: dict[str, Callable[[Path], MeshFile]] = {
    ".stl": _plain,
    ".obj": _plain,
    ".ply": _ply,
    ".dae": _collada,
    ".gltf": _gltf,
    ".glb": _gltf,
}
"""Readers by the ending of a mesh file's name."""
