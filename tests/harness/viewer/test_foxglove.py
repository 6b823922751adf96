"""Conversion for Foxglove, read with mcap's reader and the schemas in the file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.reader import make_reader

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.log.reader import open_log
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.foxglove import _entity
from wayproof.harness.viewer.layer import COLOURS
from wayproof.harness.viewer.scene import Artist
from wayproof.harness.viewer.true_scene import true_scene
from wayproof.maps import FREE, UNKNOWN
from wayproof.models.worlds import WORLDS

LAYOUT = Path(__file__).parents[3] / "docs/foxglove-layout.json"


@pytest.fixture(scope="module")
def log(recorded):
    return Path(recorded("empty", "drone", 1, "episode.time_limit=1").log)


@pytest.fixture(scope="module")
def converted(log, tmp_path_factory):
    out = tmp_path_factory.mktemp("foxglove") / "x.mcap"
    assert main(["export", str(log), "--foxglove", str(out)]) == 0
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return [(c.topic, s.name, m.log_time, decode(s, m)) for s, c, m in reader.iter_messages()]


def decode(schema, message):
    """A message by nothing but the descriptors that stand in the file."""
    assert schema.encoding == "protobuf"
    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool = descriptor_pool.DescriptorPool()
    for one in files.file:
        pool.Add(one)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    decoded = kind.FromString(message.data)
    assert decoded.SerializeToString(deterministic=True) == message.data
    return decoded


def of(converted, topic):
    return [message for name, _, _, message in converted if name == topic]


def test_each_topic_has_the_schema_that_a_viewer_knows(converted):
    assert {topic: schema for topic, schema, _, _ in converted} == {
        "/tf": "foxglove.FrameTransforms",
        "/viz/plan": "foxglove.SceneUpdate",
        "/viz/scene": "foxglove.SceneUpdate",
        "/viz/events": "foxglove.SceneUpdate",
        "/viz/layer": "foxglove.Grid",
        "/viz/age": "foxglove.Grid",
        "/viz/probability": "foxglove.Grid",
        "/viz/cells": "foxglove.PointCloud",
        "/viz/sweep": "foxglove.PointCloud",
        "/viz/reasons": "foxglove.Log",
        "/decision": "wayproof.Decision",
        "/truth": "wayproof.Truth",
        "/latency": "wayproof.Latency",
    }


def test_the_true_scene_comes_once_as_triangles(converted, log):
    (update,) = of(converted, "/viz/scene")
    (entity,) = update.entities
    assert entity.id == "scene/obstacles"
    points = np.array([[p.x, p.y, p.z] for p in entity.triangles[0].points])
    assert entity.triangles[0].color.a < 0.5
    expected = true_scene(open_log(log)).still["obstacles"].reshape(-1, 3)
    np.testing.assert_array_equal(points, expected)


def test_movers_move_and_absent_ones_have_no_surface(log):
    mjcf = build(Config("ghosts", "drone", 1)).scene.mjcf
    artist = Artist(replace(open_log(log), scene=mjcf))
    names = [mover.name for mover in WORLDS["ghosts"](1, 0.5).movers]
    movers = [
        pb.MoverPose(
            name=name, present=number > 0, position=[1.0, 2.0, number], quaternion=[1, 0, 0, 0]
        )
        for number, name in enumerate(names)
    ]
    shown = dict(artist.movers(pb.Truth(movers=movers)))
    assert shown.keys() == {f"scene/movers/{name}" for name in names}
    assert not shown[f"scene/movers/{names[0]}"].present
    assert not _entity("x", shown[f"scene/movers/{names[0]}"], Timestamp()).triangles
    (surface,) = _entity("x", shown[f"scene/movers/{names[2]}"], Timestamp()).triangles
    assert (surface.pose.position.x, surface.pose.position.z) == (1.0, 2.0)


def test_stops_are_marked_without_words_and_contacts_once(log):
    artist = Artist(open_log(log))
    stop = pb.Decision(action="stop_and_wait")
    there = pb.Truth(position=[1.0, 2.0, 3.0])
    hit = pb.Truth(position=[1.0, 2.0, 3.0], collisions=1)
    (first,), (second,) = (list(artist.marks(stop, truth)) for truth in (there, hit))
    assert not list(artist.marks(stop, hit))
    assert (first[0], second[0]) == ("events/stop", "events/contact")
    assert not first[1].words
    assert second[1].words == ["contact 1"]
    assert second[1].places.tolist() == [[1.0, 2.0, 3.0]]


def test_evidence_is_grey_where_the_layer_is_unknown(converted):
    layer, age = of(converted, "/viz/layer")[0], of(converted, "/viz/age")[0]

    def cells(grid):
        return np.frombuffer(grid.data, np.uint8).reshape(-1, grid.column_count, 4)[..., :3]

    unknown = (cells(layer) == COLOURS[UNKNOWN]).all(axis=2)
    grey = (cells(age) == COLOURS[UNKNOWN]).all(axis=2)
    np.testing.assert_array_equal(grey, unknown)


def test_decisions_are_those_of_the_log(converted, log):
    recorded = [one.SerializeToString(deterministic=True) for one in open_log(log).decisions()]
    parsed = [one.SerializeToString(deterministic=True) for one in of(converted, "/decision")]
    assert parsed == recorded
    times = [time_ns for _, _, time_ns, _ in converted]
    assert times == sorted(times)


def test_frames_are_the_believed_and_the_true_pose(converted):
    for frames, decision, truth in zip(
        of(converted, "/tf"), of(converted, "/decision"), of(converted, "/truth"), strict=True
    ):
        robot, true = frames.transforms
        assert (robot.parent_frame_id, robot.child_frame_id) == ("world", "robot")
        assert [robot.translation.x, robot.translation.y] == list(decision.position[:2])
        assert true.child_frame_id == "truth"
        assert true.rotation.w == truth.quaternion[0]


def test_the_layer_fits_the_world_and_is_free_about_the_start(converted, log):
    mission, grid = open_log(log).mission, of(converted, "/viz/layer")[0]
    cells = np.frombuffer(grid.data, np.uint8).reshape(-1, grid.column_count, 4)
    assert grid.row_stride == 4 * grid.column_count
    assert grid.cell_size.x * grid.column_count >= mission.high[0] - mission.low[0]
    x = int((mission.start[0] - grid.pose.position.x) / grid.cell_size.x)
    y = int((mission.start[1] - grid.pose.position.y) / grid.cell_size.y)
    assert tuple(cells[y, x, :3]) == COLOURS[FREE]


def test_the_failure_is_marked_at_the_end_alone(converted):
    marked = [
        entity.texts[0].text
        for update in of(converted, "/viz/plan")
        for entity in update.entities
        if entity.id == "failure"
    ]
    assert len(marked) == 1
    assert marked[0].startswith("timeout: ")


def test_the_layout_names_topics_that_there_are(converted):
    layout = json.loads(LAYOUT.read_text())
    topics = {topic for topic, _, _, _ in converted}
    panels = layout["configById"]
    assert set(panels["3D!space"]["topics"]) <= topics
    background = panels["3D!space"]["scene"]["backgroundColor"]
    assert background == "#{:02x}{:02x}{:02x}".format(*COLOURS[UNKNOWN])
    for name, panel in panels.items():
        for series in panel.get("paths", []):
            topic, *fields = series["value"].split(".")
            message = of(converted, topic)[0]
            for field in fields:
                assert field in message.DESCRIPTOR.fields_by_name, f"{name}: {series['value']}"
                message = getattr(message, field)


@pytest.mark.parametrize(
    ("out", "said"), [("x.txt", "a name that ends in .mcap"), (None, "got the log itself")]
)
def test_bad_names_are_a_line(capsys, log, out, said):
    before = log.read_bytes()
    assert main(["export", str(log), "--foxglove", out or str(log)]) == 2
    assert said in capsys.readouterr().err
    assert log.read_bytes() == before
