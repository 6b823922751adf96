from copy import copy
from pathlib import Path

import numpy as np
import pytest

from tests.harness.recordings.bags.test_writing import KINDS, check_same
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.bags.writing import recording_messages, write_bag
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.transform import rotate
from wayproof.models.sensors.beams import NO_RETURN


@pytest.fixture(scope="module")
def episode(recorded):
    return Path(recorded("cylinders", "drone", 1, "episode.time_limit=2").log)


def test_sweeps_are_in_the_world_where_the_stack_placed_them(episode):
    log, recording = open_log(episode), open_recording(episode)
    assert recording.format == "wayproof"
    sweeps = {}
    for sweep in recording.sweeps():
        sweeps.setdefault(sweep.sensor, []).append(sweep)
    assert sorted(sweeps) == sorted(log.beams)
    assert all(sensor.missing_returns_known for sensor in recording.sensors)
    for k, record in enumerate(log.records()):
        for logged in record.inputs.sweeps:
            beams = copy(log.beams[logged.sensor])
            placed = beams.place(logged, record.inputs.pose, k)
            met = (placed.ranges_mm > 0) & (placed.ranges_mm < NO_RETURN)
            origins = placed.origins[placed.moments[met]]
            expected = origins + placed.directions[met] * (placed.ranges_mm[met, None] * 1e-3)
            sweep = sweeps[logged.sensor][k]
            position, quaternion = recording.track.at(np.array([sweep.time_ns]))
            mount = sweep.T_body_sensor
            in_body = mount.position + rotate(mount.quaternion, sweep.points.astype(float))
            ends = position[0] + rotate(quaternion[0], in_body)
            np.testing.assert_allclose(ends, expected, atol=2e-6)
            assert np.isinf(sweep.ranges).sum() == (placed.ranges_mm == NO_RETURN).sum()
            mm = placed.ranges_mm[met]
            assert np.array_equal(np.rint(sweep.ranges[: len(mm)].astype(float) * 1e3), mm)


def test_a_log_is_the_same_recording_from_a_bag(tmp_path, episode):
    kind = "sqlite"
    sensors = tuple(open_log(episode).beams)
    recording = open_recording(episode)
    write_bag(recording_messages(recording, kind), tmp_path / KINDS[kind], kind)
    options = RecordingOptions(sensors=sensors)
    check_same(recording, open_recording(tmp_path / KINDS[kind], options=options))


def test_a_sensor_that_there_is_none_of_is_refused(episode):
    with pytest.raises(InputError, match="unknown sensor of the recording 'x'"):
        open_recording(episode, options=RecordingOptions(sensors=("x",)))
