import re

import mujoco
import numpy as np
import pytest

from tests.models.robots.hound import LEAN, SPEC, hound
from wayproof.models.robots.custom import RobotSpecError, read_robot
from wayproof.models.robots.custom.legged_parameters import foot_mass, scaled
from wayproof.models.robots.custom.proposal import check_spec
from wayproof.models.robots.custom.writing import farthest
from wayproof.models.robots.quadruped import Parameters, Quadruped
from wayproof.models.robots.quadruped.legs import foot_position
from wayproof.models.robots.quadruped.parameters import standing_joints
from wayproof.models.robots.robot import Setpoint

FLOOR = """<mujoco><option timestep="0.002" integrator="implicitfast" iterations="50"/>
  <worldbody><geom name="floor" type="plane" size="0 0 1" friction="0.8 0.005 0.0001"/></worldbody>
</mujoco>"""

CRAFT = """<mujoco model="craft"><worldbody>
    <body name="hull" pos="0 0 1">
      <geom type="box" size="0.06 0.04 0.02" pos="0.01 0 0.005" mass="0.5"/>
      <site name="p1" pos="-0.09 -0.1 0.02"/><site name="p2" pos="-0.09 0.1 0.02"/>
      <site name="p3" pos="0.11 0.1 0.02"/><site name="p4" pos="0.11 -0.1 0.02"/>
    </body></worldbody></mujoco>"""

CRAFT_SPEC = """
name = "craft"
mjcf = "craft.xml"
base = "hull"
controller = "geometric"
rotors = ["p1", "p2", "p3", "p4"]
radius = 0.25
height = 0.2
[rotor]
radius = 0.07
thrust = 3.0
yaw_ratio = -0.015
lag = 0.03
[limits]
speed = 1.5
acceleration = 2.0
jerk = 10.0
yaw_rate = 1.5
[[sensors]]
name = "altimeter"
device = "ideal-altimeter"
position = [0.01, 0.0, -0.02]
"""


def custom_robot(folder, spec, name, mjcf):
    (folder / f"{name}.xml").write_text(mjcf)
    (folder / f"{name}.toml").write_text(spec)
    return read_robot(folder / f"{name}.toml")


def on_floor(text):
    world = mujoco.MjSpec.from_string(FLOOR)
    body = mujoco.MjSpec.from_string(text)
    world.attach(body, prefix="robot_", frame=world.worldbody.add_frame())
    return world.compile()


def test_the_robot_as_written_is_the_one_that_was_brought(tmp_path):
    robot = custom_robot(tmp_path, SPEC, "hound", hound())
    given = mujoco.MjModel.from_xml_string(hound())
    ours = mujoco.MjModel.from_xml_string(robot.mjcf())
    assert ours.body_mass.sum() == pytest.approx(given.body_mass.sum())
    assert given.nu == ours.nu == 12
    turns = {"roll": (-1.0, 0.0), "swing": (-1.0, LEAN), "knee": (1.0, -LEAN)}
    names = {"roll": "hip", "swing": "thigh", "knee": "calf"}
    sides = {"vl": "FL", "vr": "FR", "hl": "RL", "hr": "RR"}
    rng = np.random.default_rng(0)
    theirs, mine = mujoco.MjData(given), mujoco.MjData(ours)
    theirs.qpos[:7] = mine.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    for leg, side in sides.items():
        for joint, (sign, zero) in turns.items():
            angle = rng.uniform(-1.0, 1.0)
            theirs.qpos[given.joint(f"{joint}_{leg}").qposadr[0]] = angle
            mine.qpos[ours.joint(f"{side}_{names[joint]}").qposadr[0]] = sign * angle + zero
    mujoco.mj_forward(given, theirs)
    mujoco.mj_forward(ours, mine)
    middle = np.array([0.03, 0.0, 0.02])
    geometry = robot.controller(ours, "").parameters.geometry
    for i, (leg, side) in enumerate(sides.items()):
        foot = theirs.geom(f"toe_{leg}").xpos - middle
        np.testing.assert_allclose(mine.geom(f"{side}_foot").xpos, foot, atol=1e-9)
        position = np.empty(3)
        foot_position(geometry, i, mine.qpos[7 + 3 * i : 10 + 3 * i], position)
        np.testing.assert_allclose(position, foot, atol=1e-9)
    np.testing.assert_allclose(mine.subtree_com[1], theirs.subtree_com[1] - middle, atol=1e-9)


def test_ranges_and_torques_are_read(tmp_path):
    model = mujoco.MjModel.from_xml_string(custom_robot(tmp_path, SPEC, "hound", hound()).mjcf())
    np.testing.assert_allclose(model.joint("FL_thigh").range, [LEAN - 1.0, LEAN + 2.5])
    np.testing.assert_allclose(model.joint("RR_calf").range, [-2.3 - LEAN, -0.3 - LEAN])
    np.testing.assert_allclose(model.actuator_ctrlrange, [[-20.0, 20.0]] * 12)
    assert (model.geom_group == 3).all()
    assert model.ngeom == 1 + 4 * 4  # neither the floor nor what nothing collides with


@pytest.mark.parametrize(("forward", "turn"), [(0.6, 0.0), (0.4, 0.6)])
def test_a_robot_that_is_not_ours_walks(tmp_path, forward, turn):
    robot = custom_robot(tmp_path, SPEC, "hound", hound())
    model = on_floor(robot.mjcf())
    data = mujoco.MjData(model)
    controller = robot.controller(model, "robot_")
    controller.reset(data, np.array([0.0, 0.0, robot.spec.rest_height]), 0.0)
    yaw, way = 0.0, 0.0
    for _ in range(1500):
        controller.walk(data, np.array([forward, 0.0, turn]))
        mujoco.mj_step(model, data)
        yaw += 0.002 * data.qvel[5]
        way += 0.002 * float(np.hypot(*data.qvel[:2]))
        assert data.xmat[1, 8] > 0.95
        assert abs(data.qpos[2] - robot.spec.rest_height) < 0.03
    assert abs(yaw - turn * 3.0) < 0.2
    assert 0.75 * forward * 3.0 <= way <= 1.2 * forward * 3.0 + 0.05


def test_our_own_figures_are_those_that_nothing_is_scaled_at():
    quadruped = Quadruped()
    model = mujoco.MjModel.from_xml_string(quadruped.mjcf())
    geometry, gait = quadruped.parameters.geometry, quadruped.parameters.gait
    standing = standing_joints(geometry, gait.height)
    assert foot_mass(model, "", geometry, standing) == pytest.approx(0.502, abs=1e-3)
    assert scaled(1.0, 1.0, 1.0) == Parameters()


def test_four_times_the_length_takes_twice_the_time():
    large = scaled(64.0, 4.0, 64.0)
    own = Parameters()
    assert large.gait.period == 2.0 * own.gait.period
    assert large.gait.swing_height == 4.0 * own.gait.swing_height
    assert large.prediction.weight_force == own.prediction.weight_force / 64.0**2
    assert large.legs.swing_stiffness == 16.0 * own.legs.swing_stiffness


def test_a_craft_that_is_not_ours_flies(tmp_path):
    robot = custom_robot(tmp_path, CRAFT_SPEC, "craft", CRAFT)
    model = on_floor(robot.mjcf())
    data = mujoco.MjData(model)
    controller = robot.controller(model, "robot_")
    airframe = controller.parameters.airframe
    assert airframe.mass == pytest.approx(0.5)
    assert (airframe.arm_x, airframe.arm_y) == pytest.approx((0.1, 0.1))
    box = 0.5 / 3.0 * np.array([0.04**2 + 0.02**2, 0.06**2 + 0.02**2, 0.06**2 + 0.04**2])
    np.testing.assert_allclose(airframe.inertia, box, rtol=1e-6)
    controller.reset(data, np.array([0.0, 0.0, 1.0]), 0.0)
    goal = np.array([0.5, -0.3, 1.4])
    for _ in range(2000):
        controller.follow(data, Setpoint(tuple(goal), (0.0, 0.0, 0.0), 1.0, 0.0))
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.qpos[:3] - goal) < 0.02
    assert 2.0 * np.arctan2(data.qpos[6], data.qpos[3]) == pytest.approx(1.0, abs=0.05)


def test_a_hull_keeps_its_corners():
    rng = np.random.default_rng(1)
    corners = np.array(np.meshgrid([-1, 1], [-2, 2], [-3, 3])).reshape(3, 8).T.astype(float)
    points = np.vstack([corners, rng.uniform(-0.9, 0.9, (100, 3))])
    assert {tuple(p) for p in farthest(points)} == {tuple(p) for p in corners}


def test_the_name_tells_the_spec_and_the_body(tmp_path):
    one = custom_robot(tmp_path, SPEC, "hound", hound()).identity
    assert one.startswith("hound@")
    assert custom_robot(tmp_path, SPEC, "hound", hound()).identity == one
    assert (
        custom_robot(tmp_path, SPEC, "hound", hound().replace('mass="5"', 'mass="6"')).identity
        != one
    )
    assert custom_robot(tmp_path, SPEC.replace("0.8", "0.7"), "hound", hound()).identity != one


CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 0.2) for y in (0, 0.1) for z in (0, 0.1))
CUBE += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"


@pytest.mark.parametrize("controller", ["trot", "any:Thing"])
def test_meshes_that_collide_are_in_the_text_and_others_are_not(tmp_path, controller):
    (tmp_path / "cube.obj").write_text(CUBE)
    body = hound().replace(
        "<worldbody>",
        '<asset><mesh name="cube" file="cube.obj"/></asset><worldbody>', 1
    ).replace(
        "<freejoint/>",
        """<freejoint/>
        <geom name="pack" type="mesh" mesh="cube" pos="-0.1 -0.05 0.07" euler="0 0 0.2" mass="1"/>
        <geom type="mesh" mesh="cube" contype="0" conaffinity="0" mass="0"/>""",
    )  # fmt: skip
    spec = SPEC
    if controller != "trot":
        spec = SPEC.replace('"trot"', f'"{controller}"\nmotion = "ground"\nstance = 0.31')
    text = custom_robot(tmp_path, spec, "hound", body).mjcf()
    assert "file" not in text
    given = mujoco.MjModel.from_xml_path(str(tmp_path / "hound.xml"))
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nmesh == 1
    assert model.body_mass.sum() == pytest.approx(given.body_mass.sum())
    theirs, ours = mujoco.MjData(given), mujoco.MjData(model)
    mujoco.mj_kinematics(given, theirs)
    mujoco.mj_kinematics(model, ours)
    mesh = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)[0])
    pack = given.geom("pack").id
    shift = ours.xpos[1] - theirs.xpos[given.body("torso").id]
    if controller == "trot":
        shift = shift - [0.03, 0.0, 0.02]  # the base is in the middle of the hips
    corners = {}
    for key, m, d, geom in (("given", given, theirs, pack), ("ours", model, ours, mesh)):
        first, count = m.mesh_vertadr[m.geom_dataid[geom]], m.mesh_vertnum[m.geom_dataid[geom]]
        points = m.mesh_vert[first : first + count] @ d.geom_xmat[geom].reshape(3, 3).T
        points = points + d.geom_xpos[geom] - (shift if key == "ours" else 0.0)
        corners[key] = points[np.lexsort(points.round(4).T)]
    np.testing.assert_allclose(corners["ours"], corners["given"], atol=1e-5)


BAD_SPECS = [
    ("ideal-lidar-floor", "lidar-9000", "unknown device 'lidar-9000' (available: "),
    ('base = "torso"', 'base = "trunk"', "no body 'trunk' in 'hound.xml' (available: torso)"),
    ('"toe_vl", "toe_vr"', '"toe_vr", "toe_vl"', "feet: FL is at ("),
    ('"toe_vl"', '"nose"', "feet: 'nose' is neither a geom, a site nor a body"),
    ('"toe_vl"', '"toe_hl"', "expected four different legs"),
    (
        '"trot"',
        '"gallop"',
        "unknown 'gallop' (available: geometric, trot, module:Class, FILE.py:Class)",
    ),
    ('"hound.xml"', '"cat.xml"', "mjcf: no file"),
    ('"hound.xml"', '"no_such_package:a.xml"', "no package 'no_such_package' is installed"),
    ("step_height = 0.03", "", "limits.step_height: got 0, expected above 0 on the ground"),
    ("speed = 0.8", "speed = 0", "limits.speed: got 0, expected above 0"),
    ("speed = 0.8", "sped = 0.8", "unknown field `sped`"),
    ("radius = 0.4", "radius = 0.4\nfeet = " + 5000 * "[", "no TOML: "),
    ("radius = 0.4", "radius = nan", "radius: got nan"),
    ('name = "hound"', 'name = "../../x"', "name: got '../../x'"),
    ("[limits]", 'actuators = ["roll_vl"]\n[limits]', "actuators: got 1, expected twelve"),
    ("radius = 0.4", "radius = 0.4\nstance = 0.9", "stance: height: got 0.9 m, legs reach"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD_SPECS)
def test_bad_specs(tmp_path, old, new, said):
    assert old in SPEC
    with pytest.raises(RobotSpecError) as error:
        custom_robot(tmp_path, SPEC.replace(old, new, 1), "hound", hound())
    assert said in str(error.value)
    assert "\n" not in str(error.value)


BAD_BODIES = [
    ('<position name="roll_vl"', '<position name="roll_vl" gear="0"', "no torque limit"),
    ('<joint name="knee_hr" axis="0 1 0" range="-2.3 -0.3" damping="0.1" armature="0.008"/>', "",
     "mjcf"),
    ('joint name="swing_hl" axis="0 -1 0"', 'joint name="swing_hl" axis="0 0 1"',
     "joint 'swing_hl': axis (0.000, 0.000, 1.000) in the base, expected along y"),
    ('mass="5"', 'mass="0"', "mass"),
    ("</mujoco>", '<asset><mesh name="m" file="../m.stl"/></asset></mujoco>', "outside"),
    ("</mujoco>", "", "mjcf"),
    ("<freejoint/>", '<joint axis="1 0 0"/>', "base: body 'torso' is not free"),
    ("<freejoint/>", '<freejoint/><body><joint name="arm"/><geom size="0.01"/></body>',
     "joint 'arm' is no part of a leg"),
    ('<position name="knee_vl" joint="knee_vl" kp="50" forcerange="-20 20"/>', "",
     "joint 'knee_vl': 0 actuators, expected one"),
    ('range="-2.3 -0.3"', 'range="0.3 2.3"', "expected knees that bend backwards"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), BAD_BODIES)
def test_bad_bodies(tmp_path, old, new, said):
    assert old in hound()
    with pytest.raises(RobotSpecError) as error:
        custom_robot(tmp_path, SPEC, "hound", hound().replace(old, new))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


BAD_CRAFTS = [
    ('"p1", "p2"', '"p2", "p1"', "rotors: the rear right one is at ("),
    ('"p1"', '"p9"', "rotors: no site, geom or body 'p9' in the MJCF"),
    ("thrust = 3.0", "thrust = 1.0", "rotor.thrust: four of 1 N lift 4.91 N, expected 1.3 times"),
    ("lag = 0.03", "lag = -1.0", "rotor.lag: got -1, expected above 0"),
    ("radius = 0.25", "radius = 0.2", "radius: got 0.2 m, but the body reaches 0.21"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD_CRAFTS)
def test_bad_crafts(tmp_path, old, new, said):
    assert old in CRAFT_SPEC
    with pytest.raises(RobotSpecError) as error:
        custom_robot(tmp_path, CRAFT_SPEC.replace(old, new), "craft", CRAFT)
    assert said in str(error.value)


def test_discs_have_to_hold_the_walking_body(tmp_path):
    bad = SPEC.replace("radius = 0.4", "radius = 0.4\ndiscs = [[0.0, 0.1]]")
    with pytest.raises(RobotSpecError, match=r"discs: walking the body reaches 0\.\d+ m beyond"):
        custom_robot(tmp_path, bad, "hound", hound())


def test_a_check_names_all_sizes_at_once(tmp_path):
    small = SPEC.replace("radius = 0.4", "radius = 0.2").replace("height = 0.4", "height = 0.2")
    (tmp_path / "small.toml").write_text(small)
    (tmp_path / "hound.xml").write_text(hound())
    wrong = check_spec(tmp_path / "small.toml").wrong
    assert [line.split(":")[0] for line in wrong] == ["radius", "height"]
    with pytest.raises(RobotSpecError, match=r"radius: got 0\.2 m, .*; height: got 0\.2 m"):
        read_robot(tmp_path / "small.toml")


def test_unnamed_feet_are_named_by_their_body(tmp_path):
    path = tmp_path / "nameless.xml"
    path.write_text(re.sub(r"""name=['"]toe_\w\w['"]""", "", hound()))
    assert "toe_vl" not in path.read_text()
    proposal = check_spec(path).proposal
    assert proposal is not None
    (tmp_path / "nameless.toml").write_text(proposal.toml())
    proposed = read_robot(tmp_path / "nameless.toml")
    assert proposed.spec.motion == "ground"
    assert proposed.file.discs == proposal.spec.discs


def test_a_craft_is_proposed_from_its_thrusters(tmp_path):
    sites = {"a": (-0.1, -0.1), "b": (-0.1, 0.1), "c": (0.1, 0.1), "d": (0.1, -0.1)}
    places = "".join(f'<site name="{n}" pos="{x} {y} 0"/>' for n, (x, y) in sites.items())
    motors = "".join(
        f'<motor site="{n}" ctrllimited="true" ctrlrange="0 6" gear="0 0 1 0 0 0.02"/>'
        for n in sites
    )
    (tmp_path / "craft.xml").write_text(
        f'<mujoco><worldbody><body name="hull"><freejoint/><geom type="box" size=".1 .1 .03" '
        f'mass="1"/>{places}</body></worldbody><actuator>{motors}</actuator></mujoco>'
    )
    proposal = check_spec(tmp_path / "craft.xml").proposal
    assert proposal is not None
    assert (proposal.spec.rotors, proposal.spec.rotor.thrust) == (("a", "b", "c", "d"), 6.0)
    (tmp_path / "craft.toml").write_text(proposal.toml())
    assert read_robot(tmp_path / "craft.toml").spec.motion == "air"


def check_proposed(folder, mjcf):
    """Propose a spec for an MJCF and read the robot by it."""
    (folder / "proposed.xml").write_text(mjcf)
    checked = check_spec(folder / "proposed.xml")
    assert checked.proposal is not None, checked.unproposed
    (folder / "proposed.toml").write_text(checked.proposal.toml())
    return read_robot(folder / "proposed.toml"), checked.proposal.notes


def test_rotors_are_found_by_their_names(tmp_path):
    places = {"motor0": (0.1, -0.1), "motor1": (-0.1, -0.1), "motor2": (-0.1, 0.1)}
    places["motor3"] = (0.1, 0.1)
    sites = "".join(f'<site name="{n}" pos="{x} {y} 0.01"/>' for n, (x, y) in places.items())
    robot, notes = check_proposed(
        tmp_path,
        f"""<mujoco><worldbody><body name="hull" pos="0 0 0.3"><geom size="0.15" mass="1"/>
        <geom type="box" size="1 1 1" contype="0" conaffinity="0" mass="0"/>{sites}
        <body name="propguard0"/></body></worldbody></mujoco>""",
    )
    assert robot.file.rotors == ("motor1", "motor2", "motor3", "motor0")
    assert "rotor.thrust is assumed from the weight" in notes
    assert robot.file.sensors[0].position == pytest.approx((0.0, 0.0, 0.16), abs=1e-3)
    assert 0.2 < robot.file.radius < 0.23  # a rotor's rim, not the box that nothing collides with


@pytest.mark.large
def test_the_end_of_a_mesh_is_a_foot(tmp_path):
    """A foot of a mesh has the place and radius of the ball that the mesh was made of."""
    ball = farthest(np.random.default_rng(1).normal(size=(4000, 3)))
    ball = 0.02 * ball / np.linalg.norm(ball, axis=1)[:, None]
    shank = np.concatenate([ball + np.array([0.0, 0.0, -0.17]), ball / 2.0])
    text = " ".join(f"{value:.6f}" for value in shank.ravel())
    mjcf = re.sub(
        r'<geom type="capsule" size="0.01".*?/>', "", hound().replace(
            "<worldbody>", f'<asset><mesh name="shank" vertex="{text}"/></asset><worldbody>', 1)
    )  # fmt: skip
    mjcf = re.sub(
        r'<geom name="toe_\w\w" size="0.02" pos="0 0 -0.17" mass="0.03"/>',
        '<geom type="mesh" mesh="shank" mass="0.13"/>', mjcf,
    )  # fmt: skip
    robot, _ = check_proposed(tmp_path, mjcf)
    assert robot.file.feet == ("c_vl", "c_vr", "c_hl", "c_hr")
    model = mujoco.MjModel.from_xml_string(robot.mjcf())
    assert model.geom("FL_foot").size[0] == pytest.approx(0.02, rel=0.05)
    assert model.geom("FL_foot").pos[2] == pytest.approx(-0.17, abs=1e-3)


@pytest.mark.large
def test_weak_joints_bear_the_robot_on_straighter_legs(tmp_path):
    weak = hound().replace("-20 20", "-8 8")
    robot, notes = check_proposed(tmp_path, weak)
    assert any(note.startswith("stance") for note in notes)
    assert robot.spec.rest_height > custom_robot(tmp_path, SPEC, "hound", weak).spec.rest_height
    (tmp_path / "hound.xml").write_text(weak)
    (tmp_path / "hound.toml").write_text(SPEC)
    wrong = check_spec(tmp_path / "hound.toml").wrong
    assert wrong
    assert wrong[0].startswith("stance: the base sinks by")


@pytest.mark.large
def test_too_weak_joints_are_refused(tmp_path):
    (tmp_path / "feeble.xml").write_text(hound().replace("-20 20", "-2 2"))
    checked = check_spec(tmp_path / "feeble.xml")
    assert checked.proposal is None
    assert re.match("the robot (falls|sinks by)", checked.unproposed)


@pytest.mark.large
def test_a_trunk_that_nothing_collides_with_collides_as_drawn(tmp_path):
    ghost = hound().replace('pos="0.03 0 0.02" mass="5"', 'pos="0.03 0 0.02" mass="5" contype="0" '
                            'conaffinity="0"')  # fmt: skip
    robot, _ = check_proposed(tmp_path, ghost)
    model = mujoco.MjModel.from_xml_string(robot.mjcf())
    trunk = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 1]
    assert [int(model.geom_conaffinity[geom]) for geom in trunk] == [1]


@pytest.mark.large
def test_meshes_beside_the_model_lie_below_the_spec(tmp_path):
    """The layout of ROS packages: mjcf/ and meshes/ beside one another."""
    for folder in ("mjcf", "meshes"):
        (tmp_path / folder).mkdir()
    (tmp_path / "meshes/hull.obj").write_text(
        "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "mjcf/hound.xml").write_text(hound().replace(
        "<worldbody>", '<asset><mesh name="hull" file="../meshes/hull.obj"/></asset><worldbody>', 1
    ))  # fmt: skip
    checked = check_spec(tmp_path / "mjcf/hound.xml", tmp_path)
    assert checked.proposal is not None
    assert checked.proposal.spec.mjcf == "mjcf/hound.xml"
    inside = check_spec(tmp_path / "mjcf/hound.xml")
    assert inside.proposal is None
    assert inside.unproposed.endswith("expected the spec file in a folder that holds both")
