"""World files: what they name, their digest, and generated worlds read back."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from tests.models.world_files.written import (
    ENDS,
    PILLAR,
    TETRAHEDRON,
    imported,
    one_ray,
    sdf,
    write,
)
from wayproof.models.world_files import WorldFileError, read_world_file
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.shape import shape_digest
from wayproof.models.world_files.world_file import file_of, world_of, world_text
from wayproof.models.worlds import WORLDS


def test_includes_and_assets_are_inlined(tmp_path):
    (tmp_path / "parts").mkdir()
    write(tmp_path / "parts", "post.xml", "<mujoco><worldbody><body pos='2 0 0' euler='0 0 90'>"
          "<joint/><geom name='post_7' type='box' size='.1 .3 .5' pos='0 0 .5'/></body>"
          "<geom type='sphere' size='.2' pos='0 0 1' contype='0' conaffinity='0'/>"
          "</worldbody></mujoco>")  # fmt: skip
    top = (
        "<mujoco><include file='parts/post.xml'/><asset>"
        "<hfield name='h' nrow='2' ncol='2' size='1 1 .5 .1' elevation='0 0 1 1'/></asset>"
        "<worldbody><geom type='plane' size='5 5 1'/>"
        "<geom type='hfield' hfield='h' pos='0 3 0'/></worldbody></mujoco>"
    )
    world, notes = import_world(write(tmp_path, "top.xml", top), None, **ENDS)
    assert world.solid_names == ("structure_0", "post_0")
    np.testing.assert_allclose(world.solids[1].high, (2.3, 0.1, 1.0), atol=1e-12)
    assert notes == ["1 geoms that nothing collides with: left out",
                     "1 joints: everything stands still here",
                     "3 geoms of another friction: 0.8 here (post_7)"]  # fmt: skip
    scene = tmp_path / "alone"
    scene.mkdir()
    again = read_world_file(write(scene, "top.xml", world.text))
    # MuJoCo takes the first row for the far side in y, as in a picture: 0.025 m high at y = 3.9.
    assert one_ray(again, (0.0, 3.9, 2.0), (0.0, 0.0, -1.0)) == pytest.approx(1.975, abs=1e-6)
    assert again.solids[0].distance([[0.0, 2.0, 2.0]])[0] == pytest.approx(1.5, abs=1e-6)
    assert again.solids[0].distance([[0.0, 4.0, 2.0]])[0] > 1.6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><include file='../up.xml'/></mujoco>", "lies outside the scene's folder"),
        ("<mujoco><asset><mesh name='m' file='/etc/passwd'/></asset></mujoco>", "lies outside"),
        (
            "<mujoco><compiler meshdir='..'/><asset><mesh name='m' file='x.stl'/></asset></mujoco>",
            "lies outside",
        ),
        ("<mujoco><include file='top.xml'/></mujoco>", "in a circle"),
        ("<mujoco><extension/></mujoco>", "<extension>: loads code"),
        ("<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", "top.xml: "),
    ],
)  # fmt: skip
def test_scenes_that_reach_out_are_refused(tmp_path, text, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "top.xml", text))


def test_a_world_file_names_no_other_file(tmp_path):
    text = imported(sdf(tmp_path, PILLAR.format(pose="2 0 0 0 0 0"))).text
    reaching = text.replace("<asset>", "<asset><mesh name='m' file='m.stl'/>")
    with pytest.raises(WorldFileError, match="<mesh>: not of a world file"):
        read_world_file(write(tmp_path, "a.xml", reaching))
    with pytest.raises(WorldFileError, match="not a world file; 'wayproof import' makes one of it"):
        read_world_file(write(tmp_path, "b.xml", "<mujoco/>"))
    other = text.replace('format" data="1"', 'format" data="9"')
    with pytest.raises(WorldFileError, match="format '9', expected '1'"):
        world_of(other)


ROBOT_SCENE = """<mujoco><compiler meshdir="assets"/><asset><mesh file="rock.obj"/>
<mesh name="hull" file="robot.obj"/></asset><worldbody><geom type="plane" size="9 9 1"/>
<geom type="box" size="1 1 1" pos="5 0 1"/><geom type="mesh" mesh="rock" pos="-3 0 1"/>
<body name="robot"><freejoint/><geom type="mesh" mesh="hull"/></body></worldbody></mujoco>
"""


def test_meshes_of_a_robot_that_is_left_out_need_not_be_there(tmp_path):
    (tmp_path / "assets").mkdir()
    write(tmp_path / "assets", "rock.obj", TETRAHEDRON)
    scene = write(tmp_path, "scene.xml", ROBOT_SCENE)
    with pytest.raises(WorldFileError, match=r"no file 'robot\.obj', which it names; .*--without"):
        imported(scene)
    world = imported(scene, without=("robot",))
    assert sorted(type(solid).__name__ for solid in world.solids) == ["Box", "ConvexMesh"]


ROOM_ENDS = Ends((-3.0, -3.0, -0.5), (3.0, 3.0, 3.0), (-2.0, 0.0, 0.0), 0.0, (2.0, 0.0, 0.0))
PARTS = [
    Part("box", (0.2, 0.2, 1.0), (0.0, 1.5, 1.0), kind="pillar"),
    Part("box", (0.1, 2.0, 1.0), (2.0, 0.0, 1.0), kind="wall"),
]
TEXT = world_text(Found(parts=PARTS), ROOM_ENDS, "room")

SPELLINGS = {
    "a comment": TEXT.replace("<worldbody>", "<worldbody><!-- another world -->"),
    "another name": TEXT.replace('"room"', '"hall"').replace("pillar_0", "column"),
    "another colour": re.sub('rgba="[^"]*"', 'rgba="1 0 0 1"', TEXT),
    "other numbers": TEXT.replace('"0.2 0.2 1"', '"0.20000 2e-1 1.0000001"'),
    "another goal": TEXT.replace('wayproof_goal" data="2 0 0"', 'wayproof_goal" data="2 1 0"'),
    "another order": re.sub(r'( *<geom name="pillar.*\n)( *<geom name="wall.*\n)', r"\2\1", TEXT),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_a_copy_has_the_digest_of_its_world(name):
    assert SPELLINGS[name] != TEXT
    assert shape_digest(SPELLINGS[name]) == shape_digest(TEXT)


@pytest.mark.parametrize("pillar", ['"0.21 0.2 1"', '"0.2 0.2 2"'])
def test_another_world_has_another_digest(pillar):
    assert shape_digest(TEXT.replace('"0.2 0.2 1"', pillar)) != shape_digest(TEXT)


@pytest.mark.parametrize("name", [name for name in WORLDS if name != "hall"])
def test_a_generated_world_reads_back_from_its_file(name):
    world = drawn(name, 3)
    read = world_of(file_of(world))
    for field in ("low", "high", "start", "start_heading", "goal", "solid_names"):
        assert getattr(read, field) == getattr(world, field), field
    points = np.random.default_rng(0).uniform(world.low, world.high, (200, 3))
    for one, other in zip(read.solids, world.solids, strict=True):
        np.testing.assert_allclose(one.distance(points), other.distance(points), atol=1e-6)
    assert len(read.movers) == len(world.movers)
    for one, other in zip(read.movers, world.movers, strict=True):
        for moment in (0, 3_300_000_000, 41_000_000_000):
            np.testing.assert_allclose(one.place(moment).position, other.place(moment).position)
        for field in ("appears", "vanishes", "stands_off", "backs_up", "returns", "loops"):
            assert getattr(one, field) == getattr(other, field), field
