"""Findings on models whose sensors would see wrongly, and that MuJoCo does see wrongly there."""

import dataclasses

import mujoco
import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from wayproof.models.checks import Finding, check, distance_to, holds
from wayproof.models.robots import ROBOTS
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import compose
from wayproof.models.sensors.beams import directions
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.sensors.devices import DEVICES, DepthCamera, Mount, SpinningLidar, evenly

LIDAR = SpinningLidar(
    elevations=evenly(-1.0, 1.0, 16), azimuths=64, range=5.0, rate=10.0,
    no_return_is_free=True, source="test",
)  # fmt: skip
MOUNT = Mount("lidar", "eye", LIDAR)
ALTIMETER = Mount("altimeter", "eye", DEVICES["ideal-altimeter"])
OWN = f'group="{ROBOT_GROUP}"'
HEAD = '<visual><map znear="0.001"/></visual>'
ALL = np.ones(mujoco.mjNGROUP, np.uint8)


def posed(worldbody, head=HEAD):
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{head}<worldbody>{worldbody}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def robot(inside="", head=HEAD, world=""):
    """A robot of a hull in its own group, with a site 0.3 m above the hull's centre."""
    hull = f'<geom name="hull" type="box" size=".2 .2 .2" {OWN}/>'
    eye = '<site name="eye" pos="0 0 .3"/>'
    return posed(f'{world}<body name="base" pos="0 0 1">{hull}{eye}{inside}</body>', head)


def found(model, data, mounts=(MOUNT,), engine="tile", **more):
    base = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
    return check(model, data, mounts, max(base, 0), engine, **more)


def test_a_sound_model_has_no_findings():
    assert found(*robot(world='<geom type="plane" size="0 0 1"/>')) == []


@pytest.mark.parametrize("name", sorted(ROBOTS))
@pytest.mark.parametrize("device", ["ideal-lidar-wide", "livox-mid360", "intel-realsense-d435"])
def test_our_robots_are_sound_with_any_device(name, device):
    world, entry = drawn("warehouse", 0), ROBOTS[name]
    scene = compose(world, entry)
    data = mujoco.MjData(scene.model)
    start = np.array([*world.start[:2], entry.spec.rest_height])
    scene.controller.reset(data, start, world.start_heading)
    mujoco.mj_kinematics(scene.model, data)
    mounts = [Mount("lidar", "lidar", DEVICES[device])]
    assert check(scene.model, data, mounts, scene.base, "mujoco", ROBOT_PREFIX) == []


@pytest.mark.parametrize(
    ("version", "sound"),
    [("3.8.0", False), ("3.10.1", False), ("4.0.0", True), ("4.0.1rc1", True), ("10.2", True)],
)
def test_an_old_mujoco_is_an_error(version, sound):
    findings = found(*robot(), version=version)
    assert [finding.severity for finding in findings] == [] if sound else ["error"]
    assert all(f"got {version}, expected 4.0 or newer" in finding.text for finding in findings)


# Geoms that mj_multiRay misses

CORE = '<geom name="core" type="box" size=".2 .2 .2" pos="2 0 0"/>'
SHELL = '<geom name="shell" type="box" size="{}" pos="{}" contype="0" conaffinity="0" {}/>'


def misses(model, data, origin=(0.0, 0.0, 0.0), count=4000):
    """Rays from `origin` that meet another geom by mj_multiRay than by mj_ray."""
    rays = np.random.default_rng(0).normal(size=(count, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    many, one, distances = np.empty(count, np.int32), np.empty(1, np.int32), np.empty(count)
    at = np.array(origin)
    mujoco.mj_multiRay(
        model, data, at, rays.ravel(), ALL, 1, -1, many, distances, None, count, 100.0
    )
    wrong = 0
    for k in range(count):
        mujoco.mj_ray(model, data, at, rays[k], ALL, 1, -1, one)
        wrong += many[k] != one[0]
    return wrong


@pytest.mark.parametrize(
    ("worldbody", "missed"),
    [
        (f"<body>{CORE}{SHELL.format('.2 .2 .2', '2 2 0', '')}</body>", True),
        (CORE + SHELL.format(".2 .2 .2", "2 2 0", ""), True),  # the world is a body too
        (f"<body>{CORE}</body><body>{SHELL.format('.2 .2 .2', '2 2 0', '')}</body>", False),
        (f"<body>{CORE}{SHELL.format('.1 .1 .1', '2 0 0', '')}</body>", False),  # inside
        (
            '<geom type="plane" size="0 0 1" pos="0 0 -1"/>'
            + SHELL.format(".2 .2 .2", "2 2 0", ""),
            False,  # a plane's bounding sphere holds everything
        ),
    ],
)
def test_visual_geoms_beside_colliding_ones_are_missed_and_said_to_be(worldbody, missed):
    model, data = posed(worldbody)
    assert (misses(model, data) > 0) == missed
    assert [f.severity for f in found(model, data, (), "tile")] == ["warning"] * missed
    errors = found(model, data, (), "mujoco")
    assert [f.severity for f in errors] == ["error"] * missed
    assert all(
        f.text == "geoms 'shell': got contype = conaffinity = 0 beside colliding geoms, expected a "
        "body of their own: mj_multiRay misses them"
        for f in errors
    )


@pytest.mark.parametrize("attributes", [OWN, 'rgba="1 1 1 0"'])
def test_what_beams_look_through_is_not_missed(attributes):
    model, data = posed(f"<body>{CORE}{SHELL.format('.2 .2 .2', '2 2 0', attributes)}</body>")
    assert found(model, data, (), "mujoco") == []


def test_nothing_is_missed_where_nothing_is_found():
    """Random turned bodies of one colliding and one visual box."""
    rng = np.random.default_rng(5)
    sound = 0
    for _ in range(60):
        numbers = [" ".join(map(str, rng.uniform(-0.6, 0.6, 3))) for _ in range(2)]
        turn = " ".join(map(str, rng.normal(size=4)))
        model, data = posed(
            f'<body pos="2 0.3 -0.4" quat="{turn}">'
            f'<geom type="box" size=".7 .2 .1" pos="{numbers[0]}" quat="{turn}"/>'
            + SHELL.format(".2 .1 .05", numbers[1], "")
            + "</body>"
        )
        if found(model, data, (), "mujoco") == []:
            sound += 1
            assert misses(model, data, count=500) == 0
    assert 10 < sound < 50


def test_offenders_are_named_up_to_three():
    shells = "".join(
        SHELL.format(".1 .1 .1", f"2 {y} 0", "").replace("shell", f"s{y}") for y in range(1, 6)
    )
    (finding,) = found(*posed(f"<body>{CORE}{shells}</body>"), ())
    assert "geoms 's1', 's2', 's3' and 2 more: got" in finding.text


def test_geoms_without_a_name_go_by_number():
    shell = SHELL.format(".1 .1 .1", "2 2 0", "").replace('name="shell"', "")
    (finding,) = found(*posed(f"<body>{CORE}{shell}</body>"), ())
    assert "geoms 'number 1':" in finding.text


# Sites inside geoms


def test_a_site_inside_the_worlds_geoms_is_an_error():
    world = '<geom name="rack" type="box" size="1 1 1" pos="0 0 2"/>'
    (finding,) = found(*robot(world=world))
    assert finding == Finding(
        "error",
        "site 'eye' of sensor 'lidar': got a place inside geoms 'rack', expected one outside all "
        "that its beams meet",
    )


def test_a_site_inside_what_its_beams_leave_out_is_sound():
    assert found(*robot(f'<geom type="sphere" size=".1" pos="0 0 .3" {OWN}/>')) == []


def test_a_rangefinder_sees_its_own_group_but_not_its_own_body():
    inside = f'<geom name="{{}}" type="sphere" size=".1" pos="0 0 .3" {OWN}/>'
    own_body = inside.format("housing")
    assert found(*robot(own_body), [ALTIMETER]) == []
    other_body = f"<body>{inside.format('mast')}</body>"
    texts = [finding.text for finding in found(*robot(other_body), [ALTIMETER])]
    assert len(texts) == 2
    assert "inside geoms 'mast'" in texts[0]
    assert "meet the robot's own geoms 'mast', expected a free view" in texts[1]
    assert found(*robot(other_body), [MOUNT]) == []


def test_a_missing_site_is_an_error():
    mount = dataclasses.replace(MOUNT, site="nose")
    (finding,) = found(*robot(), [mount])
    assert finding.text == "sensor 'lidar': got no site 'nose', expected one"


CUBE = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-0.5, 0.5) for z in (-0.3, 0.3))
ASSETS = (
    f'<asset><mesh name="cube" vertex="{CUBE}"/>'
    '<hfield name="ramp" nrow="2" ncol="2" size="1 1 1 0.2" elevation="0 1 0 1"/></asset>'
)
POSE = 'name="it" pos=".1 .2 .3" euler="20 30 40"'


@pytest.mark.parametrize(
    ("shape", "inside", "outside"),
    [
        ('type="sphere" size=".5"', [(0, 0, 0.49)], [(0, 0.3, 0.45)]),
        ('type="capsule" size=".2 .5"', [(0, 0, 0.69), (0.19, 0, 0.5)], [(0.15, 0, 0.69)]),
        ('type="ellipsoid" size="1 .5 .2"', [(0.9, 0, 0), (0, 0, 0.19)], [(0.9, 0.3, 0)]),
        ('type="cylinder" size=".2 .5"', [(0.13, 0.13, 0.49)], [(0.15, 0.15, 0), (0, 0, 0.51)]),
        ('type="box" size="1 .5 .2"', [(0.99, -0.49, 0.19)], [(0, 0, 0.21), (0, -0.51, 0)]),
        ('type="plane" size="0 0 1"', [(90, 0, -0.01)], [(0, 0, 0.01)]),
        ('type="plane" size="1 2 1"', [(0.9, 1.9, -0.01)], [(1.1, 0, -1), (0, 2.1, -1)]),
        ('type="mesh" mesh="cube"', [(0.9, 0.4, 0.2), (0, 0, 0)], [(1.1, 0, 0), (0, 0, 0.4)]),
        ('type="hfield" hfield="ramp"', [(0, 0, 0.4), (0.9, 0, -0.1)], [(0, 0, 0.6), (0, 0, -0.3)]),
    ],
)
def test_points_inside_and_outside_of_each_shape(shape, inside, outside):
    model, data = posed(f"<geom {POSE} {shape}/>", ASSETS)
    # A mesh is turned to its own axes, which are those of this box already, up to their order.
    R, center = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    if "mesh" in shape:
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
        R = R @ turn.reshape(3, 3).T
    for points, expected in ((inside, True), (outside, False)):
        for point in points:
            assert holds(model, data, 0, center + R @ np.array(point, float)) == expected


@pytest.mark.parametrize(
    "shape",
    [
        "sphere",
        "capsule",
        "ellipsoid",
        "cylinder",
        "box",
        'mesh" mesh="cube',
        'hfield" hfield="ramp',
    ],
)
def test_single_geoms_are_as_far_as_mj_ray_says(shape):
    model, data = posed(f'<geom {POSE} type="{shape}" size=".5 .4 .3"/>', ASSETS)
    rng = np.random.default_rng(1)
    geom, hits = np.empty(1, np.int32), 0
    for _ in range(200):
        origin = rng.normal(size=3)
        ray = data.geom_xpos[0] + 0.5 * rng.normal(size=3) - origin
        ray /= np.linalg.norm(ray)
        expected = mujoco.mj_ray(model, data, origin, ray, ALL, 1, -1, geom)
        assert distance_to(model, data, 0, origin, ray) == pytest.approx(expected, abs=1e-12)
        hits += expected >= 0.0
    assert 20 < hits < 180


# The robot in its own beams


def test_own_geoms_in_the_beams_are_named():
    mast = '<geom name="mast" type="capsule" size=".02" fromto="{} 0 .2 {} 0 .5"/>'
    (finding,) = found(*robot(mast.format(".15", ".15")))
    assert finding == Finding(
        "error",
        "sensor 'lidar': got beams that meet the robot's own geoms 'mast', expected group 3, which "
        "its beams leave out",
    )
    assert found(*robot(mast.format("5.2", "5.2"))) == []  # beyond the range


def test_own_geoms_out_of_view_are_sound():
    """Below the lidar's lowest ring of -1 rad, and behind a camera."""
    assert found(*robot('<geom type="sphere" size=".1" pos="0 0 -.5"/>')) == []
    behind = '<geom name="tail" type="sphere" size=".1" pos="-.5 0 .3"/>'
    camera = DepthCamera(
        height=9, width=9, field_of_view_horizontal=1.0, field_of_view_vertical=1.0,
        range=5.0, rate=10.0, no_return_is_free=True, source="test",
    )  # fmt: skip
    assert found(*robot(behind), [Mount("camera", "eye", camera)]) == []
    assert len(found(*robot(behind))) == 1


def test_own_geoms_are_those_of_all_bodies_below_the_base():
    ball = '<geom name="ball" type="sphere" size=".1" pos="1 0 .3"/>'
    leg = f"<body><joint/>{ball}</body>"
    assert "'ball'" in found(*robot(leg))[0].text
    assert found(*robot(world=f'<body pos="0 0 1">{ball}</body>')) == []


def test_own_geoms_are_found_exactly_where_a_beam_meets_them():
    """Against mj_ray over every beam, for small balls all around."""
    rng = np.random.default_rng(2)
    outcomes = set()
    for _ in range(80):
        at = rng.normal(size=3)
        at *= rng.uniform(0.5, 5.5) / np.linalg.norm(at)
        position = " ".join(map(str, at + np.array([0.0, 0.0, 0.3])))
        model, data = robot(f'<geom name="ball" type="sphere" size=".05" pos="{position}"/>')
        groups = ALL.copy()
        groups[ROBOT_GROUP] = 0
        geom, eye = np.empty(1, np.int32), data.site_xpos[0]
        hits = [
            mujoco.mj_ray(model, data, eye, beam, groups, 1, -1, geom)
            for beam in directions(LIDAR.beam_table(), 0)
        ]
        met = any(0.0 <= distance <= LIDAR.range for distance in hits)
        assert len(found(model, data)) == met
        outcomes.add(met)
    assert outcomes == {True, False}


# The renderer


@pytest.mark.parametrize(("minimum", "blind"), [(0.0, True), (0.05, True), (0.1, False)])
def test_a_far_near_clip_is_a_warning(minimum, blind):
    """0.01 x 8 m = 0.08 m."""
    head = '<statistic extent="8"/><visual><map znear="0.01"/></visual>'
    mount = dataclasses.replace(MOUNT, device=dataclasses.replace(LIDAR, minimum_range=minimum))
    findings = found(*robot(head=head), [mount])
    assert [finding.severity for finding in findings] == ["warning"] * blind
    said = "got 0.08 m, expected at most 0.05 m, the nearest of sensors 'lidar'"
    assert all(said in finding.text for finding in findings)


def test_errors_come_first():
    head = '<statistic extent="100"/>'
    world = '<geom name="rack" type="box" size="1 1 1" pos="0 0 2"/>'
    severities = [f.severity for f in found(*robot(head=head, world=world))]
    assert severities == ["error", "warning"]
