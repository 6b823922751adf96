from dataclasses import replace

import numpy as np
import pytest

from tests.harness.recordings.bags.making import Bag
from tests.harness.shadow.conftest import written
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.transform import mount_of
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.level import is_level
from wayproof.harness.shadow.prepare import prepare


@pytest.fixture
def recording(tmp_path):
    return open_recording(written(tmp_path / "ahead.clf", [(0.2 * k, 0.0, 0.0) for k in range(9)]))


def mounted(recording, mounts, fixed):
    """The recording with the mount of each sweep, the last one for all that follow."""
    (stream,) = recording.streams
    stamps = stream.stamps.tolist()
    places = {stamp: mounts[min(k, len(mounts) - 1)] for k, stamp in enumerate(stamps)}
    sensor = replace(stream.sensor, mount_is_fixed=fixed)
    return replace(recording, streams=(stream._replace(sensor=sensor, mount=places.get),))


def turned(pitch=0.0, roll=0.0, yaw=0.0):
    return mount_of([0.1, 0.0, 0.5, yaw, pitch, roll])


def test_a_plane_is_level_on_either_side_and_at_any_heading():
    for level in (turned(), turned(yaw=120.0), turned(roll=180.0), turned(pitch=2.9, yaw=40.0)):
        assert is_level(level)
    for tilted in (turned(pitch=-60.0), turned(roll=90.0), turned(pitch=3.1), turned(roll=-3.1)):
        assert not is_level(tilted)


@pytest.mark.parametrize(
    ("mounts", "fixed", "kind"),
    [
        ([turned()], True, "grid2d"),
        ([turned(yaw=90.0)], False, "grid2d"),
        ([turned(pitch=60.0)], True, "voxel"),
        ([turned(pitch=-60.0)], True, "voxel"),
        ([turned(), turned(), turned(), turned(pitch=10.0), turned()], False, "voxel"),  # it nods
    ],
)
def test_only_lasers_that_stay_level_have_a_map_of_columns(recording, robot, mounts, fixed, kind):
    prepared = prepare(mounted(recording, mounts, fixed), find_body(str(robot)))
    assert prepared.config.map.kind == kind
    assert len(prepared.planar) == (kind == "grid2d")
    asked = prepare(mounted(recording, mounts, fixed), find_body(str(robot)), ["map.kind=grid2d"])
    assert asked.config.map.kind == "grid2d"


def test_returns_of_a_tilted_laser_keep_their_heights(recording, robot):
    settings = ["estimate.kind=lidar"]
    level = prepare(recording, find_body(str(robot)), settings).config.estimate
    tilted = mounted(recording, [turned(pitch=60.0)], True)
    prepared = prepare(tilted, find_body(str(robot)), settings)
    assert prepared.planar == frozenset()
    assert prepared.config.estimate.spacing != level.spacing
    assert np.isclose(prepared.infos[0].rotation_base_sensor[8], 0.5)


@pytest.mark.parametrize(("topic", "kind"), [("/tf_static", "grid2d"), ("/tf", "voxel")])
def test_a_laser_that_nods_in_a_bag_is_read_to_its_end(tmp_path, robot, topic, kind):
    bag = Bag()
    bag.drive([10.0, 11.0])
    for stamp in (10.0, 10.5, 10.6, 11.0):
        pitch = 30.0 if topic == "/tf" and stamp == 10.6 else 0.0
        bag.tf("base_link", "laser", stamp, turned(pitch=pitch), topic)
    for stamp in (10.1, 10.2, 10.3, 10.4, 10.6, 10.8):
        bag.scan(stamp, [1.0, 2.0, 2.0, 2.0, 1.0])
    bag.write(tmp_path / "bag")
    opened = open_recording(tmp_path / "bag", options=RecordingOptions(body="base_link"))
    assert opened.sensors[0].mount_is_fixed == (topic == "/tf_static")
    assert prepare(opened, find_body(str(robot))).config.map.kind == kind
