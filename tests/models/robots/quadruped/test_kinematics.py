"""The compiled body against the published figures, and kinematics against MuJoCo's own."""

import math

import mujoco
import numpy as np
import pytest

from wayproof.models.robots.kernel_data import packed
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.quadruped.body import OBSERVATION, record, wire
from wayproof.models.robots.quadruped.legs import foot_position, observe
from wayproof.models.robots.quadruped.parameters import (
    JOINTS,
    LEGS,
    Actuators,
    Geometry,
    Parameters,
    standing_joints,
)

QUADRUPED = Quadruped()
GEOMETRY = Geometry()


@pytest.fixture(scope="module")
def model():
    """A world with another free body before the robot, so that no address starts at zero."""
    world = mujoco.MjSpec()
    other = world.worldbody.add_body(name="other", pos=[5.0, 0.0, 1.0])
    other.add_freejoint()
    other.add_geom(size=[0.1, 0.1, 0.1])
    robot = mujoco.MjSpec.from_string(QUADRUPED.mjcf())
    world.attach(robot, prefix="robot_", frame=world.worldbody.add_frame())
    return world.compile()


def random_state(model, seed):
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    wiring = wire(model, "robot_")
    pose = data.qpos[wiring.qpos]
    pose[:3] = rng.normal(size=3)
    quaternion = rng.normal(size=4)
    pose[3:7] = quaternion / np.linalg.norm(quaternion)
    ranges = np.array(
        [model.joint(f"robot_{leg}_{joint}").range for leg in LEGS for joint in JOINTS]
    )
    pose[7:] = rng.uniform(ranges[:, 0], ranges[:, 1])
    data.qvel[wiring.dofs] = rng.normal(size=18)
    mujoco.mj_forward(model, data)
    return data, wiring


def test_mass_and_limits_are_the_published_ones(model):
    base = model.body("robot_base").id
    assert model.body_subtreemass[base] == pytest.approx(
        6.921 + 4 * (0.678 + 1.152 + 0.154 + 0.04), abs=1e-12
    )
    ranges = {"hip": (-1.0472, 1.0472), "calf": (-2.7227, -0.83776)}
    for leg in LEGS:
        thigh = (-1.5708, 3.4907) if leg[0] == "F" else (-0.5236, 4.5379)
        for joint, torque in zip(JOINTS, (23.7, 23.7, 35.55), strict=True):
            name = f"robot_{leg}_{joint}"
            assert tuple(model.joint(name).range) == ranges.get(joint, thigh)
            assert tuple(model.actuator(name).ctrlrange) == (-torque, torque)
            assert model.actuator(name).ctrllimited[0]


def test_a_missing_name_is_named(model):
    with pytest.raises(KeyError, match="wrong_FL_hip"):
        wire(model, "wrong_")


def test_composite_body_matches_subtree_quantities(model):
    body = QUADRUPED.controller(model, "robot_").body
    data, wiring = random_state(model, 0)
    data.qpos[wiring.qpos][3:7] = 1.0, 0.0, 0.0, 0.0
    data.qpos[wiring.qpos][7:] = 4 * standing_joints(GEOMETRY, 0.30)
    mujoco.mj_forward(model, data)
    base = model.body("robot_base").id
    inertia = np.zeros((3, 3))
    for i in range(base, model.nbody):
        axes = data.ximat[i].reshape(3, 3)
        arm = data.xipos[i] - data.subtree_com[base]
        inertia += axes @ np.diag(model.body_inertia[i]) @ axes.T
        inertia += model.body_mass[i] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert body.mass == pytest.approx(model.body_subtreemass[base], rel=1e-12)
    np.testing.assert_allclose(body.centre, data.subtree_com[base] - data.xpos[base], atol=1e-12)
    np.testing.assert_allclose(body.inertia, inertia, atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_observation_matches_mujoco(model, seed):
    data, wiring = random_state(model, seed)
    base = model.body("robot_base").id
    R = data.xmat[base].reshape(3, 3)
    centre = R.T @ (data.subtree_com[base] - data.xpos[base])
    seen, records = record(OBSERVATION)
    joints = data.qpos[wiring.qpos], data.qvel[wiring.dofs]
    parameters = packed(Parameters(), com_in_body=tuple(centre))
    observe(parameters, *joints, records)
    np.testing.assert_allclose(seen.rotation, R, atol=1e-12)
    np.testing.assert_allclose(seen.com, data.subtree_com[base], atol=1e-12)
    np.testing.assert_allclose(seen.angular_velocity, R @ data.qvel[wiring.dofs][3:6], atol=1e-12)
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(seen.angles[2])
    jacobian = np.zeros((3, model.nv))
    for leg, name in enumerate(LEGS):
        geom = model.geom(f"robot_{name}_foot").id
        mujoco.mj_jacGeom(model, data, jacobian, None, geom)
        joints = slice(wiring.dofs.start + 6 + 3 * leg, wiring.dofs.start + 9 + 3 * leg)
        np.testing.assert_allclose(seen.foot[leg], data.geom_xpos[geom], atol=1e-12)
        np.testing.assert_allclose(seen.jacobian[leg], jacobian[:, joints], atol=1e-12)
        np.testing.assert_allclose(seen.foot_velocity[leg], jacobian @ data.qvel, atol=1e-12)


def test_compiled_observation_equals_python(model):
    data, wiring = random_state(model, 7)
    arguments = data.qpos[wiring.qpos], data.qvel[wiring.dofs]
    compiled, python = (np.zeros(1, OBSERVATION).view(np.recarray) for _ in range(2))
    parameters = packed(Parameters(), com_in_body=(0.01, 0.02, -0.03)).view(np.recarray)
    observe(parameters, *arguments, compiled)
    observe.py_func(parameters, *arguments, python)
    for name in OBSERVATION.names:
        np.testing.assert_allclose(compiled[name], python[name], rtol=1e-13, atol=1e-15)


def test_foot_hangs_straight_below_the_thigh_joint():
    foot = np.empty(3)
    foot_position(GEOMETRY, 1, np.zeros(3), foot)
    np.testing.assert_allclose(foot, [0.1934, -0.0465 - 0.0955, -0.426], atol=1e-15)


@pytest.mark.parametrize("height", [0.25, 0.30, 0.40])
def test_standing_joints_put_the_foot_under_the_hip(height):
    foot = np.empty(3)
    foot_position(GEOMETRY, 0, np.array(standing_joints(GEOMETRY, height)), foot)
    np.testing.assert_allclose(foot, [0.1934, 0.142, 0.022 - height], atol=1e-12)


def test_standing_higher_than_the_legs_are_long_is_refused():
    with pytest.raises(ValueError, match=r"height: got 0\.5 m"):
        standing_joints(GEOMETRY, 0.5)


def test_other_torque_limits_reach_the_motors():
    strong = Actuators(torque=(30.0, 31.0, 32.0))
    robot = Quadruped(QUADRUPED.parameters._replace(actuators=strong))
    model = mujoco.MjModel.from_xml_string(robot.mjcf())
    assert model.actuator("RR_calf").ctrlrange[1] == 32.0
