"""Perturbed episodes: only the declared stream changes, and their logs replay."""

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace as replace_struct

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.inputs import Pose, SweepInput
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.streams import compare
from wayproof.harness.perturbations import PERTURBATIONS, perturbation_from
from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.pose_jump import jump_time_ns
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.keyframe import read_filters
from wayproof.maps.echo_history import SILENT_SWEEPS
from wayproof.models.sensors.beams import DROPPED

UNFITTED = "map.filters=false_returns,lost_patches,lost_echoes,grazing"
"""Setting without the two that know the floor."""

SHELF_CLEARED = 5
"""Seed of a flight into a shelf that silent sweeps had cleared."""

JUMPS_AT_2_S = next(seed for seed in range(1000) if jump_time_ns(seed) < 2.5e9)


TEXTS = {
    "pose_drift:5": {"pose"},
    "pose_jump:3": {"pose"},
    "depth_dropout:3:ray": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "depth_noise:3": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "depth_scale:3": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "false_returns:3": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "occlusion:3": {"sensor/lidar"},
    "calibration:3": {"sensor/lidar"},
    "latency:3": {"latency"},
    "rate:3": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "motion:3": {"world", "sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "imu_bias:3": {"pose"},
    "imu_bias:3:gyroscope": {"pose"},
    "slip:4": {"world", "pose", "sensor/lidar"},
    "stale_prior:3": {"prior"},
    "sensor_stop:3": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "sensor_freeze:3:depth": {"sensor/depth"},
    "pose_stop:1": {"pose"},
    "pose_freeze:1": {"pose"},
    "clock_skew:2": {"sensor/lidar", "sensor/depth", "sensor/altimeter"},
    "clock_skew:2:pose": {"pose"},
    "out_of_order:4:lidar": {"sensor/lidar"},
    "stack_stall:2": {"latency"},
}

ROBOT = {"slip": "quadruped"}
"""Robot in place of the drone."""

WORLD = {"motion": "empty"}
"""World in place of the corridor, which has little room for people."""

SETTING = {
    "imu_bias": ["estimate.kind=lidar"],
    "slip": ["map.resolution=0.05"],
    "stale_prior": ["prior.source=truth"],
}
"""Settings that a perturbation needs, or that its robot does."""


SHORT = ["episode.time_limit=2.5", "map.resolution=0.2"]


def test_every_perturbation_is_paired_below():
    assert {text.split(":")[0] for text in TEXTS} == PERTURBATIONS.keys()


def early(perturbation):
    """An outage within a short episode, or another perturbation as it is."""
    outage = isinstance(perturbation, Outage)
    return replace_struct(perturbation, window=(1.0, 2.4)) if outage else perturbation


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """An episode's log unperturbed, and with each perturbation; three seconds in a corridor."""
    folder = tmp_path_factory.mktemp("pairs")
    logs = {}

    def record(text=None, like=""):
        kind = (text or like).split(":")[0]
        world, robot = WORLD.get(kind, "corridor"), ROBOT.get(kind, "drone")
        settings = (*SHORT, *SETTING.get(kind, []))
        key = (text, world, robot, settings)
        if key not in logs:
            config = override(Config(world, robot, JUMPS_AT_2_S), settings)
            if text is not None:
                config = replace(config, perturbation=early(perturbation_from(text)))
            logs[key] = folder / f"{len(logs)}.mcap"
            run_episode(build(config), logs[key])
        return logs[key]

    return record


@pytest.mark.few(8)
@pytest.mark.parametrize("text", TEXTS)
def test_only_the_declared_stream_changes_before_the_first_differing_action(pair, text):
    found = compare(pair(like=text), pair(text))
    assert found.changed <= TEXTS[text]
    assert found.first_change is not None
    assert found.compared > 0
    # A drift acts between two decisions, through the controller, before any decision sees it.
    assert found.changed or text.startswith(("pose_drift", "imu_bias"))
    done = [m for m in read_messages(pair(text)) if isinstance(m, pb.Perturbation)]
    assert {name for message in done for name in message.streams} == TEXTS[text]
    assert {message.kind for message in done} == {text.split(":")[0]}


@pytest.mark.few(3)
@pytest.mark.parametrize(
    "text",
    [
        *("pose_jump:3", "latency:3", "rate:3", "slip:4", "stale_prior:3", "clock_skew:2:pose"),
        *("sensor_freeze:3:depth", "pose_stop:1", "out_of_order:4:lidar", "stack_stall:2"),
    ],
)
def test_a_perturbed_episode_replays_from_its_log(pair, text):
    assert replay(pair(text)).identical


def test_the_same_run_twice_has_the_same_streams(pair, tmp_path):
    config = override(Config("corridor", "drone", JUMPS_AT_2_S), SHORT)
    again = tmp_path / "again.mcap"
    run_episode(build(config), again)
    found = compare(pair(), again)
    assert (found.changed, found.first_change, found.first_action) == (frozenset(), None, None)
    assert found.compared == 26
    assert not [m for m in read_messages(again) if isinstance(m, pb.Perturbation)]


def test_a_jump_is_in_the_pose_and_not_in_its_sigma(pair):
    log = pair("pose_jump:3")
    done = [m for m in read_messages(log) if isinstance(m, pb.Perturbation)]
    poses = [m for m in read_messages(log) if isinstance(m, pb.Pose)]
    usual = [m for m in read_messages(pair()) if isinstance(m, pb.Pose)]
    first = jump_time_ns(JUMPS_AT_2_S) // 10**8
    for k, message in enumerate(done):
        assert np.linalg.norm(message.pose_shift) == pytest.approx(0.3 * (k >= first), abs=2e-6)
        assert poses[k].position_sigma == usual[k].position_sigma
    moved = np.subtract(poses[first].position, usual[first].position)
    np.testing.assert_allclose(moved, done[first].pose_shift, atol=1e-9)


def test_people_change_what_sensors_see_only_where_they_are(pair):
    """Up to the first differing action every beam that changed ends on somebody."""
    found = compare(pair(like="motion"), pair("motion:3"))
    until = found.first_action if found.first_action is not None else 26
    truths = {m.sequence: m for m in read_messages(pair("motion:3")) if isinstance(m, pb.Truth)}
    infos = [m for m in read_messages(pair("motion:3")) if isinstance(m, pb.SensorInfo)]
    beams = {info.name: beams_from_info(info) for info in infos}
    changed = 0
    for sequence in range(until):
        truth = truths[sequence]
        pose = Pose(np.array(truth.position), np.array(truth.quaternion), 0.0)
        people = np.array([mover.position[:2] for mover in truth.movers])
        assert all(mover.present for mover in truth.movers)
        for name in ("lidar", "depth", "altimeter"):
            clean = sweep_of(pair(like="motion"), name, sequence)
            seen = sweep_of(pair("motion:3"), name, sequence)
            placed = beams[name].place(SweepInput(name, seen), pose, sequence)
            other = seen != clean
            changed += int(other.sum())
            reach = 1e-3 * seen[other, None]
            ends = placed.origins[0] + reach * placed.directions[other]
            gaps = np.linalg.norm(ends[:, None, :2] - people[None], axis=2).min(axis=1)
            assert (gaps < 0.3).all()  # 0.25 m thick
    assert changed > 20


def test_a_windowed_perturbation_acts_within_its_window_alone(tmp_path):
    """Sweeps before and after are those that the device reports."""
    usual = override(Config("empty", "drone", 1), ["episode.time_limit=0.6"])
    lossy = replace_struct(perturbation_from("depth_dropout:4"), window=(0.2, 0.4))
    logs = [tmp_path / "usual.mcap", tmp_path / "lossy.mcap"]
    for config, log in zip((usual, replace(usual, perturbation=lossy)), logs, strict=True):
        run_episode(build(config), log)
    done = [m for m in read_messages(logs[1]) if isinstance(m, pb.Perturbation)]
    assert [m.changed_beams > 0 for m in done[:6]] == [False, False, True, True, False, False]
    assert [m.amount for m in done[:6]] == [0.0, 0.0, 0.3, 0.3, 0.0, 0.0]
    assert compare(*logs).first_change == 2


def sweep_of(log, sensor, sequence):
    for message in read_messages(log):
        if isinstance(message, pb.Sweep) and (message.sensor, message.sequence) == (
            sensor, sequence,
        ):  # fmt: skip
            return decode_ranges(message)
    return None


def test_withheld_sweeps_are_not_in_the_log(pair):
    log = pair("rate:3")
    assert [sweep_of(log, "depth", k) is not None for k in range(7)] == [
        True, False, False, False, False, True, False,
    ]  # fmt: skip
    done = [m for m in read_messages(log) if isinstance(m, pb.Perturbation)]
    assert list(done[0].withheld) == []
    assert list(done[1].withheld) == ["lidar", "depth", "altimeter"]


def test_changed_beams_are_counted(pair):
    log = pair("depth_dropout:3:ray")
    counted = next(m for m in read_messages(log) if isinstance(m, pb.Perturbation)).changed_beams
    names = ("lidar", "depth", "altimeter")
    different = sum(
        int((sweep_of(log, name, 0) != sweep_of(pair(), name, 0)).sum()) for name in names
    )
    assert counted == different > 1000


def test_a_perturbation_does_not_shift_a_sensors_own_noise(tmp_path):
    """The echoes that dropout leaves are those of the unperturbed twin, noise and all."""
    config = override(
        Config("empty", "quadruped", 1), ["sensors.lidar=ouster-os1-64", "episode.time_limit=0.1"]
    )
    run_episode(build(config), tmp_path / "usual.mcap")
    lossy = replace(config, perturbation=perturbation_from("depth_dropout:4"))
    run_episode(build(lossy), tmp_path / "lossy.mcap")
    usual = sweep_of(tmp_path / "usual.mcap", "lidar", 0)
    kept = sweep_of(tmp_path / "lossy.mcap", "lidar", 0)
    lost = kept != usual
    assert (kept[lost] == DROPPED).all()
    assert lost.sum() / (usual != DROPPED).sum() == pytest.approx(0.3, abs=0.02)


def test_a_late_decision_takes_effect_late(tmp_path):
    """Asked for motion at time 0, the body starts 0.1 s later than the stack reckons."""
    exact = ["pose_model.bias_sigma=0", "pose_model.yaw_bias_sigma=0", "episode.time_limit=0.3"]
    usual = override(Config("corridor", "drone", JUMPS_AT_2_S), exact)
    late = replace(usual, perturbation=perturbation_from("latency:3"))
    moved = []
    for config in (usual, late):
        log = tmp_path / f"{len(moved)}.mcap"
        run_episode(build(config), log)
        messages = list(read_messages(log))
        truths = [m.position for m in messages if isinstance(m, pb.Truth)]
        moved.append(np.linalg.norm(np.subtract(truths[1], truths[0])))
        delays = {m.delay_s for m in messages if isinstance(m, pb.Latency)}
    assert list(delays) == pytest.approx([0.15])
    assert moved[0] > 1e-8  # m, after 0.05 s of a trajectory whose jerk is bounded
    assert moved[1] < 1e-12  # still hovering


def test_a_perturbed_log_names_what_is_off(pair):
    message = next(
        m for m in read_messages(pair("calibration:3")) if isinstance(m, pb.Perturbation)
    )
    assert (message.severity, message.exact_severity) == (3, 3.0)
    assert (message.amount, message.unit) == (1.0, "degrees")
    assert 2 * math.acos(message.displaced_quaternion[0]) == pytest.approx(math.radians(1.0))
    assert Path(pair("calibration:3")).exists()


def test_a_fitted_floor_bears_a_sensor_that_is_off(tmp_path):
    off = replace(Config("empty", "quadruped", 0), perturbation=perturbation_from("calibration:5"))
    result = run_episode(build(off), tmp_path / "off.mcap")
    assert result.outcome == "success", result.reason
    assert replay(tmp_path / "off.mcap").identical


@pytest.mark.large
def test_where_silence_says_nothing_lost_echoes_make_no_holes_in_the_floor(tmp_path):
    settings = [UNFITTED, "map.no_return=ignored"]
    config = override(Config("empty", "quadruped", 0), settings)
    lossy = replace(config, perturbation=perturbation_from("depth_dropout:3"))
    assert run_episode(build(lossy), tmp_path / "lossy.mcap").outcome == "success"


@pytest.mark.large
def test_floor_that_was_seen_is_no_hole_where_nothing_is_fitted(tmp_path):
    config = override(Config("empty", "quadruped", 0), [UNFITTED])
    lossy = replace(config, perturbation=perturbation_from("depth_dropout:3"))
    assert run_episode(build(lossy), tmp_path / "lossy.mcap").outcome == "success"


def run_lossy(path, world, robot, seed, perturbation, *settings):
    """Run an episode whose sensor loses echoes."""
    config = override(Config(world, robot, seed), settings)
    lossy = replace(config, perturbation=perturbation_from(perturbation))
    return run_episode(build(lossy), path)


def in_part_and_whole(test):
    """Run a test on the first seconds of an episode, and in `make test-all` on all of it."""
    limits = [("episode.time_limit=5", "timeout"), ("episode.time_limit=60", "success")]
    return pytest.mark.few(1)(pytest.mark.parametrize(("limit", "ends"), limits)(test))


@pytest.mark.few(1)
@pytest.mark.parametrize("text", ["pose_stop:3", "pose_freeze:3", "sensor_freeze:3"])
def test_the_drone_flies_on_after_its_streams_froze(tmp_path, text):
    """By a pose of 2 s ago its setpoint is 4 m on: it brakes along it, and jumps nowhere."""
    result = run_lossy(tmp_path / "late.mcap", "warehouse", "drone", 3, text)
    assert (result.outcome, result.collisions) == ("success", 0), result.reason
    assert result.min_clearance_m > 0.25


@in_part_and_whole
def test_echoes_lost_in_patches_do_not_stop_the_quadruped(tmp_path, limit, ends):
    """A tenth of each sweep is lost in one rectangle, of which the lower ones look like holes."""
    path, lossy = tmp_path / "lossy.mcap", "depth_dropout:3:patch"
    result = run_lossy(path, "warehouse", "quadruped", 0, lossy, "keyframe_period=1", limit)
    assert (result.outcome, result.path_length_m > 1.5) == (ends, True), result.reason
    maps = [one.map for one in open_log(path).keyframes() if one.HasField("map")]
    remembered = [read_filters(one)["missing_floor"] for one in maps]
    assert any(any(msgspec.msgpack.decode(one)[0]) for one in remembered)
    assert replay(path, jobs=2).identical


@in_part_and_whole
def test_sweeps_that_are_lost_whole_clear_no_shelf(tmp_path, limit, ends):
    """Six of ten sweeps are silent, so that walls are cleared more often than they are seen."""
    path, lossy = tmp_path / "lossy.mcap", "depth_dropout:5:sweep"
    seed = SHELF_CLEARED
    result = run_lossy(path, "warehouse", "drone", seed, lossy, "keyframe_period=1", limit)
    assert (result.outcome, result.path_length_m > 1.5) == (ends, True), result.reason
    maps = [one.map for one in open_log(path).keyframes() if one.HasField("map")]
    echoes = [msgspec.msgpack.decode(read_filters(one)["lost_patches"]) for one in maps]
    assert any(one["lidar"][1] < SILENT_SWEEPS for one in echoes)
    assert replay(path, jobs=2).identical


@pytest.mark.large
def test_lost_echoes_do_not_stop_the_quadruped_on_slopes(tmp_path):
    path, lossy = tmp_path / "lossy.mcap", "depth_dropout:1"
    result = run_lossy(path, "warehouse", "quadruped", 1, lossy, "costmap.max_slope=0.2")
    assert result.outcome == "success", result.reason
    assert replay(path).identical
