"""The true scene of a log."""

from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.scenario.scenario import build
from wayproof.harness.viewer.colours import GLASS, GROUND, OBSTACLES
from wayproof.harness.viewer.true_scene import true_scene
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
