"""Perturbations: their settings, and what each does to sweeps, poses and worlds."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace as replace_struct

from wayproof.harness.config import Config
from wayproof.harness.config_document import (
    from_document,
    from_json,
    override,
    to_json,
    with_perturbation,
)
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import Displacement, Report, perturbation_from
from wayproof.harness.perturbations.delivery import Delivery
from wayproof.harness.perturbations.latency import Latency
from wayproof.harness.perturbations.outage import EARLIEST, LATEST
from wayproof.harness.perturbations.perturbation import MOST_LAG, Arrival
from wayproof.harness.perturbations.pose_jump import jump_time_ns
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.models.poses import Trail, rotation_matrices
from wayproof.models.sensors.beams import DROPPED, NO_RETURN
from wayproof.models.sensors.devices import DEVICES
from wayproof.models.worlds import WORLDS


def report(name="ideal-lidar-floor", ranges=None, sequence=0, seed=1):
    device = DEVICES[name]
    table = device.beam_table()
    if ranges is None:
        ranges = np.full(table.beams, 5000, np.uint16)
    return Report("lidar", device, table, ranges, seed, sequence)


@pytest.mark.parametrize(
    ("perturbation", "said"),
    [
        ([{"kind": "rate", "severity": 1}, {"kind": "latency", "severity": 1}], "perturbation"),
        *(
            ({"kind": "latency", "severity": 1, "window": window}, "window")
            for window in ([3, 3], [-1, 2], [2, 1], [1])
        ),
        ({"kind": "slip", "severity": 1, "window": [1.0, 2.0]}, "expected none for 'slip'"),
    ],
)
def test_two_at_once_and_windows_without_a_length_are_refused(perturbation, said):
    base = {"world": "empty", "robot": "drone", "seed": 0}
    with pytest.raises(InputError, match=said):
        from_document({**base, "perturbation": perturbation})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("commotion:3", "did you mean 'motion'"),
        ("pose_drfit:3", "did you mean 'pose_drift'"),
        ("pose_drift", "expected pose_drift:SEVERITY"),
        ("pose_drift:3:ray", "expected pose_drift:SEVERITY"),
        ("depth_dropout:3:ray:ray", r"expected depth_dropout:SEVERITY:\[MODE\]"),
        ("pose_drift:6", "severity: got 6, expected above 0, up to 5"),
        ("pose_drift:0", "severity: got 0, expected above 0, up to 5"),
        ("pose_drift:much", "severity: got much, expected above 0, up to 5"),
        ("depth_dropout:3:row", "mode: Invalid enum value 'row'"),
    ],
)
def test_what_cannot_be_perturbed_is_told_in_one_line(text, said):
    with pytest.raises(InputError, match=said) as caught:
        perturbation_from(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "amount"),
    [
        ("pose_drift:3", 0.02),
        ("pose_drift:3.5", 0.04),  # half way from 0.02 to 0.06
        ("pose_drift:0.25", 0.00025),  # a quarter of the way from nothing to 0.001
        ("motion:2.5", 1.07),
        ("rate:0.5", 1.5),  # nothing is each sweep
    ],
)
def test_amounts_are_linear_from_one_severity_to_the_next(text, amount):
    perturbation = perturbation_from(text)
    assert perturbation.amount == pytest.approx(amount, abs=1e-12)


def test_a_perturbed_config_survives_its_log_and_a_whole_severity_is_written_in_one_way():
    base = Config("empty", "drone", 0)
    patchy = replace(base, perturbation=perturbation_from("depth_dropout:4:patch"))
    assert from_json(to_json(patchy)) == patchy
    assert patchy.perturbation.amount == 0.3
    assert override(patchy, ["perturbation=null"]) == base
    between, whole = (
        replace(base, perturbation=perturbation_from(text)) for text in ("rate:2.34375", "rate:2.0")
    )
    assert from_json(to_json(between)) == between
    assert to_json(whole) == to_json(replace(whole, perturbation=perturbation_from("rate:2")))


def test_a_scale_lengthens_echoes_alone():
    ranges = np.array([1000, 10990, 0, 65535], np.uint16)
    longer = perturbation_from("depth_scale:5").report(report(ranges=ranges))
    assert longer.tolist() == [1100, 65535, 0, 65535]  # 12.089 m lies beyond the range of 12
    real = perturbation_from("depth_scale:5").report(
        replace(report("intel-realsense-d435"), ranges_mm=np.array([2900, 1000], np.uint16))
    )
    assert real.tolist() == [0, 1100]  # to this device silence is no free space


def test_noise_has_its_standard_deviation_and_stays_in_the_devices_span():
    noisy = perturbation_from("depth_noise:4").report(report()).astype(int)
    assert noisy.mean() == pytest.approx(5000, abs=5)
    assert noisy.std() == pytest.approx(120, rel=0.05)
    near = np.full(20_000, 31, np.uint16)
    spread = perturbation_from("depth_noise:5").report(report(ranges=near))
    assert spread.min() >= 1
    silent = np.array([DROPPED, NO_RETURN])
    assert (perturbation_from("depth_noise:5").report(report(ranges=silent)) == silent).all()


def test_false_returns_come_before_a_beams_own_and_mostly_near():
    silent = np.full(20_000, NO_RETURN, np.uint16)
    rainy = perturbation_from("false_returns:5").report(report(ranges=silent)).astype(int)
    false = rainy[rainy != NO_RETURN]
    assert len(false) / len(rainy) == pytest.approx(0.1, rel=0.05)
    assert false.min() >= 500
    assert false.max() <= 10_000
    # Of a density that falls with the square from 0.5 to 10 m, half lie within 0.952 m.
    assert (false < 952).mean() == pytest.approx(0.5, abs=0.03)
    near = np.full(20_000, 600, np.uint16)
    before_walls = perturbation_from("false_returns:5").report(report(ranges=near))
    assert set(before_walls[before_walls != 600].tolist()) <= set(range(500, 600))
    assert (before_walls != 600).mean() == pytest.approx(0.1 * (1 - 5 / 6) / (1 - 0.05), rel=0.2)
    dropped = np.full(20_000, DROPPED, np.uint16)
    assert (perturbation_from("false_returns:5").report(report(ranges=dropped)) == DROPPED).all()


def test_a_device_reports_no_false_return_outside_its_span():
    short = replace(report("ouster-os1-64"), ranges_mm=np.full(65_536, 5000, np.uint16))
    rainy = perturbation_from("false_returns:4").report(short).astype(int)
    assert rainy[rainy != 5000].min() >= 800
    camera = replace(report("intel-realsense-d435"), ranges_mm=np.full(6360, NO_RETURN, np.uint16))
    seen = perturbation_from("false_returns:5").report(camera).astype(int)
    assert seen[seen != NO_RETURN].max() <= 3000


def test_rays_are_lost_one_by_one():
    kept = perturbation_from("depth_dropout:4").report(report())
    assert set(kept.tolist()) == {5000, 65535}
    assert (kept == 65535).mean() == pytest.approx(0.3, abs=0.02)
    other = perturbation_from("depth_dropout:4").report(report(sequence=1))
    assert (kept != other).any()


def test_a_patch_is_one_rectangle_of_its_share():
    image = perturbation_from("depth_dropout:4:patch").report(report()).reshape(32, 625)
    lost = image == 65535
    assert lost.mean() == pytest.approx(0.3, abs=0.01)
    rows, columns = lost.any(axis=1), lost.any(axis=0)
    assert (lost == rows[:, None] & columns[None]).all()
    assert np.abs(np.diff(columns.astype(int))).sum() <= 2  # one run, which may wrap round


def test_a_sweep_is_lost_as_a_whole():
    lost = [
        perturbation_from("depth_dropout:4:sweep").report(report(sequence=k)) for k in range(200)
    ]
    assert all(len(set(sweep.tolist())) == 1 for sweep in lost)
    assert np.mean([sweep[0] == 65535 for sweep in lost]) == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize(("severity", "degrees"), [(1, 10), (3, 60), (5, 240)])
def test_a_sector_is_blinded_the_same_in_each_sweep(severity, degrees):
    blocked = perturbation_from(f"occlusion:{severity}").report(report())
    share = (blocked.reshape(32, 625) == DROPPED).mean()
    assert share == pytest.approx(degrees / 360, abs=0.003)
    again = perturbation_from(f"occlusion:{severity}").report(report(sequence=9))
    assert (blocked == again).all()


def test_a_silent_sector_is_the_blind_one_and_loses_the_echoes_alone():
    given = report()
    blind = perturbation_from("occlusion:3").report(given) == DROPPED
    silent = perturbation_from("occlusion:3:silent").report(given)
    np.testing.assert_array_equal(silent[~blind], given.ranges_mm[~blind])
    np.testing.assert_array_equal(silent[blind & given.echoes], given.silence)
    np.testing.assert_array_equal(
        silent[blind & ~given.echoes], given.ranges_mm[blind & ~given.echoes]
    )
    assert (blind & given.echoes).any()


def quaternion(axis, angle):
    axis = np.array(axis) / np.linalg.norm(axis)
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])


def test_a_displaced_sensor_is_cast_from_where_it_truly_sits():
    """By site and by trail alike: T_world_base T_base_sensor D, multiplied out by matrices."""
    displacement = Displacement(np.array([0.1, -0.2, 0.3]), quaternion([1, 2, 3], 0.4))
    position, R = np.array([0.3, 0.1, 0.2]), rotation_matrices(quaternion([0, 1, 1], 0.6)[None])[0]
    base, turned = np.array([1.0, 2.0, 3.0]), quaternion([2, 0, 1], 0.9)
    R_world_base = rotation_matrices(turned[None])[0]
    stated = base + R_world_base @ position, R_world_base @ R
    true = stated[0] + stated[1] @ displacement.position, stated[1] @ displacement.R

    site, matrix = stated[0].copy(), stated[1].ravel().copy()
    displacement.move_site(site, matrix)
    np.testing.assert_allclose(site, true[0], atol=1e-12)
    np.testing.assert_allclose(matrix.reshape(3, 3), true[1], atol=1e-12)

    moved = displacement.move_trail(Trail(base[None], turned[None], 0.01), position, R)
    R_moved = rotation_matrices(moved.quaternions)[0]
    np.testing.assert_allclose(moved.positions[0] + R_moved @ position, true[0], atol=1e-12)
    np.testing.assert_allclose(R_moved @ R, true[1], atol=1e-12)


def test_a_calibration_error_is_of_its_size():
    turned = perturbation_from("calibration:4").displacement(3)
    assert 2 * math.acos(turned.quaternion[0]) == pytest.approx(math.radians(2.0))
    assert (turned.position == 0).all()
    shifted = perturbation_from("calibration:4:translation").displacement(3)
    assert np.linalg.norm(shifted.position) == pytest.approx(0.02)
    assert shifted.quaternion.tolist() == [1, 0, 0, 0]


def test_a_pose_drifts_with_the_distance_in_one_direction():
    drift = perturbation_from("pose_drift:3")
    errors = np.array([drift.pose_error(7, 0, metres).shift for metres in (0.0, 1.0, 10.0)])
    assert np.linalg.norm(errors, axis=1) == pytest.approx([0.0, 0.02, 0.2], abs=2e-6)
    assert errors[2] == pytest.approx(10 * errors[1], abs=1e-5)


def test_a_pose_jumps_once():
    jump = perturbation_from("pose_jump:3")
    for seed in range(20):
        at = jump_time_ns(seed)
        assert EARLIEST <= at * 1e-9 <= LATEST
        assert jump.pose_error(seed, at - 1, 5.0).shift == (0.0, 0.0, 0.0)
        assert np.linalg.norm(jump.pose_error(seed, at, 5.0).shift) == pytest.approx(0.3, abs=2e-6)


def test_inertial_sensors_have_a_bias_of_its_size_in_one_mode_each():
    accelerometer = perturbation_from("imu_bias:3").inertial_bias(3)
    assert np.linalg.norm(accelerometer.acceleration) == pytest.approx(0.02 * 9.81)
    assert accelerometer.turn_rate == 0.0
    gyroscope = perturbation_from("imu_bias:3:gyroscope").inertial_bias(3)
    assert abs(gyroscope.turn_rate) == 0.02
    assert (gyroscope.acceleration == 0.0).all()
    sides = {perturbation_from("imu_bias:3:gyroscope").inertial_bias(k).turn_rate for k in range(9)}
    assert sides == {-0.02, 0.02}


@pytest.mark.parametrize("world", ["warehouse", "construction"])
def test_only_the_floor_loses_friction(world):
    usual = WORLDS[world](3, 0.5)
    slippery = perturbation_from("slip:4").change_world(usual, 3)
    for mine, other in zip(geoms_of(slippery), geoms_of(usual), strict=True):
        floor = other.name.startswith("floor")
        assert other.friction[0] == 0.8
        assert mine.friction[0] == (0.3 if floor else 0.8)


def geoms_of(world):
    return mujoco.MjSpec.from_string(world.mjcf()).geoms


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        ("model", "imu_bias:3", "'imu_bias': estimate.kind: got 'model'"),
        ("lidar", "pose_jump:3", "'pose_jump': estimate.kind: got 'lidar'"),
    ],
)
def test_what_the_estimator_does_not_have_cannot_be_off(kind, text, said):
    config = override(Config("empty", "drone", 0), [f"estimate.kind={kind}"])
    with pytest.raises(InputError, match=said):
        with_perturbation(config, perturbation_from(text))


def test_every_nth_sweep_arrives():
    assert came("rate:3", 12) == [(k, 0) for k in (0, 5, 10)]
    assert came("rate:1.5", 12) == [(k, 0) for k in (0, 3, 5, 8, 10)]  # every 2.5th


def came(perturbation, count, kind=pb.Sweep, restore_at=None):
    """What comes of messages at 10 Hz: the number at which each was sent, and its stated age, s."""
    if isinstance(perturbation, str):
        perturbation = perturbation_from(perturbation)
    delivery, found = Delivery(perturbation, 3, 10**8), []
    for number in range(count):
        if number == restore_at:
            state = delivery.state()
            delivery = Delivery(perturbation, 3, 10**8)
            delivery.restore(state)
        sent = kind(sequence=number)
        if kind is pb.Sweep:
            sent.rows = number
        else:
            sent.position.append(number)
        sent.timestamp.FromNanoseconds(number * 10**8)
        one = delivery.take("lidar", sent)
        if one is not None:
            assert (one.sequence, one.timestamp) == (number, sent.timestamp)
            what = one.rows if kind is pb.Sweep else int(one.position[0])
            found.append((what, one.age_ns * 1e-9))
    return found


def from_1_to_2(text):
    return replace_struct(perturbation_from(text), window=(1.0, 2.0))


@pytest.mark.parametrize("restore_at", [None, 15])
def test_streams_stop_and_freeze_and_come_again(restore_at):
    before, after = [(k, 0) for k in range(10)], [(k, 0) for k in range(20, 25)]
    stopped = came(from_1_to_2("sensor_stop:4"), 25, restore_at=restore_at)
    assert stopped == before + after
    frozen = came(from_1_to_2("sensor_freeze:4"), 25, restore_at=restore_at)
    assert frozen == before + [(9, 0)] * 10 + after
    for text, old in (("pose_stop:4", True), ("pose_freeze:4", False)):
        poses = came(from_1_to_2(text), 25, pb.Pose, restore_at)
        ages = [pytest.approx(0.1 * (k + 1) * old) for k in range(10)]
        assert poses == before + [(9, age) for age in ages] + after


def test_an_outage_is_as_long_as_its_severity_says():
    assert came(from_1_to_2("sensor_stop:1"), 25) == [
        (k, 0) for k in range(25) if k not in (10, 11, 12)
    ]
    stop = perturbation_from("sensor_stop:3")
    begins = {stop.end_ns(seed, 10_000_000_000) for seed in range(30)}
    assert None in begins
    assert all(EARLIEST + 2.0 <= end * 1e-9 <= LATEST + 2.0 for end in begins - {None})


def test_a_skewed_clock_lies_and_late_sweeps_do_not():
    assert came("clock_skew:3", 8) == [(k, 0) for k in range(5)]
    late = came("out_of_order:5", 40)
    assert all(
        age == pytest.approx(0.1 * (k - what))
        for k, (what, age) in list(enumerate(late))[3:]
        if len(late) == 40
    )
    assert len({what for what, _ in late}) < len(late)
    assert max(age for _, age in late) == pytest.approx(0.3)


def test_a_stall_delays_what_falls_into_it():
    stall = replace_struct(perturbation_from("stack_stall:2"), window=(1.0, 5.0))
    delays = [stall.delay_at(0, time_ns * 10**8) for time_ns in (9, 10, 15, 20)]
    assert delays == [0.0, pytest.approx(1.0), pytest.approx(0.5), 0.0]


@pytest.mark.parametrize("kind", ["sensor_stop", "sensor_freeze", "out_of_order", "clock_skew"])
def test_one_sensor_of_several_can_be_meant(kind):
    both = ["lidar", "depth"]
    assert perturbation_from(f"{kind}:3:depth").affected(both) == ("depth",)
    assert perturbation_from(f"{kind}:3").affected(both) == ("lidar", "depth")
    with pytest.raises(InputError, match=r"'dpeth'.*did you mean 'depth'"):
        perturbation_from(f"{kind}:3:dpeth").affected(both)


def test_a_late_message_is_one_of_those_that_are_kept():
    arrival = Arrival("lidar", 5, 5 * 10**8, 10**8, 0)
    assert perturbation_from("clock_skew:5").lag_at(arrival) == 10
    assert perturbation_from("clock_skew:5:pose").affected(["lidar"]) == ()
    drifting = replace_struct(perturbation_from("clock_skew:2"), drift=0.2)
    assert [drifting.lag(arrival._replace(time_ns=k * 10**9)) for k in (0, 1, 5)] == [2, 4, 12]
    assert drifting.lag(arrival._replace(time_ns=10**12)) == MOST_LAG


def test_a_pose_error_is_confined_to_its_window_and_takes_the_direction_given():
    jump = type(perturbation_from("pose_jump:3"))(severity=3, window=(1.0, 2.0), direction=90.0)
    shifts = [jump.pose_error(7, round(t * 1e9), 5.0).shift for t in (0.999, 1.0, 1.999, 2.0)]
    assert shifts == [(0, 0, 0), (0, 0.3, 0), (0, 0.3, 0), (0, 0, 0)]


def test_people_walk_the_same_ways_at_every_severity():
    world = WORLDS["warehouse"](3, 0.5)
    slow, fast = (perturbation_from(f"motion:{one}").change_world(world, 3) for one in (1, 5))
    assert 1 <= len(slow.movers) <= 4
    assert [one.route for one in slow.movers] == [one.route for one in fast.movers]
    assert {one.speed for one in slow.movers} == {0.4}
    assert {one.speed for one in fast.movers} == {2.0}
    brief = replace_struct(perturbation_from("motion:1"), window=(2.0, 5.0))
    [*people] = brief.change_world(world, 3).movers
    assert {(one.appears, one.vanishes) for one in people} == {(2.0, 5.0)}


def test_where_nobody_can_walk_there_is_no_such_episode():
    config = replace(Config("corridor", "drone", 3), perturbation=perturbation_from("motion:3"))
    with pytest.raises(InputError, match="'motion': nobody finds a way"):
        build(config)


def test_a_delay_is_added_within_its_window_alone():
    scenario = build(Config("empty", "quadruped", 3))
    rate = scenario.scene.casters[0].mount.device.rate
    config = replace(scenario.config, perturbation=Latency(severity=4, window=(1.0, 2.0)))
    injector = PerturbationInjector(config, scenario.scene)
    delays = []
    for time_s in (0.5, 1.5, 2.5):
        injector.begin_decision(round(time_s * rate))
        delays.append(injector.delay)
    assert delays == [0.0, pytest.approx(0.15), 0.0]
