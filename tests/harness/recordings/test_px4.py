"""PX4's own poses and distance sensors, from bags and from ULog."""

import numpy as np
import pytest

from tests.harness.recordings import flights
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.transform import Transform, compose


def from_room(recording):
    """Return how far each return is from the room, m."""
    away = []
    for sweep in recording.sweeps():
        position, quaternion = recording.track.at(np.array([sweep.time_ns]))
        placed = compose(
            compose(Transform(position[0], quaternion[0]), sweep.T_body_sensor),
            Transform(sweep.points.astype(float), np.tile([1.0, 0, 0, 0], (len(sweep.points), 1))),
        ).position
        away.append(np.abs(np.stack([placed - flights.LOW, flights.HIGH - placed])).min())
    return np.array(away)


@pytest.mark.parametrize(
    ("names", "orientation"),
    [
        *((("VehicleOdometry",), one) for one in flights.FACING),
        (("VehicleAttitude", "VehicleLocalPosition"), 6),
    ],
)
def test_the_returns_of_a_bag_lie_on_the_walls(tmp_path, names, orientation):
    recording = open_recording(flights.bag(names, orientation).write(tmp_path / "bag"))
    away = from_room(recording)
    assert len(away) >= 149
    assert away.max() < 1e-3
    assert recording.faults == {}


@pytest.mark.parametrize(
    "topics", [("vehicle_attitude", "vehicle_local_position"), ("vehicle_odometry",)]
)
def test_the_returns_of_a_ulog_lie_on_the_walls(tmp_path, topics):
    path = flights.ulog(tmp_path / "flight.ulg", topics, facing=(0, 25))
    sensors = ("distance_sensor", "distance_sensor_1")
    recording = open_recording(path, options=RecordingOptions(sensors=sensors))
    away = from_room(recording)
    assert len(away) >= 298
    assert away.max() < 1e-3
    with pytest.raises(InputError, match=r"several sensors, choose: distance_sensor \(Dist"):
        open_recording(path)


def test_a_local_position_without_attitude_is_said_to_be_taken_as_level(tmp_path):
    path = flights.ulog(tmp_path / "flight.ulg", ("vehicle_local_position",))
    assert "taken to be level: no VehicleAttitude" in open_recording(path).chosen
    bag = flights.bag(("VehicleLocalPosition",)).write(tmp_path / "bag")
    assert "taken to be level: no VehicleAttitude" in open_recording(bag).chosen


def test_invalid_estimates_and_jumps_are_counted(tmp_path):
    def changed(name, seconds):
        if name != "VehicleLocalPosition":
            return {}
        return {"xy_valid": seconds > 1.0, "xy_reset_counter": int(seconds > 2.0)}

    names = ("VehicleAttitude", "VehicleLocalPosition")
    recording = open_recording(flights.bag(names, changed=changed).write(tmp_path / "bag"))
    assert recording.faults == {"pose: jump of the estimator": 1, "pose: not finite": 51}


def test_signals_that_are_none_are_no_returns(tmp_path):
    def changed(name, seconds):
        if name != "DistanceSensor":
            return {}
        return {"signal_quality": 0} if seconds < 1.0 else {"max_distance": 1.0}

    recording = open_recording(flights.bag(changed=changed).write(tmp_path / "bag"))
    assert len(list(recording.sweeps())) == 0
    assert recording.faults == {"sweep: nothing measured": 150}


@pytest.mark.parametrize(
    ("name", "field", "value", "said"),
    [
        ("VehicleOdometry", "pose_frame", 0, "of the frame 0, expected NED or FRD"),
        ("DistanceSensor", "orientation", 30, "of the orientation 30"),
    ],
)
def test_what_has_no_meaning_is_said(tmp_path, name, field, value, said):
    made = flights.bag(changed=lambda one, _: {})
    made.messages = [
        one._replace(message=changed_field(one.message, field, value))
        if one.topic.endswith(name)
        else one
        for one in made.messages
    ]
    with pytest.raises(InputError) as caught:
        open_recording(made.write(tmp_path / "bag"))
    assert said in str(caught.value)


def changed_field(message, field, value):
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__}
    fields.pop("__msgtype__", None)
    return type(message)(**(fields | {field: value}))


@pytest.mark.parametrize("keep", [20, 200])
def test_a_ulog_without_its_data_is_one_line(tmp_path, keep):
    path = flights.ulog(tmp_path / "flight.ulg")
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InputError, match=r"^recording '[^\n]*$"):
        open_recording(path)


def test_a_ulog_that_was_cut_is_read_up_to_there(tmp_path):
    path = flights.ulog(tmp_path / "flight.ulg")
    path.write_bytes(path.read_bytes()[:6000])
    recording = open_recording(path)
    assert 0 < len(from_room(recording)) < 149
