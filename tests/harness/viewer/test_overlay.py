"""What is drawn over a scene."""

import mujoco
import numpy as np
import pytest

from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.caption import ROBOT
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.overlay import BELIEVED, FLOOR, TRUE, Overlay, Tracks, lay_over
from wayproof.maps import FREE, UNKNOWN

APART = 0.4
"""Least distance of two colours that differ at a glance, of shares of red, green and blue."""


@pytest.fixture
def scene():
    return mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), maxgeom=20_000)


def drawn(scene):
    """Colour and extent of each geom."""
    geoms = scene.geoms[: scene.ngeom]
    return [
        (tuple(np.round(geom.rgba.astype(float), 2).tolist()), geom.pos.copy()) for geom in geoms
    ]


def test_unknown_is_far_from_free_and_the_robot_from_all():
    shades = [np.array(colour[:3]) for colour in (*FLOOR.values(), TRUE, BELIEVED)]
    assert np.linalg.norm(np.array(FLOOR[UNKNOWN][:3]) - FLOOR[FREE][:3]) > 2 * APART
    assert min(np.linalg.norm(shade - ROBOT[:3]) for shade in shades) > APART


def test_the_outside_of_the_map_is_unknown_and_both_tracks_are_there(log, scene):
    opened = open_log(log)
    true, believed = [], []
    for moment in moments(opened):
        true.append(np.array(moment.truth.position))
        believed.append(np.array(moment.record.inputs.pose.position))
        if moment.decision.sequence == 5:
            break
    lay_over(scene, moment, opened.mission, tracks=Tracks(true, believed), cut_at=1.0)
    by_colour = {}
    for colour, place in drawn(scene):
        by_colour.setdefault(colour, []).append(place)
    unknown = np.array(by_colour[FLOOR[UNKNOWN]])
    low, high = np.array(opened.mission.low[:2]), np.array(opened.mission.high[:2])
    assert (unknown[:, :2] < low).any()
    assert (unknown[:, :2] > high).any()
    free = np.array(by_colour[FLOOR[FREE]])
    assert (free[:, :2] > low - 0.2).all()
    assert (free[:, :2] < high + 0.2).all()
    assert len(by_colour[TRUE]) == 5
    assert len(by_colour[BELIEVED]) == 5 + 24  # and the circle of the body


def test_a_full_scene_takes_no_more():
    scene = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), maxgeom=3)
    Overlay(scene).add_line(np.zeros((9, 3)) + np.arange(9)[:, None], 0.1, TRUE)
    assert scene.ngeom == 3
