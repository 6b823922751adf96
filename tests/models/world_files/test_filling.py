"""Insides of meshes that are taken as cells: solid where the surface is closed around them."""

import numpy as np
import pytest

from wayproof.models.world_files.meshes import (
    cell_parts,
    is_closed,
    mesh_parts,
    winding_number,
)
from wayproof.models.world_files.parts import Mesh

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
    for mesh, point, times in (
        (Mesh(CORNERS, FACES), inside, 1), (Mesh(CORNERS, FACES), outside, 0),
        (Mesh(CORNERS, FACES[:, ::-1]), inside, -1), (shell(), inside, 0),
        (shell(), np.array([0.01, 0.9, 0.4]), 1),
    ):  # fmt: skip
        assert winding_number(mesh, point) == pytest.approx(times, abs=1e-9)


def test_closed_surfaces_are_told_from_open_ones():
    assert is_closed(FACES)
    assert is_closed(FACES[:, ::-1])
    assert not is_closed(FACES[1:])
    assert not is_closed(np.vstack([FACES[1:], FACES[0, ::-1]]))  # one triangle is turned
    assert not is_closed(np.vstack([FACES, FACES]))


def test_a_closed_mesh_is_solid_and_a_room_in_it_is_not():
    mesh, outer = Mesh(CORNERS, FACES), 1.05**3  # its far faces lie in a layer of their own
    assert volume(cell_parts("m", mesh, CELL)) == pytest.approx(outer)
    assert volume(cell_parts("m", shell(), CELL)) == pytest.approx(outer - 0.55**3)


@pytest.mark.parametrize("faces", [FACES[:, ::-1], FACES[1:]])
def test_what_is_open_or_faces_inwards_stays_hollow(faces):
    assert volume(cell_parts("m", Mesh(CORNERS, faces), CELL)) < 1.05**3 - 0.9**3


def test_what_is_drawn_from_both_sides_stays_hollow(tmp_path):
    """A finely cut cube with a notch, so that it is neither convex nor cut."""
    trimesh = pytest.importorskip("trimesh")
    cube = trimesh.creation.box((2.0, 2.0, 2.0)).subdivide_to_size(0.1)
    vertices = cube.vertices.copy()
    vertices[(vertices[:, 2] > 0.99) & (np.abs(vertices[:, :2]).max(axis=1) < 0.5), 2] = 0.0
    for faces, filled in (
        (cube.faces, True),
        (np.vstack([cube.faces, cube.faces[:, ::-1]]), False),
    ):
        trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "m.stl")
        parts = mesh_parts(tmp_path / "m.stl", np.ones(3), [])
        at_middle = [
            part
            for part in parts
            if (np.abs(np.array([0.8, 0.8, -0.5]) - part.position) < part.size).all()
        ]
        assert bool(at_middle) == filled
