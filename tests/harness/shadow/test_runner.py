"""Recordings shadowed: logs that replay, decisions as the recording allows, and a page."""

import base64
import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from tests.harness.recordings.bags.making import Bag, at
from tests.harness.shadow.conftest import FR079, shadowed, written
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.metrics import OF_TRUTH, score
from wayproof.harness.recompute.moments import SegmentedStack, segments_of
from wayproof.harness.recordings.bags.writing import recording_messages, write_bag
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.verify import verify
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.page import write_page
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.summary import summarize
from wayproof.harness.trace import read_trace
from wayproof.maps import OCCUPIED, states_in


def test_its_log_replays_and_audits_and_verifies_without_truth(fr079_log):
    log = open_log(fr079_log)
    assert contradictions(log) == []
    assert replay(fr079_log).identical
    assert audit(fr079_log).violations == ()
    assert verify(fr079_log).verified
    assert list(log.truth()) == []


def test_its_metrics_of_truth_are_absent_and_not_zero(fr079_log):
    scores = score(read_trace(open_log(fr079_log)))
    assert all(scores[name] is None for name in OF_TRUTH)
    assert scores["path_length"] > 4.0
    assert scores["latency_p50"] > 0.0


def test_decisions_start_from_rest_where_the_robot_really_was(fr079_log):
    for record in open_log(fr079_log).records():
        path = record.decision.trajectory.path[0]
        believed = record.decision.position
        assert np.hypot(path.x - believed[0], path.y - believed[1]) < 1e-6
        assert record.inputs.goal is not None


def test_goals_are_places_that_the_robot_reached_later(fr079_log):
    log = open_log(fr079_log)
    places = np.array([motion.position for motion in log.motions()])
    records = list(log.records())
    goals = {tuple(record.inputs.goal.tolist()) for record in records}
    assert 1 <= len(goals) <= 3
    np.testing.assert_allclose(records[-1].inputs.goal, places[-1], atol=0.2)


def test_a_changed_result_is_a_contradiction(fr079_log):
    log = open_log(fr079_log)
    forged = replace(log, result={**log.result, "path_length_m": "1.0"})
    assert [one.field for one in contradictions(forged)][:1] == ["result.path_length_m"]


def test_the_stack_is_stopped_by_no_earlier_command(robot, tmp_path):
    poses = [(0.4 * k, 0.3 if k % 2 else -0.3, 0.0) for k in range(12)]  # it jumps about
    log = shadowed(written(tmp_path / "zigzag.clf", poses), robot, tmp_path / "zigzag.mcap")
    actions = [decision.action for decision in open_log(log).decisions()]
    assert "stop_and_wait" not in actions[2:8]


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"settings": ["map.resolution=7"]}, "map.resolution"),
        ({"settings": ["recording.goal=sideways"]}, "recording.goal"),
        ({"stack": "exec:true"}, "other processes"),
    ],
)
def test_bad_settings_are_one_line(robot, tmp_path, asked, text):
    with pytest.raises(InputError, match=text):
        shadowed(FR079, robot, tmp_path / "no.mcap", end=1.0, **asked)


def test_clocks_of_sweeps_and_poses_that_never_meet_are_named(robot, tmp_path):
    bag = Bag()
    bag.tf("base_link", "laser", 0.0, at(), "/tf_static")
    bag.drive([10.0, 10.5, 11.0])
    for stamp in (5000.0, 5000.1):
        bag.scan(stamp, [1.0])
    said = r"\(2 sweep: no pose at its time; poses from 10.000 s on, for 1.000 s\)"
    with pytest.raises(InputError, match=said):
        shadowed(bag.write(tmp_path / "bag"), robot, tmp_path / "log.mcap")
    with pytest.raises(InputError, match="none between the times chosen"):
        shadowed(tmp_path / "bag", robot, tmp_path / "log.mcap", end=1.0)


def test_a_reference_stack_is_judged_on_a_recording(robot, tmp_path):
    log = shadowed(FR079, robot, tmp_path / "gap.mcap", end=3.0, stack="gap")
    assert replay(log).identical
    trace = read_trace(open_log(log))
    assert set(trace.verdicts) <= {"admitted", "unknown", "blocked"}
    assert asdict(open_log(log).config.recording)["goal"] == "end"


@pytest.fixture(scope="module")
def simulated(recorded, tmp_path_factory):
    """Log of a walking robot, that log as a bag, and the logs of both as recordings."""
    folder = tmp_path_factory.mktemp("simulated")
    episode = Path(recorded("corridor", "quadruped", 1, "episode.time_limit=3").log)
    opened = open_recording(episode)
    write_bag(recording_messages(opened, "mcap"), folder / "bag", "mcap")
    sources = episode, folder / "bag"
    logs = [shadowed(one, "quadruped", folder / f"{k}.mcap") for k, one in enumerate(sources)]
    return episode, *logs


def test_a_simulated_log_and_its_bag_give_the_same_decisions(simulated):
    _, direct, by_bag = (open_log(log) for log in simulated)
    assert direct.result["chain"] == by_bag.result["chain"]
    versions = [[one.map_version for one in log.decisions()] for log in (direct, by_bag)]
    assert len(versions[0]) > 10
    assert versions[0] == versions[1]
    share = summarize(assess(direct.path)).admitted_share
    assert share == summarize(assess(by_bag.path)).admitted_share == 1.0


def test_the_maps_of_a_recording_of_a_simulated_log_are_its_own(simulated):
    episode, _, by_bag = (open_log(log) for log in simulated)
    assert by_bag.config.recording.origin == (0.0, 0.0, 0.0)
    maps = []
    for log in (episode, by_bag):
        stack = SegmentedStack(segments_of(log))
        for record in log.records():
            navigator = stack.watch(record.inputs)
        maps.append(navigator.map)
    (x, y, z), (far_x, far_y, _) = episode.mission.low, episode.mission.high
    top = by_bag.mission.high[2] - by_bag.config.map.resolution
    own, made = (states_in(one, (x, y, z), (far_x, far_y, top)) for one in maps)
    assert (own == OCCUPIED).sum() > 500
    assert (own == made).mean() > 0.9999


def test_settings_of_the_recording_are_set(robot, tmp_path):
    log = shadowed(FR079, robot, tmp_path / "set.mcap", ["recording.goal=end"], end=1.0)
    assert open_log(log).config.recording.goal == "end"
    for setting in ("recording.sha256=x", "recording.no=1"):
        with pytest.raises(InputError, match="unknown setting"):
            shadowed(FR079, robot, tmp_path / "no.mcap", [setting], end=1.0)


def test_what_a_recording_was_read_with_is_in_its_config(fr079_log, robot, tmp_path):
    assert open_log(fr079_log).config.recording.options == ("end=12.0",)
    recording = open_recording(FR079, options=RecordingOptions(end=1.0, mount=(0.25, 0.0, 0.5)))
    config = prepare(recording, find_body(str(robot))).config
    mount = "mount=0.25,0.0,0.5"
    assert config.recording.options == ("end=1.0", mount)
    with pytest.raises(InputError, match=r"recording\.options"):
        prepare(recording, find_body(str(robot)), ["recording.options=x"])


def test_the_page_of_a_recording_holds_its_picture_and_its_verdict(fr079_log, tmp_path):
    out = tmp_path / "page.html"
    summary = write_page(fr079_log, out)
    text = out.read_text()
    assert summary.verdict in text
    assert summary.chain in text
    picture = re.search(r"base64,([^\"]+)", text)[1]
    assert base64.b64decode(picture).startswith(b"\x89PNG")
    assert "http" not in text  # it is one file


def test_report_takes_the_log_of_a_recording(fr079_log, capsys):
    assert main(["report", str(fr079_log)]) == 0
    assert "page: " in capsys.readouterr().out
    assert fr079_log.with_suffix(".html").exists()
