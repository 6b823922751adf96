"""Cutaway views: only geometry above the robot is cut."""

import mujoco
import numpy as np

from wayproof.harness.viewer.cutaway import cut_boxes, cut_scene

ROOM = """
<mujoco><worldbody>
  <geom name='wall' type='box' size='1 .1 1.5' pos='0 2 1.5'/>
  <geom name='low' type='box' size='.3 .3 .2' pos='2 0 .2'/>
  <geom name='beam' type='box' size='1 .1 .1' pos='0 -2 2.5'/>
  <geom name='pipe' type='cylinder' size='.1 1' pos='-2 0 1' euler='90 0 0'/>
  <geom name='mast' type='box' size='.1 .1 1' pos='0 0 1'/>
</worldbody></mujoco>
"""


def drawn(height, kept=()):
    """Place, size and opacity of each geom by name, as a renderer would draw it."""
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene(model, maxgeom=100)
    everything = mujoco.mjtCatBit.mjCAT_ALL.value
    camera, options = mujoco.MjvCamera(), mujoco.MjvOption()
    mujoco.mjv_updateScene(model, data, options, None, camera, everything, scene)
    cut_scene(scene, height, frozenset(model.geom(name).id for name in kept))
    geoms = [geom for geom in scene.geoms[: scene.ngeom] if geom.objid >= 0]
    return {
        model.geom(geom.objid).name: (geom.pos[2], geom.size[2], geom.rgba[3]) for geom in geoms
    }


def test_a_scene_is_cut_at_a_height():
    geoms = drawn(1.0, kept=("mast",))
    np.testing.assert_allclose(geoms["wall"], (0.5, 0.5, 1.0), atol=1e-6)  # 0 to 3 m, now to 1 m
    np.testing.assert_allclose(geoms["low"], (0.2, 0.2, 1.0), atol=1e-6)
    assert geoms["beam"][2] == 0.0
    np.testing.assert_allclose(geoms["pipe"], (1.0, 1.0, 1.0), atol=1e-6)  # it lies
    np.testing.assert_allclose(geoms["mast"], (1.0, 1.0, 1.0), atol=1e-6)  # the robot's


def test_boxes_end_at_a_height_or_are_left_out():
    middles = np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 1.5], [2.0, 0.0, 3.0]])
    halves = np.array([[0.1, 0.1, 0.5], [0.1, 0.1, 1.5], [0.1, 0.1, 0.5]])
    before = middles.copy(), halves.copy()
    left, sizes = cut_boxes(middles, halves, 2.0)
    np.testing.assert_allclose(left, [[0.0, 0.0, 0.5], [1.0, 0.0, 1.0]])
    np.testing.assert_allclose(sizes[:, 2], [0.5, 1.0])
    assert (middles == before[0]).all()
    assert (halves == before[1]).all()
