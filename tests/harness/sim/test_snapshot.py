"""Snapshots of an episode's parts, and their restoration."""

import mujoco
import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.sim.snapshot import PhysicsState, StepPoses, restore_parts, state_message

PENDULUM = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body pos="0 0 1">
      <freejoint/>
      <geom type="box" size=".1 .2 .3" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(PENDULUM)


class Counter:
    """A part with an integer and an array."""

    def __init__(self, count=0, values=()):
        self.count, self.values = count, np.array(values, np.float32)

    def state(self):
        return {"count": np.array(self.count, np.int64), "values": self.values}

    def restore(self, state):
        self.count, self.values = int(state["count"]), state["values"]


def step(model, data, count, saved=None):
    """Physics steps; the state before the last of them is saved, as before a decision."""
    for left in reversed(range(count)):
        if saved is not None and left == 0:
            saved.save()
        mujoco.mj_step(model, data)


def test_physics_continue_bit_by_bit_from_a_snapshot(model):
    data = mujoco.MjData(model)
    data.qvel[:] = [0.3, -0.2, 0.0, 1.0, 2.0, 3.0]
    physics = PhysicsState(model, data)
    step(model, data, 400, physics)  # by then it lies on the floor, in contact
    assert data.ncon > 0
    message = state_message({"simulation": physics}, 7)
    step(model, data, 50)
    other = mujoco.MjData(model)
    restored = PhysicsState(model, other)
    restore_parts({"simulation": restored}, message)
    step(model, other, 50)
    for name in ("qpos", "qvel", "qfrc_bias", "qacc"):
        assert getattr(other, name).tobytes() == getattr(data, name).tobytes()
    assert other.time == data.time


@pytest.mark.parametrize(
    ("values", "message"),
    [(np.zeros(3), "got .* numbers, expected"), (np.full(60, np.nan), "numbers")],
)
def test_a_physics_state_of_another_model_or_without_numbers_is_refused(model, values, message):
    physics = PhysicsState(model, mujoco.MjData(model))
    if not np.isfinite(values).all():
        values = np.full_like(physics.state()["integration"], np.nan)
    with pytest.raises(ValueError, match=message):
        physics.restore({"integration": values})


def test_parts_come_back_with_the_types_and_shapes_that_they_had():
    parts = {"first": Counter(3, [1.5, 2.5]), "second": Counter(-1, [])}
    message = state_message(parts, 4)
    assert message.sequence == 4
    assert [array.name for array in message.arrays] == [
        "first/count",
        "first/values",
        "second/count",
        "second/values",
    ]
    empty = {"first": Counter(), "second": Counter()}
    restore_parts(empty, message)
    assert (empty["first"].count, empty["second"].count) == (3, -1)
    np.testing.assert_array_equal(empty["first"].values, np.array([1.5, 2.5], np.float32))
    assert empty["first"].values.dtype == np.float32
    assert empty["second"].values.shape == (0,)


def test_a_missing_part_is_named():
    message = state_message({"first": Counter()}, 4)
    with pytest.raises(InputError, match=r"^state at decision 4: no second/count, expected a log"):
        restore_parts({"second": Counter()}, message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dtype": "|O"}, r"of type '\|O', expected one of <f8"),
        ({"shape": [3]}, r"of shape \(3,\) in 8 bytes"),
        ({"shape": [1 << 31]}, "of shape"),
        ({"shape": [1] * 9}, "of shape"),
    ],
)
def test_an_array_of_no_known_type_or_another_size_never_reaches_numpy(change, message):
    state = state_message({"first": Counter(3)}, 4)
    array = state.arrays[0]
    if "dtype" in change:
        array.dtype = change["dtype"]
    else:
        array.ClearField("shape")
        array.shape.extend(change["shape"])
    with pytest.raises(InputError, match=message):
        restore_parts({"first": Counter()}, state)


def test_the_latest_poses_of_a_decision_period_are_kept_and_restored():
    poses = StepPoses(3)
    for k in range(5):
        poses.append(np.full(7, float(k)))
    assert [pose[0] for pose in poses.poses] == [2.0, 3.0, 4.0]
    other = StepPoses(3)
    other.restore(poses.state())
    np.testing.assert_array_equal(other.poses, poses.poses)
    other.restore({})
    assert len(other.poses) == 0
    with pytest.raises(ValueError, match=r"got shape \(2, 6\), expected \(n, 7\)"):
        other.restore({"poses": np.zeros((2, 6))})
