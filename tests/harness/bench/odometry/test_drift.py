"""Drift of odometries on the sweeps of an episode."""

import importlib.util

import numpy as np
import pytest

from wayproof import Config, build, override, run_episode
from wayproof.harness.bench.odometry.drift import measure
from wayproof.harness.bench.odometry.peers import PEERS, SmallGicp, imported
from wayproof.harness.bench.odometry.sweeps import read_sweeps
from wayproof.harness.errors import InputError


@pytest.fixture(scope="module", params=["own", "ouster-os1-64"])
def sweeps(request, tmp_path_factory):
    """Two seconds of an office: exact sweeps of one instant, or rolling noisy ones."""
    settings = (
        "estimate.kind=lidar",
        "episode.time_limit=2",
        f"sensors.lidar={request.param}",
    )
    path = tmp_path_factory.mktemp("sweeps") / "log.mcap"
    run_episode(build(override(Config("office", "drone", 2), settings)), path)
    return read_sweeps(path)


class Standing:
    """An odometry that says that the body stands still."""

    def register(self, points, ages):
        return np.eye(4)


class Diverged:
    """An odometry whose pose is no number."""

    def register(self, points, ages):
        return np.full((4, 4), np.nan)


def test_points_placed_by_the_truth_lie_on_the_first_ones(sweeps):
    assert len(sweeps.points) == len(sweeps.ages) == len(sweeps.truths) > 15
    for points, ages in zip(sweeps.points, sweeps.ages, strict=True):
        assert len(points) == len(ages) > 1000
        assert 0.0 <= ages.min() <= ages.max() <= 0.1
    first, last = sweeps.points[0], sweeps.points[-1]
    T = np.linalg.inv(sweeps.truths[0]) @ sweeps.truths[-1]
    moved = last @ T[:3, :3].T + T[:3, 3]
    for one in (first, moved):  # the body starts 1 m above the floor
        floor = one[one[:, 2] < -0.9, 2]
        assert len(floor) > 500
        assert np.median(floor) == pytest.approx(-1.0, abs=0.05)


def test_an_odometry_that_stands_is_off_by_the_whole_way(sweeps):
    found = measure(Standing(), sweeps)
    net = np.linalg.norm(sweeps.truths[-1, :3, 3] - sweeps.truths[0, :3, 3])
    assert found.end == pytest.approx(net)
    assert found.largest >= found.end > 0.3


def test_an_odometry_that_diverges_is_infinitely_off(sweeps):
    assert measure(Diverged(), sweeps).end == np.inf


@pytest.mark.skipif(not importlib.util.find_spec("small_gicp"), reason="extra 'estimators'")
def test_small_gicp_follows_the_body(sweeps):
    found = measure(SmallGicp(deskew=False), sweeps)
    assert found.end < 0.15 < found.way
    assert (found.seconds > 0.0).all()


def test_a_peer_that_is_not_installed_is_named():
    assert set(PEERS) == {"small_gicp", "kiss_icp", "genz_icp"}
    with pytest.raises(InputError, match="no_such_peer: not installed, expected the extra"):
        imported("no_such_peer.part")
