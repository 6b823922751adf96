"""Curves of an episode."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.curves import curves


def moment(sequence=1, clearance=0.4, height=0.0):
    turned = [math.cos(0.1), 0.0, 0.0, math.sin(0.1)]  # by 0.2 rad about z
    pose = SimpleNamespace(position=np.array([1.3, 2.4, height]), quaternion=np.array(turned))
    return SimpleNamespace(
        decision=pb.Decision(sequence=sequence, delay_s=0.6, localization_margin_m=0.2),
        truth=pb.Truth(
            position=[1.0, 2.0, 0.0],
            quaternion=[1.0, 0.0, 0.0, 0.0],
            velocity=[3.0, 4.0, 0.0],
            clearance_m=clearance,
        ),
        record=SimpleNamespace(inputs=SimpleNamespace(pose=pose)),
    )


def test_the_error_of_the_pose_is_that_of_the_axes_that_count():
    found = curves(moment(height=1.2), axes=2)
    assert found["pose/error_m"] == pytest.approx(0.5)
    assert curves(moment(height=1.2), axes=3)["pose/error_m"] == pytest.approx(1.3)
    assert found["pose/margin_m"] == pytest.approx(0.2)
    assert found["heading/error_deg"] == pytest.approx(math.degrees(0.2))
    assert found["speed/true_m_s"] == pytest.approx(5.0)


def test_the_first_decision_has_no_latency_that_would_flatten_the_others():
    first = curves(moment(sequence=0), axes=2)
    assert not [name for name in first if name.startswith(("latency/", "delay/"))]
    assert curves(moment(), axes=2)["delay/delay_ms"] == pytest.approx(600.0)


def test_without_a_truth_nothing_is_compared_with_it():
    found = curves(moment(clearance=math.nan), axes=2)
    assert not [name for name in found if name.startswith(("clearance/", "pose/", "heading/"))]
