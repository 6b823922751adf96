"""SDF worlds: poses, frames, states, included models; actors that walk by their scripts."""

import re
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from tests.models.world_files.written import PILLAR, SDF, imported, one_ray, sdf, write
from wayproof.models.world_files import ImportOptions, WorldFileError, movers, world_of
from wayproof.models.world_files.importer import import_world
from wayproof.models.world_files.movers import MAX_MOVERS
from wayproof.models.worlds.pedestrians import PERSON


def test_pillars_of_barn_stand_where_they_are_published(tmp_path):
    poses = ["1 0.5 0 0 0 0", "2 -0.525000 0 0 0 0"]
    world = imported(sdf(tmp_path, *(PILLAR.format(pose=pose) for pose in poses)))
    first, second = world.solids
    assert (first.tail, first.head, first.radius) == ((1.0, 0.5, -0.5), (1.0, 0.5, 0.5), 0.075)
    assert second.tail[:2] == (2.0, -0.525)
    assert one_ray(world, (0.0, 0.5, 0.4), (1.0, 0.0, 0.0)) == pytest.approx(0.925, abs=1e-12)
    assert one_ray(world, (0.0, 0.5, 0.6), (1.0, 0.0, 0.0)) == -1.0  # it looks over them


def test_poses_nest_and_frames_are_resolved(tmp_path):
    # A box 1 m ahead of a frame that stands at (1, 2) and is turned left: so at (1, 3).
    model = """<model name='m'><static>true</static><pose>0 2 0 0 0 0</pose>
      <frame name='f'><pose>1 0 0 0 0 1.5707963267948966</pose></frame>
      <link name='a'><pose relative_to='f'>1 0 0.5 0 0 0</pose>
        <collision name='c'><geometry><box><size>0.4 0.2 1</size></box></geometry></collision>
      </link>
      <link name='b'><pose relative_to='a'>1 0 0 0 0 0</pose>
        <collision name='c'><pose>0 0 1 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere>
        </geometry></collision></link></model>"""
    box, sphere = imported(sdf(tmp_path, model)).solids
    np.testing.assert_allclose(box.centre, (1.0, 3.0, 0.5), atol=1e-12)
    np.testing.assert_allclose(box.high[:2], (1.1, 3.2), atol=1e-12)
    np.testing.assert_allclose(sphere.centre, (1.0, 4.0, 1.5), atol=1e-12)


BOMB = "<!DOCTYPE b [<!ENTITY a 'ha'><!ENTITY c '&a;&a;&a;'>]>\n<sdf>&c;</sdf>"
GEOMETRY = (
    "<model name='m'><static>1</static>{pose}<link name='l'><collision name='c'><geometry>"
    "{shape}</geometry></collision></link></model>"
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, r":1: document type 'b'"),
        ("<sdf><world>", r":1: no XML"),
        ("<rope/>", r":1: <rope>: expected <sdf>"),
        ("<sdf><world/></sdf>", "nothing solid"),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<polyline/>")),
            r":5: <polyline>: got 0 corners, expected 3 to",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<rope/>")),
            r":5: <rope>: cannot be taken over \(available: box",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<box><size>1 1</size></box>")),
            r":5: <size>: got '1 1', expected 3 numbers",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="", shape="<box><size>1 1 0</size></box>")),
            r":5: <box>: box: got lengths",
        ),
        (
            SDF.format(models=GEOMETRY.format(pose="<pose relative_to='x'/>", shape="<plane/>")),
            r":5: <pose>: no frame 'x'",
        ),
        (
            SDF.format(
                models=GEOMETRY.format(pose="", shape="<mesh><uri>../../x.stl</uri></mesh>")
            ),
            r"no file '../../x.stl'",
        ),
        (SDF.format(models="<frame name='f'><pose relative_to='f'/></frame>"
                    + GEOMETRY.format(pose="<pose relative_to='f'/>", shape="<empty/>")),
         r"frames in a circle.*: f -> f"),
    ],
)  # fmt: skip
def test_what_cannot_be_taken_over_is_named(tmp_path, text, said):
    with pytest.raises(WorldFileError, match=said):
        imported(write(tmp_path, "some.world", text))


ENDS = {"start": (0.0, -3.0, 0.0), "goal": (6.0, -3.0, 0.0)}
SECOND = 1_000_000_000
GROUND = "<include><uri>model://ground_plane</uri></include>"
ACTOR = "<actor name='anna'><pose>1 2 1 0 0 0</pose>{}</actor>"
SCRIPT = "<script>{}<trajectory id='0' type='walk'>{}</trajectory></script>"


def points(*stops):
    return "".join(
        f"<waypoint><time>{time}</time><pose>{x} {y} {z} 0 0 1</pose></waypoint>"
        for time, x, y, z in stops
    )


SQUARE = [(0, 0, 0, 1), (4, 4, 0, 1), (5, 4, 0, 1), (8, 4, 3, 1), (12, 0, 0, 1)]
"""Time, s, and place, m: 4 m in 4 s, a stop of 1 s, 3 m in 3 s, 5 m in 4 s back to the start."""


def read(folder, *actors, ground=GROUND):
    path = folder / "a.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>{ground}{''.join(actors)}</world></sdf>")
    return import_world(path, ImportOptions(), **ENDS)


def walking(stops, options=""):
    return ACTOR.format(SCRIPT.format(options, points(*stops)))


def test_an_actor_is_where_its_script_says_when_it_says(tmp_path):
    world, notes = read(tmp_path, walking(SQUARE))
    (anna,) = world.movers
    (body,), (person,) = anna.solids, PERSON
    assert body.kind == "person"
    np.testing.assert_allclose([body.low, body.high], [person.low, person.high])
    for seconds, x, y, heading in (
        (0, 0.0, 0.0, 0.0), (3, 3.0, 0.0, 0.0), (4.5, 4.0, 0.0, 0.0), (6, 4.0, 1.0, pi / 2),
        (10, 2.0, 1.5, -pi + 0.6435), (12, 0.0, 0.0, 0.0), (15, 3.0, 0.0, 0.0),
    ):  # fmt: skip
        place = anna.place(round(seconds * SECOND))
        assert place.position == pytest.approx((x, y, 0.0))
        assert place.heading == pytest.approx(heading, abs=1e-4)
    assert "<actor> 'anna' (line 1): a person that walks 12.0 m round" in notes


def test_a_world_file_holds_the_actors_to_the_last_bit(tmp_path):
    stops = [(0, 0.1, 0.2, 1), (1 / 3, 1.7, 2 / 7, 1), (9.1, 0.3, 0.2, 1)]
    world, _ = read(tmp_path, walking(stops), walking(SQUARE, "<loop>0</loop>"), ACTOR.format(""))
    again = world_of(world.text)
    assert again.movers == world.movers
    assert [mover.name for mover in again.movers] == ["actor_0", "actor_1", "actor_2"]
    assert again.identity == world.identity
    (tmp_path / "saved.xml").write_text(world.text)
    once_more, notes = import_world(tmp_path / "saved.xml")
    for mover, before in zip(once_more.movers, world.movers, strict=True):
        assert replace(mover, solids=before.solids) == before
    assert not [note for note in notes if "stand still" in note]


def test_a_way_that_does_not_close_is_walked_to_and_fro(tmp_path):
    world, notes = read(tmp_path, walking(SQUARE[:4]))
    (anna,) = world.movers
    there, back = anna.place(7 * SECOND), anna.place(9 * SECOND)
    assert there.position == back.position == pytest.approx((4.0, 2.0, 0.0))
    assert (there.heading, back.heading) == pytest.approx((pi / 2, -pi / 2))
    assert any(note.endswith("walks 7.0 m to and fro") for note in notes)


def test_a_script_that_does_not_loop_ends(tmp_path):
    world, notes = read(tmp_path, walking(SQUARE[:4], "<loop>false</loop>"))
    assert world.movers[0].place(99 * SECOND).position == (4.0, 3.0, 0.0)
    assert any(note.endswith("walks 7.0 m once") for note in notes)


def test_a_script_begins_at_the_pose_and_waits(tmp_path):
    """Until 2 s at (1, 2), then 2 s to (3, 2)."""
    options = "<loop>0</loop><delay_start>1</delay_start>"
    world, _ = read(tmp_path, walking([(2, 3, 2, 1)], options))
    (anna,) = world.movers
    at = [anna.place(round(seconds * SECOND)).position[0] for seconds in (0, 1, 2, 3)]
    assert at == pytest.approx([1.0, 1.0, 2.0, 3.0])


def test_trajectories_follow_one_another_by_their_numbers(tmp_path):
    second = f"<trajectory id='1'>{points((0, 4, 0, 1), (2, 4, 2, 1))}</trajectory>"
    first = f"<trajectory id='0'>{points((0, 0, 0, 1), (4, 4, 0, 1))}</trajectory>"
    actor = ACTOR.format(f"<script><loop>0</loop>{second}{first}</script>")
    world, _ = read(tmp_path, actor)
    assert world.movers[0].place(5 * SECOND).position == pytest.approx((4.0, 1.0, 0.0))


@pytest.mark.parametrize("content", [
    "", "<plugin name='walks' filename='libwalks.so'/>",
    SCRIPT.format("<auto_start>false</auto_start>", points(*SQUARE)),
    SCRIPT.format("", points((0, 1, 2, 1), (9, 1, 2, 1))),
])  # fmt: skip
def test_an_actor_without_a_way_stands_at_its_pose(tmp_path, content):
    world, notes = read(tmp_path, ACTOR.format(content))
    assert world.movers[0].route == ((1.0, 2.0, 0.0),)
    assert "<actor> 'anna' (line 1): stands there" in notes


def test_start_and_goal_keep_away_from_where_people_begin(tmp_path):
    walls = "".join(
        f"<model name='wall'><static>1</static><pose>{at} 0 0 0</pose><link name='l'><collision "
        f"name='c'><geometry><box><size>{size}</size></box></geometry></collision></link></model>"
        for at, size in (("0 4 1", "12 .2 2"), ("0 -4 1", "12 .2 2"), ("6 0 1", ".2 8 2"),
                         ("-6 0 1", ".2 8 2"))
    )  # fmt: skip
    path = tmp_path / "a.world"
    text = f"<sdf version='1.6'><world name='w'>{GROUND}{walls}{{}}</world></sdf>"
    path.write_text(text.format(""))
    empty, _ = import_world(path)
    x, y, _ = empty.start
    path.write_text(text.format(f"<actor name='a'><pose>{x} {y} 1 0 0 0</pose></actor>"))
    peopled, _ = import_world(path)
    assert min(abs(peopled.start[0] - x) + abs(peopled.start[1] - y),
               abs(peopled.goal[0] - x) + abs(peopled.goal[1] - y)) > 0.7  # fmt: skip


def test_actors_on_another_floor_are_left_out_and_noted(tmp_path):
    upstairs = ACTOR.format("").replace("1 2 1", "1 2 4")
    world, notes = read(tmp_path, upstairs, ACTOR.format(""))
    assert len(world.movers) == 1
    assert "1 actors that are not on this floor: left out" in notes


@pytest.mark.parametrize(("actors", "said"), [
    ([walking([(0, 0, 0, 1), (0, 1, 0, 1)])], "<time>: got 0, expected more than that of"),
    ([walking([(0, 0, 0, 1), ("nan", 1, 0, 1)])], "<time>: got 'nan', expected a number"),
    ([walking([(-1, 0, 0, 1), (2, 1, 0, 1)])], "<time>: got -1, expected"),
    ([walking([(0, "inf", 0, 1)])], "<pose>: got 'inf 0 1 0 0 1', expected 6 numbers"),
    ([ACTOR.format(SCRIPT.format("", "<waypoint/>"))], "<waypoint>: expected <time> and <pose>"),
    ([walking(SQUARE, "<delay_start>-1</delay_start>")], "<delay_start>: expected 0 or more"),
    ([walking(SQUARE, "<delay_start>1e300</delay_start>")], "<script>: times: expected one for"),
    ([ACTOR.format("")] * (MAX_MOVERS + 1), f"{MAX_MOVERS + 1} movers with"),
    ([walking([(n, n % 7, 0, 1) for n in range(20_001)])], "20001 waypoints, expected at most"),
    ([walking([(n, n % 7, 0, 1) for n in range(400)])] * 2, "2 movers with 800 points"),
])  # fmt: skip
def test_what_is_no_script_is_refused_with_its_line(tmp_path, monkeypatch, actors, said):
    monkeypatch.setattr(movers, "MAX_POINTS", 600)
    with pytest.raises(WorldFileError, match=r"a\.world:1: .*" + re.escape(said)):
        read(tmp_path, *actors)


@pytest.mark.parametrize(("old", "new"), [
    ('"route": [[', '"route": [[' + "[" * 100_000),
    ("[1.0, 2.0, 0.0]", "[1.0, 2.0]"),
    ("[1.0, 2.0, 0.0]", "[1.0, 2.0, NaN]"),
    ("[1.0, 2.0, 0.0]", "[1.0, 2.0, 1e999]"),
    ('body name="actor_0" mocap="true"', 'body name="actor_0"'),
    ('body name="actor_0"', 'body name="someone"'),
    ('"times": []', '"times": [5.0]'),
])  # fmt: skip
def test_a_world_file_with_another_mover_is_refused_in_one_line(tmp_path, old, new):
    world, _ = read(tmp_path, ACTOR.format(""))
    assert old in world.text
    with pytest.raises(WorldFileError, match=r"mover 'actor_0': ") as caught:
        world_of(world.text.replace(old, new), "a.xml")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
