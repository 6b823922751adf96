"""Errors of ranges that a sweep shows itself: lost echoes, false returns, noise."""

from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.filters import Origin
from wayproof.harness.filters.false_returns import FalseReturns
from wayproof.harness.inputs import Beams, Pose, SweepInput
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.runner import open_episode, run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.maps import FREE
from wayproof.models.sensors.beams import BeamTable
from wayproof.models.worlds import Box

CONFIG = Config("warehouse", "drone", 3)
SETTINGS = ("motion.limits=full", "episode.time_limit=3")


def fly(path, perturbation, *settings):
    """Fly for three seconds; return the map at the end and the scenario."""
    config = override(Config("warehouse", "drone", 3), (*SETTINGS, *settings))
    config = replace(config, perturbation=perturbation_from(perturbation))
    scenario = build(config)
    with open_episode(scenario, path, None) as opened:
        opened.episode.run()
        opened.end()
        return opened.navigator.map, scenario


def free_within(a_map, scenario):
    """Share of the places in the middle of thin upright walls and level shelves that are free."""
    boxes = [one for one in scenario.world.solids if isinstance(one, Box)]
    places = [middle(one) for one in boxes if one.yaw == one.pitch == one.roll == 0.0]
    return float((a_map.state_at(np.concatenate(places)) == FREE).mean())


def middle(box):
    """Return places 10 cm apart in the middle plane of a box, across its least extent."""
    half = np.array(box.half_extents)
    axes = [np.arange(-h, h, 0.1) + 0.05 if h > half.min() else np.zeros(1) for h in half]
    return np.array(box.centre) + np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)


def top_speed(trajectory):
    return float(np.diff(trajectory.arc_length).max(initial=0.0)) / trajectory.sample_period_s


@pytest.mark.parametrize(
    ("perturbation", "most"), [("depth_dropout:5:patch", 0.35), ("depth_dropout:5:sweep", 0.3)]
)
def test_lost_echoes_clear_little_of_what_they_met(tmp_path, perturbation, most):
    assert free_within(*fly(tmp_path / "lossy.mcap", perturbation)) < most


@pytest.mark.parametrize(
    ("severity", "settings", "slow"),
    [(2, (), False), (4, (), True), (4, ("behaviour.noisy_sigma=0.2",), False)],
)
def test_noise_costs_speed_and_the_log_says_so(tmp_path, severity, settings, slow):
    path = tmp_path / "noisy.mcap"
    fly(path, f"depth_noise:{severity}", *settings, "episode.time_limit=2")
    decisions = list(open_log(path).decisions())
    stated = [one.predicate.range_sigma_m for one in decisions if one.action == "slow"]
    driven = [one for one in decisions if one.action in ("follow", "slow")]
    noisy = [one for one in driven if one.predicate.HasField("range_sigma_m")]
    assert len(noisy) == (len(driven) if slow else 0)
    if slow:
        assert stated == pytest.approx(len(stated) * [0.12], rel=0.1)
        assert all("slowed, as ranges deviate by 0.1" in one.reason for one in noisy)
    fastest = max(top_speed(one.trajectory) for one in driven)
    assert (fastest <= 2.001) == slow


def snow(severity, seconds, path):
    """Run the quadruped through falling snow."""
    config = override(Config("office", "quadruped", 0), [f"episode.time_limit={seconds}"])
    config = replace(config, perturbation=perturbation_from(f"false_returns:{severity}"))
    return run_episode(build(config), path)


def test_false_returns_stop_no_robot(tmp_path):
    """At 3 % of the beams, as in the heaviest snow."""
    ended = snow(4, 4, tmp_path / "snow.mcap")
    assert ended.path_length_m > 1.5
    assert ended.collisions == 0


@pytest.mark.large
def test_where_false_returns_stop_a_robot_they_are_the_cause(tmp_path):
    """At 10 % of the beams many have another beside them, and pass for a thing."""
    ended = snow(5, 30, tmp_path / "storm.mcap")
    assert (ended.outcome, ended.cause, ended.collisions) == ("aborted", "perception", 0)
    found = find_cause(read_case(open_log(tmp_path / "storm.mcap")))
    assert "of the returns were false, far before any surface" in found.evidence


def rainy_sweep(columns, rows=8):
    """A sensor with these columns (c, 2), cos and sin, and one of its sweeps in falling snow."""
    tilts = np.linspace(-0.2, 0.2, rows)
    rows_of = np.stack([np.cos(tilts), np.sin(tilts)], axis=1)
    table = BeamTable(rows_of, columns, len(columns) * rows)
    beams = Beams(table, 10.0, 10.0, np.zeros(3), np.eye(3))
    ranges = np.full((rows, len(columns)), 5000, np.uint16)
    ranges[1::3, 2::7] = 800
    pose = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 0.0)
    return beams, beams.place(SweepInput("lidar", ranges.ravel()), pose, 0)


def filtered(placed, beams):
    """A sweep without its false returns, which neither settings nor a map tell."""
    return FalseReturns(CONFIG, mission=None, a_map=None)(placed, Origin("lidar", beams, None, 0.0))


def test_the_range_of_false_returns_follows_from_the_distance_of_the_beams():
    for step, found in ((0.01, True), (0.07, True), (0.08, False)):  # 6 cm: at 6, 0.86, 0.75 m
        angles = step * np.arange(40)
        beams, placed = rainy_sweep(np.stack([np.cos(angles), np.sin(angles)], axis=1))
        assert beams.column_step == pytest.approx(step, rel=1e-3)
        kept = filtered(placed, beams)
        assert (kept.ranges_mm[placed.ranges_mm == 800] == (0 if found else 800)).all()
        assert (kept.ranges_mm[placed.ranges_mm == 5000] == 5000).all()
    beams, placed = rainy_sweep(np.tile([1.0, 0.0], (40, 1)))  # a table that repeats its column
    assert (filtered(placed, beams).ranges_mm[placed.ranges_mm == 800] == 0).all()
