"""Classes end to end: from a geom's user data through sweep, log and replay to the costmap."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import decode_classes
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.maps.grid import centres
from wayproof.models.classes import CLASSES, class_of_geoms
from wayproof.models.worlds import WORLDS, Box

PLACE = np.array([5.0, 2.5])  # of a person, beside the straight way
SECONDS = "episode.time_limit=6"


def room(seed, difficulty, *_):
    """A room with a person in it; the way leads past."""
    bare = WORLDS["empty"](seed, difficulty)
    person = Box.between((*(PLACE - 0.25), 0.0), (*(PLACE + 0.25), 1.6), "person")
    return replace(
        bare,
        solids=(*bare.solids, person),
        start=(2.0, 1.9, 0.0),
        start_heading=0.0,
        goal=(8.0, 1.9, 0.0),
    )


@pytest.fixture(scope="module", autouse=True)
def labelled_world():
    WORLDS["labelled"] = room
    yield
    del WORLDS["labelled"]


def run(recorded, *settings):
    return recorded("labelled", "quadruped", 1, SECONDS, *settings)


def sweeps(result):
    return [m for m in read_messages(Path(result.log)) if isinstance(m, pb.Sweep)]


def test_the_class_of_a_geom_is_in_its_user_data():
    person = CLASSES.index("person")
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom size="1" user="{person} 7"/><geom size="1"/>'
        "</worldbody></mujoco>"
    )
    assert class_of_geoms(model).tolist() == [CLASSES.index("person"), 0]
    model.geom_user[1, 0] = 99
    with pytest.raises(
        ValueError, match=r"^geom '': got class 99 in its user data, expected a whole"
    ):
        class_of_geoms(model)
    bare = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>'
    )
    assert class_of_geoms(bare).tolist() == [0]


def test_classes_are_logged_and_voted_and_replayed(recorded):
    result = run(recorded, "sensors.semantics=true")
    log = open_log(Path(result.log))
    assert replay(Path(result.log)).identical
    navigator = build_navigator(log.config, log.mission, log.beams)
    for record in log.records():
        decision = navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        assert decision.map_version == record.decision.map_version
    layer = navigator.labels
    cells, labels = layer.labelled(np.ones(len(CLASSES), bool))
    middles = centres(cells, layer.resolution)
    person = np.abs(middles[:, :2] - PLACE).max(axis=1) < 0.35
    above = middles[:, 2] > 0.15
    assert (labels[person & above] == CLASSES.index("person")).all()
    assert (person & above).sum() > 20
    assert set(labels[~person].tolist()) == {CLASSES.index("floor"), CLASSES.index("wall")}
    assert (labels[~person & above] == CLASSES.index("wall")).all()


def test_off_changes_no_byte_of_a_sweep_and_no_decision(recorded):
    off, on = run(recorded), run(recorded, "sensors.semantics=true")
    without, labelled = sweeps(off), sweeps(on)
    assert len(without) == len(labelled) > 20
    for one, other in zip(without, labelled, strict=True):
        assert not one.classes
        other.ClearField("classes")
        assert one.SerializeToString() == other.SerializeToString()
    paths = [
        [(t.position[0], t.position[1]) for t in open_log(Path(r.log)).truth()] for r in (off, on)
    ]
    assert paths[0] == paths[1]
    assert off.chain != on.chain  # the version binds the labels
    log = open_log(Path(off.log))
    assert build_navigator(log.config, log.mission, log.beams).labels is None


def least_distance(result):
    track = np.array([list(t.position[:2]) for t in open_log(Path(result.log)).truth()])
    assert track[:, 0].max() > PLACE[0]  # it went past
    return np.linalg.norm(track - PLACE, axis=1).min()


def test_a_margin_keeps_farther_from_a_person(recorded):
    near = run(recorded, "sensors.semantics=true")
    settings = "sensors.semantics=true", 'costmap.class_margins={"person": 0.4}'
    far = run(recorded, *settings)
    assert far.collisions == near.collisions == 0
    assert least_distance(far) > least_distance(near) + 0.2


def test_strange_classes_and_margins_are_refused_in_one_line():
    sweep = pb.Sweep(rows=1, columns=2)
    assert decode_classes(sweep) is None
    for classes, message in (
        (b"\x01", "sweep of 1 classes, expected 2"),
        (b"\x01\x63", f"sweep with class 99, expected 0 to {len(CLASSES) - 1}"),
    ):
        sweep.classes = classes
        with pytest.raises(InputError, match=f"^{message}$"):
            decode_classes(sweep)
    config = Config("empty", "quadruped", 1)
    for settings, message in (
        (['costmap.class_margins={"person": 0.3}'], "expected sensors.semantics=true"),
        (
            ["sensors.semantics=true", 'costmap.class_margins={"ghost": 1}'],
            "got 'ghost', expected one",
        ),
        (["sensors.semantics=true", 'costmap.class_margins={"wall": 9}'], "expected 0 to 5 m"),
        (["costmap.class_margins=3"], "costmap.class_margins"),
    ):
        with pytest.raises(InputError, match=message) as refused:
            override(config, settings)
        assert "\n" not in str(refused.value)
    assert replace(config, seed=2).costmap.class_margins == {}
