"""SDF worlds: poses, frames, states and included models."""

import numpy as np
import pytest

from tests.models.world_files.written import PILLAR, SDF, imported, one_ray, sdf, write
from wayproof.models.world_files import WorldFileError


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
