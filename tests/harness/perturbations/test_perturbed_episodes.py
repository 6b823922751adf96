"""Perturbed episodes: only the declared stream changes, and their logs replay."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace as replace_struct

from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.inputs import Pose, SweepInput
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.streams import compare
from wayproof.harness.perturbations import PERTURBATIONS, perturbation_from
from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.pose_jump import jump_time_ns
from wayproof.harness.replay.replay import replay
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


def off(text, **fields):
    """The setting of a perturbation."""
    perturbation = replace_struct(perturbation_from(text), **fields)
    return f"perturbation={msgspec.json.encode(perturbation).decode()}"


@pytest.fixture
def pair(recorded):
    """An episode's log unperturbed, and with each perturbation; three seconds in a corridor."""

    def record(text=None, like=""):
        kind = (text or like).split(":")[0]
        world, robot = WORLD.get(kind, "corridor"), ROBOT.get(kind, "drone")
        settings = [*SHORT, *SETTING.get(kind, [])]
        if text is not None:
            outage = isinstance(perturbation_from(text), Outage)  # one within a short episode
            settings.append(off(text, **({"window": (1.0, 2.4)} if outage else {})))
        return Path(recorded(world, robot, JUMPS_AT_2_S, *settings).log)

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
    done = perturbed_in(pair(text))
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


def test_a_jump_is_in_the_pose_and_not_in_its_sigma(pair):
    log = pair("pose_jump:3")
    done = perturbed_in(log)
    poses = [m for m in read_messages(log) if isinstance(m, pb.Pose)]
    usual = [m for m in read_messages(pair()) if isinstance(m, pb.Pose)]
    first = jump_time_ns(JUMPS_AT_2_S) // 10**8
    for k, message in enumerate(done):
        assert np.linalg.norm(message.pose_shift) == pytest.approx(0.3 * (k >= first), abs=2e-6)
        assert poses[k].position_sigma == usual[k].position_sigma
    moved = np.subtract(poses[first].position, usual[first].position)
    np.testing.assert_allclose(moved, done[first].pose_shift, atol=1e-9)


def sweeps_of(log):
    """Ranges of each sweep of a log, mm, by sensor and sequence."""
    sweeps = (m for m in read_messages(log) if isinstance(m, pb.Sweep))
    return {(one.sensor, one.sequence): decode_ranges(one) for one in sweeps}


def perturbed_in(log):
    return [m for m in read_messages(log) if isinstance(m, pb.Perturbation)]


def test_people_change_what_sensors_see_only_where_they_are(pair):
    """Up to the first differing action every beam that changed ends on somebody."""
    found = compare(pair(like="motion"), pair("motion:3"))
    messages = list(read_messages(pair("motion:3")))
    truths = [m for m in messages if isinstance(m, pb.Truth)]
    beams = {m.name: beams_from_info(m) for m in messages if isinstance(m, pb.SensorInfo)}
    plain, peopled = sweeps_of(pair(like="motion")), sweeps_of(pair("motion:3"))
    changed = 0
    for truth in truths[: found.first_action]:
        pose = Pose(np.array(truth.position), np.array(truth.quaternion), 0.0)
        people = np.array([mover.position[:2] for mover in truth.movers])
        assert all(mover.present for mover in truth.movers)
        for name in ("lidar", "depth", "altimeter"):
            seen = peopled[name, truth.sequence]
            placed = beams[name].place(SweepInput(name, seen), pose, truth.sequence)
            other = seen != plain[name, truth.sequence]
            changed += int(other.sum())
            reach = 1e-3 * seen[other, None]
            ends = placed.origins[0] + reach * placed.directions[other]
            gaps = np.linalg.norm(ends[:, None, :2] - people[None], axis=2).min(axis=1)
            assert (gaps < 0.3).all()  # 0.25 m thick
    assert changed > 20


def test_a_windowed_perturbation_acts_within_its_window_alone(recorded):
    """Sweeps before and after are those that the device reports."""
    brief = "empty", "drone", 1, "episode.time_limit=0.6", "map.resolution=0.2"
    lossy = off("depth_dropout:4", window=(0.2, 0.4))
    logs = [Path(recorded(*brief, *one).log) for one in ((), (lossy,))]
    done = perturbed_in(logs[1])
    assert [m.changed_beams > 0 for m in done[:6]] == [False, False, True, True, False, False]
    assert [m.amount for m in done[:6]] == [0.0, 0.0, 0.3, 0.3, 0.0, 0.0]
    assert compare(*logs).first_change == 2


def test_withheld_sweeps_are_not_in_the_log_and_changed_beams_are_counted(pair):
    sweeps, done = sweeps_of(pair("rate:3")), perturbed_in(pair("rate:3"))
    assert [k for k in range(7) if ("depth", k) in sweeps] == [0, 5]
    assert list(done[0].withheld) == []
    assert list(done[1].withheld) == ["lidar", "depth", "altimeter"]
    usual, lossy = sweeps_of(pair()), sweeps_of(pair("depth_dropout:3:ray"))
    different = sum((lossy[key] != usual[key]).sum() for key in usual if key[1] == 0)
    assert perturbed_in(pair("depth_dropout:3:ray"))[0].changed_beams == different > 1000


def test_a_perturbation_does_not_shift_a_sensors_own_noise(recorded):
    """The echoes that dropout leaves are those of the unperturbed twin, noise and all."""
    brief = "empty", "quadruped", 1, "sensors.lidar=ouster-os1-64", "episode.time_limit=0.1"
    usual, kept = (
        sweeps_of(Path(recorded(*brief, *one).log))["lidar", 0]
        for one in ((), (off("depth_dropout:4"),))
    )
    lost = kept != usual
    assert (kept[lost] == DROPPED).all()
    assert lost.sum() / (usual != DROPPED).sum() == pytest.approx(0.3, abs=0.02)


def test_a_late_decision_takes_effect_late(recorded):
    """Asked for motion at time 0, the body starts 0.1 s later than the stack reckons."""
    exact = ["pose_model.bias_sigma=0", "pose_model.yaw_bias_sigma=0", "episode.time_limit=0.3"]
    moved = []
    for perturbed in ((), (off("latency:3"),)):
        log = recorded("corridor", "drone", JUMPS_AT_2_S, *exact, *perturbed).log
        messages = list(read_messages(Path(log)))
        truths = [m.position for m in messages if isinstance(m, pb.Truth)]
        moved.append(np.linalg.norm(np.subtract(truths[1], truths[0])))
        delays = {m.delay_s for m in messages if isinstance(m, pb.Latency)}
    assert list(delays) == pytest.approx([0.15])
    assert moved[0] > 1e-8  # m, after 0.05 s of a trajectory whose jerk is bounded
    assert moved[1] < 1e-12  # still hovering


def test_a_perturbed_log_names_what_is_off(pair):
    message = perturbed_in(pair("calibration:3"))[0]
    assert (message.severity, message.exact_severity) == (3, 3.0)
    assert (message.amount, message.unit) == (1.0, "degrees")
    assert 2 * math.acos(message.displaced_quaternion[0]) == pytest.approx(math.radians(1.0))


@pytest.mark.large
@pytest.mark.parametrize("settings", [[UNFITTED, "map.no_return=ignored"], [UNFITTED]])
def test_where_nothing_is_fitted_lost_echoes_make_no_holes_in_the_floor(recorded, settings):
    lossy = recorded("empty", "quadruped", 0, *settings, off("depth_dropout:3"))
    assert lossy.outcome == "success"


in_part_and_whole = pytest.mark.parametrize(
    ("limit", "ends"),
    [
        ("episode.time_limit=3", "timeout"),
        pytest.param("episode.time_limit=60", "success", marks=pytest.mark.large),
    ],
)


@pytest.mark.few(1)
@pytest.mark.parametrize("text", ["pose_stop:3", "pose_freeze:3", "sensor_freeze:3"])
def test_the_drone_flies_on_after_its_streams_froze(recorded, text):
    """By a pose of 2 s ago its setpoint is 4 m on: it brakes along it, and jumps nowhere."""
    result = recorded("warehouse", "drone", 3, off(text))
    assert (result.outcome, result.collisions) == ("success", 0), result.reason
    assert result.min_clearance_m > 0.25


@in_part_and_whole
def test_a_fitted_floor_bears_a_sensor_that_is_off(recorded, limit, ends):
    result = recorded("empty", "quadruped", 0, off("calibration:5"), limit)
    assert (result.outcome, result.path_length_m > 0.8) == (ends, True), result.reason


@in_part_and_whole
@pytest.mark.parametrize(
    ("robot", "seed", "text", "name", "remembers"),
    [
        # A tenth of each sweep is lost in one rectangle: the lower ones look like holes.
        ("quadruped", 0, "depth_dropout:3:patch", "missing_floor", lambda one: any(one[0])),
        # Six of ten sweeps are silent: walls are cleared more often than they are seen.
        ("drone", SHELF_CLEARED, "depth_dropout:5:sweep", "lost_patches",
         lambda one: one["lidar"][1] < SILENT_SWEEPS),
    ],
)  # fmt: skip
def test_lost_echoes_stop_no_robot_and_clear_no_shelf(
    recorded, robot, seed, text, name, remembers, limit, ends
):
    result = recorded("warehouse", robot, seed, "keyframe_period=1", off(text), limit)
    assert (result.outcome, result.path_length_m > 0.8) == (ends, True), result.reason
    log = open_log(Path(result.log))
    maps = [one.map for one in log.keyframes() if one.HasField("map")]
    assert any(remembers(msgspec.msgpack.decode(read_filters(one)[name])) for one in maps)
    assert replay(log.path, jobs=2).identical
