import numpy as np
import pytest

from wayproof.harness.recordings.transform import quaternion_of
from wayproof.models.poses import rotation_matrices


@pytest.mark.parametrize("axis", range(4))
def test_a_rotation_comes_back_whichever_component_is_greatest(axis):
    rng = np.random.default_rng(axis)
    quaternions = rng.normal(scale=0.2, size=(20, 4))
    quaternions[:, axis] += 1.0
    quaternions /= np.sqrt(np.square(quaternions).sum(axis=1))[:, None]
    for quaternion, R in zip(quaternions, rotation_matrices(quaternions), strict=True):
        found = quaternion_of(R)
        np.testing.assert_allclose(found * np.sign(found @ quaternion), quaternion, atol=1e-14)
