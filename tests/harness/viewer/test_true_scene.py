"""The true scene of a log, and the triangles of its geoms: closed, seen from outside."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.scenario.scenario import build
from wayproof.harness.viewer.colours import GLASS, GROUND, OBSTACLES
from wayproof.harness.viewer.true_scene import triangles_of, true_scene
from wayproof.models.worlds import WORLDS


def scene_of(log, mjcf):
    return true_scene(replace(open_log(log), scene=mjcf))


def test_it_is_where_the_world_s_solids_are_and_has_no_robot(log):
    scene = true_scene(open_log(log))
    world = WORLDS["empty"](1, 0.5)
    assert set(scene.still) == {OBSTACLES}  # its floor is a plane
    points = scene.still[OBSTACLES].reshape(-1, 3)
    low = np.min([solid.low for solid in world.solids], axis=0)
    high = np.max([solid.high for solid in world.solids], axis=0)
    np.testing.assert_allclose(points.min(0), low, atol=1e-6)
    np.testing.assert_allclose(points.max(0), high, atol=1e-6)
    assert len(scene.still[OBSTACLES]) == 12 * len(world.solids)


def test_movers_are_in_their_own_frames(log):
    scene = scene_of(log, build(Config("ghosts", "drone", 1)).scene.mjcf)
    movers = WORLDS["ghosts"](1, 0.5).movers
    assert set(scene.movers) == {mover.name for mover in movers}
    for mover in movers:
        middle = scene.movers[mover.name].reshape(-1, 3).mean(0)
        assert np.linalg.norm(middle[:2]) < 1e-6


def test_glass_is_there_although_no_beam_meets_it_and_floors_are_apart(log):
    mjcf = """
    <mujoco><size nuser_geom="1"/><worldbody>
      <geom type="box" size="1 1 1" rgba="1 1 1 0" user="0"/>
      <geom type="box" size="9 9 0.1" pos="0 0 -1" user="1"/>
    </worldbody></mujoco>
    """
    scene = scene_of(log, mjcf)
    assert set(scene.still) == {GLASS, GROUND}
    assert np.abs(scene.still[GLASS]).max() == 1.0


def test_a_scene_that_does_not_compile_is_bad_input(log):
    with pytest.raises(InputError, match="its scene"):
        scene_of(log, '<mujoco><worldbody><geom type="box"/></worldbody></mujoco>')


MESH = 'vertex="0 0 0 1 0 0 0 1 0 0 0 1"'
SCENE = """
<mujoco>
  <asset>
    <mesh name="corner" {mesh}/>
    <hfield name="hill" nrow="2" ncol="3" size="3 2 1 0.1" elevation="0 0 0 0 1 0"/>
  </asset>
  <worldbody><geom name="it" {geom}/></worldbody>
</mujoco>
"""


def triangles(geom):
    model = mujoco.MjModel.from_xml_string(SCENE.format(mesh=MESH, geom=geom))
    return model, triangles_of(model, 0)


def volume(found):
    """Of a closed surface whose triangles are anticlockwise from outside, m^3."""
    return np.einsum("ni,ni->", found[:, 0], np.cross(found[:, 1], found[:, 2])) / 6.0


@pytest.mark.parametrize(
    ("geom", "expected", "low", "high"),
    [
        ('type="box" size="1 2 3"', 48.0, (-1, -2, -3), (1, 2, 3)),
        ('type="cylinder" size="1 2"', 4 * np.pi, (-1, -1, -2), (1, 1, 2)),
        ('type="sphere" size="2"', 32 / 3 * np.pi, (-2, -2, -2), (2, 2, 2)),
        ('type="ellipsoid" size="1 2 3"', 8 * np.pi, (-1, -2, -3), (1, 2, 3)),
        ('type="capsule" size="1 2"', (4 + 4 / 3) * np.pi, (-1, -1, -3), (1, 1, 3)),
    ],
)
def test_shapes_are_closed_and_their_normals_point_outwards(geom, expected, low, high):
    _, found = triangles(geom)
    assert 0.94 * expected < volume(found) <= 1.0001 * expected  # inscribed
    np.testing.assert_allclose(found.reshape(-1, 3).min(0), low, atol=1e-9)
    np.testing.assert_allclose(found.reshape(-1, 3).max(0), high, atol=1e-9)
    edges = {tuple(np.round([*one, *other], 9)) for tri in found for one, other in pairs(tri)}
    assert all((*edge[3:], *edge[:3]) in edges for edge in edges)  # each has a neighbour


def pairs(triangle):
    return zip(triangle, np.roll(triangle, -1, axis=0), strict=True)


def test_a_mesh_has_its_own_faces():
    model, found = triangles('type="mesh" mesh="corner"')
    assert len(found) == model.mesh_facenum[0] == 4
    assert volume(found) == pytest.approx(1 / 6)


def test_a_height_field_has_its_heights_where_rays_meet_them():
    _, found = triangles('type="hfield" hfield="hill"')
    assert len(found) == 4
    points = {tuple(point) for point in found.reshape(-1, 3).tolist()}
    assert points == {(x, y, float((x, y) == (0, -2))) for x in (-3, 0, 3) for y in (-2, 2)}
    assert (np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])[:, 2] > 0).all()
