"""Geoms between a camera and what it shows."""

import mujoco
import pytest

from wayproof.harness.viewer.sight import geoms_in_front

ROOM = """<mujoco><asset><material name="brick" rgba="1 0 0 1"/></asset><worldbody>
<geom name="target" type="sphere" size="0.2" pos="0 0 1"/>
<geom name="near" material="brick" type="box" size="0.1 3 3" pos="-2 0 1"/>
<geom name="post" type="box" size="0.1 0.1 3" pos="-3 0.5 1"/>
<geom name="behind" type="box" size="0.1 3 3" pos="2 0 1"/>
<geom name="far_aside" type="box" size="0.1 0.1 3" pos="-3 2 1"/>
<geom name="at_the_camera_s_back" type="box" size="0.1 3 3" pos="-8 0 1"/>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("azimuth", "elevation", "names"),
    [(0.0, 0.0, {"near", "post"}), (90.0, 0.0, set()), (180.0, 0.0, {"behind"}), (0.0, -90, set())],
)
def test_only_geoms_in_front_are_found(azimuth, elevation, names):
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = (0.0, 0.0, 1.0), 5.0
    camera.azimuth, camera.elevation = azimuth, elevation
    found = geoms_in_front(model, data, camera, 0.3)
    assert {model.geom(geom).name for geom in found} == names
    assert len(found) == len(names)
    assert (model.geom_rgba[found, 3] == 0.0).all()
