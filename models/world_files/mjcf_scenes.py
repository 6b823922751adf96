"""MuJoCo scenes (`.xml`, `.mjcf`): every solid geom at its starting pose, made static.

Includes, attached models and assets are those in the scene's folder or below; what would load code
or demand more memory than a scene needs is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.hulls import distance_to_hull, hull
from wayproof.models.world_files.mjcf_files import check_scene
from wayproof.models.world_files.movers import bodies_of, check_movers, mover_of
from wayproof.models.world_files.options import Found, ImportOptions, Plane
from wayproof.models.world_files.parts import Mesh, Part, Quaternion, Shape, quaternion_of, vector
from wayproof.models.world_files.reading import MAX_SOLIDS, WorldFileError
from wayproof.models.world_files.xml_tree import Element
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.solids import FRICTION

CUSTOM_PREFIX = "wayproof_"
"""Prefix of the names in `<custom>` that hold the mission of a world file."""

MOVER_PREFIX = "mover_"
"""Prefix after it of the texts with the movers' routes."""

Geoms = mujoco.mjtGeom

SHAPES: dict[int, tuple[Shape, int]] = {
    int(Geoms.mjGEOM_BOX): ("box", 3),
    int(Geoms.mjGEOM_CYLINDER): ("cylinder", 2),
    int(Geoms.mjGEOM_CAPSULE): ("capsule", 2),
    int(Geoms.mjGEOM_SPHERE): ("sphere", 1),
    int(Geoms.mjGEOM_ELLIPSOID): ("ellipsoid", 3),
}
"""Shape and number of lengths of each geom type."""

DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""Colour of a geom that is given none: that of its material counts."""

NOT_COMPILED = (ValueError, RuntimeError, MemoryError, mujoco.FatalError)
"""Exceptions that MuJoCo raises for a scene that does not compile."""


def read_mjcf(path: Path, options: ImportOptions) -> Found:
    """Read every solid geom of a scene.

    Raises:
        WorldFileError: No MJCF; a file outside the folder; a plugin; a count above its bound; a
            plane that is not the floor.
    """
    check_scene(path, options.root)
    try:
        if options.without:
            model = _compile_without(path, options.without)
        else:
            model = mujoco.MjModel.from_xml_path(str(path))
    except NOT_COMPILED as error:
        raise WorldFileError(path, _reason(error)) from None
    found = found_in(model, path)
    found.notes += _changed(model)
    _take_hulls(found)
    found.notes += [f"body '{name}': left out" for name in options.without]
    return found


def _reason(error: Exception) -> str:
    """Return why a scene does not compile, in one line; for a missing file, with the remedy."""
    text = " ".join(str(error).split())
    if missing := re.search(r"[Ee]rror opening file '([^']*)'", text):
        name = Path(missing[1]).name
        return f"no file '{name}', which it names; expected it, or --without BODY that needs it"
    return text[:300]


def _take_hulls(found: Found) -> None:
    """Replace meshes by their convex hull, as MuJoCo does for contacts; note those that differ."""
    errors: list[float] = []
    hulls: dict[bytes, tuple[Mesh, float] | None] = {}
    for n, part in enumerate(found.parts):
        if part.mesh is None:
            continue
        key = part.mesh.vertices.tobytes() + part.mesh.faces.tobytes()
        if key not in hulls:
            around = hull(part.mesh.vertices)
            hulls[key] = None
            if around is not None:
                hulls[key] = around, distance_to_hull(part.mesh, around)
        if (chosen := hulls[key]) is not None:
            found.parts[n] = replace(part, mesh=chosen[0])
            errors += [chosen[1]] if chosen[1] else []
    if errors:
        found.notes.append(f"{len(errors)} meshes that are not convex: their convex hull, as "
                           f"MuJoCo's contacts take them, within {max(errors):.3f} m")  # fmt: skip


def _compile_without(path: Path, bodies: tuple[str, ...]) -> mujoco.MjModel:
    """Compile a scene without some bodies and all that is on them.

    Raises:
        WorldFileError: No such body.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    for name in bodies:
        body = spec.body(name)
        if body is None:
            names = ", ".join(one.name for one in spec.worldbody.bodies if one.name)
            raise WorldFileError(path, f"--without: no body '{name}' (available: {names[:200]})")
        spec.delete(body)
    for key in list(spec.keys):
        spec.delete(key)  # it counts the joints that were deleted
    needed = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if (mesh.name or Path(mesh.file).stem) not in needed:
            spec.delete(mesh)  # its file need not be there
    return spec.compile()


def is_world_file(tree: Element) -> bool:
    """Return whether a scene holds a mission, as `wayproof import` writes it."""
    custom = [child for part in tree.all("custom") for child in part.all("text")]
    return any(child.attributes.get("name") == f"{CUSTOM_PREFIX}format" for child in custom)


def found_in(model: mujoco.MjModel, path: Path | str, robot: int | None = None) -> Found:
    """Return the parts of a compiled scene, and the contents of its `<custom>`.

    Geoms that meet no contact are left out, unless none does.

    Args:
        model: The scene.
        path: For what is said if a geom cannot be taken over.
        robot: Body of a robot in it, which is no part of the world.

    Raises:
        WorldFileError: A geom that cannot be taken over.
    """
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    solid = _solid(model)
    if robot is not None:
        solid &= model.body_rootid[model.geom_bodyid] != model.body_rootid[robot]
    if solid.sum() > MAX_SOLIDS:
        raise WorldFileError(path, f"{solid.sum()} geoms, expected at most {MAX_SOLIDS}")
    found, texts = Found(), _texts(model)
    try:
        found.movers, moving = _movers(model, texts)
    except WorldFileError:
        raise
    except ValueError as error:
        raise WorldFileError(path, str(error)) from None
    found.notes += _left_out(model, solid, model.nmocap - len(found.movers))
    for geom in np.flatnonzero(solid & ~moving).tolist():
        if model.geom_type[geom] == Geoms.mjGEOM_PLANE:
            found.planes.append(_plane(model, data, geom))
        else:
            found.parts.append(_part(path, model, data, geom))
    _take_custom(model, texts, found)
    return found


def movers_in(model: mujoco.MjModel) -> tuple[Mover, ...]:
    """Return the movers of a scene whose world is a world file's.

    Raises:
        ValueError: One without a body, or that cannot be read; too many.
    """
    return tuple(_movers(model, _texts(model))[0])


def _movers(model: mujoco.MjModel, texts: dict[str, str]) -> tuple[list[Mover], NDArray[np.bool_]]:
    """Return the movers of a world file, and (geoms,) which geoms are theirs."""
    prefix = CUSTOM_PREFIX + MOVER_PREFIX
    named = {name.removeprefix(prefix): text for name, text in texts.items()
             if name.startswith(prefix)}  # fmt: skip
    movers, moving = [], np.zeros(model.ngeom, np.bool_)
    for body, name in bodies_of(model, list(named)).items():
        geoms = np.flatnonzero(model.geom_bodyid == body)
        moving[geoms] = True
        parts = [_part_at(name, model, int(geom), vector(model.geom_pos[geom]),
                          _turn(model.geom_quat[geom])) for geom in geoms]  # fmt: skip
        movers.append(mover_of(name, named[name], parts))
    check_movers(movers)
    return movers, moving


def _left_out(model: mujoco.MjModel, solid: NDArray[np.bool_], moved: int) -> Iterator[str]:
    for count, what in (
        (int((~solid).sum()), "geoms that nothing collides with: left out"),
        (model.njnt, "joints: everything stands still here"),
        (model.nu, "actuators: left out"),
        (model.neq, "equalities: left out"),
        (model.nflex, "flexes: left out"),
        (moved, "bodies that are moved from outside: they stand still here"),
    ):
        if count:
            yield f"{count} {what}"


def _changed(model: mujoco.MjModel) -> Iterator[str]:
    """Yield a line for each property of solid geoms that a world file holds otherwise."""
    solid = _solid(model)
    alpha = model.geom_rgba[:, 3].copy()
    with_material = (model.geom_matid >= 0) & (model.geom_rgba == DEFAULT_RGBA).all(axis=1)
    alpha[with_material] = model.mat_rgba[model.geom_matid[with_material], 3]
    slides = model.geom_friction[:, 0]
    for chosen, what in (
        (alpha == 0.0, "geoms of alpha 0: beams meet them here"),
        ((alpha > 0.0) & (alpha < 1.0), "transparent geoms: drawn opaque here"),
        (np.abs(slides - FRICTION) > 1e-9, f"geoms of another friction: {FRICTION:g} here"),
        (model.geom_group != 0, "geoms of other groups: of group 0 here"),
    ):
        geoms = np.flatnonzero(chosen & solid)
        if len(geoms):
            names = ", ".join(dict.fromkeys(n for g in geoms.tolist() if (n := _name(model, g))))
            yield f"{len(geoms)} {what}" + (f" ({names[:100]})" if names else "")


def _solid(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return the geoms that meet any contact; all of them where none does."""
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    return solid if solid.any() else np.ones_like(solid)


def _plane(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Plane:
    x, y = model.geom_size[geom, :2].tolist()
    half = (x, y) if x > 0.0 and y > 0.0 else None
    normal = data.geom_xmat[geom].reshape(3, 3)[:, 2].copy()
    return Plane(data.geom_xpos[geom].copy(), normal, half, _name(model, geom))


def _part(path: Path | str, model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Part:
    turn = quaternion_of(data.geom_xmat[geom].reshape(3, 3))
    if model.geom_bodyid[geom] == 0:
        turn = _turn(model.geom_quat[geom])  # the same bits as written
    return _part_at(path, model, geom, vector(data.geom_xpos[geom]), turn)


def _turn(quaternion: NDArray[np.float64]) -> Quaternion:
    w, x, y, z = quaternion.tolist()
    return w, x, y, z


def _part_at(
    path: Path | str, model: mujoco.MjModel, geom: int, position: Vector3, turn: Quaternion
) -> Part:
    """Return a geom as a part at a pose.

    Raises:
        WorldFileError: Its type cannot be taken over.
    """
    kind = int(model.geom_type[geom])
    word = re.sub(r"_\d+$", "", _name(model, geom))
    word = re.sub("[^a-z_]", "_", word.lower()) or "structure"
    if kind in SHAPES:
        shape, lengths = SHAPES[kind]
        size = tuple(model.geom_size[geom, :lengths].tolist())
        return Part(shape, size, position, turn, word)
    if kind == Geoms.mjGEOM_MESH:
        return Part("mesh", (), position, turn, word, mesh=_mesh(model, geom))
    if kind == Geoms.mjGEOM_HFIELD:
        field = model.geom_dataid[geom]
        return Part(
            "heights", tuple(model.hfield_size[field].tolist()), position, turn, word,
            heights=_heights(model, field),
        )  # fmt: skip
    what = f"geom '{_name(model, geom)}' of type {Geoms(kind).name}: cannot be taken over"
    raise WorldFileError(path, what)


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Return the geom's name, or that of its body; empty if neither has one."""
    body = model.geom_bodyid[geom]
    return str(model.geom(geom).name or (model.body(body).name if body else ""))


def _mesh(model: mujoco.MjModel, geom: int) -> Mesh:
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    begin, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return Mesh(
        model.mesh_vert[first : first + count].astype(np.float64),
        model.mesh_face[begin : begin + number].astype(np.int64),
    )


def _heights(model: mujoco.MjModel, field: int) -> NDArray[np.float64]:  # (ny, nx)
    rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
    first = model.hfield_adr[field]
    levels = model.hfield_data[first : first + rows * columns]
    return np.asarray(levels.reshape(rows, columns), np.float64)


def _texts(model: mujoco.MjModel) -> dict[str, str]:
    """Return the texts of `<custom>` by name."""
    texts = {}
    for n in range(model.ntext):
        first, size = model.text_adr[n], model.text_size[n]
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, n)
        texts[name] = bytes(model.text_data[first : first + size - 1]).decode()
    return texts


def _take_custom(model: mujoco.MjModel, texts: dict[str, str], found: Found) -> None:
    numbers = {}
    for n in range(model.nnumeric):
        one = model.numeric(n)
        numbers[one.name.removeprefix(CUSTOM_PREFIX)] = one.data.tolist()
    for name in ("goal", "low", "high"):
        if len(numbers.get(name, ())) == 3:
            setattr(found, name, vector(numbers[name]))
    if len(start := numbers.get("start", ())) == 4:
        found.start, found.start_heading = vector(start[:3]), start[3]
    found.route_length = numbers.get("route_length", [0.0])[0] or None
    found.format = texts.get(f"{CUSTOM_PREFIX}format", "")
    found.source = texts.get(f"{CUSTOM_PREFIX}source", "")
