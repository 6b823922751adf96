import numpy as np
import pytest

from wayproof.harness.bench.micro import map_fields
from wayproof.harness.bench.micro.map_workload import Sweep


def test_every_way_is_timed_on_both_numbers_of_threads():
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sweeps = [
        Sweep(
            np.array([5.0 + k, 9.0, 1.5]),
            directions,
            rng.integers(500, 4000, 300).astype(np.uint16),
            np.ones(300),
            np.ones(300, np.int32),
        )
        for k in range(3)
    ]
    rows = list(map_fields.field_times(sweeps, 0.2, 3))
    ours = [row for row in rows if row.library == "wayproof"]
    assert len(ours) == 4  # updated and whole
    assert {row.threads for row in ours} == {1, 2}
    assert all(0.0 < row.ms <= row.ms_worst for row in rows)
    if map_fields.edt_installed():
        assert all(row.cells_differ == 0 for row in rows)
        peer = next(row for row in rows if row.library == "edt")
        assert peer.ratio_vs_edt == pytest.approx(1.0)
    else:
        assert all(row.ratio_vs_edt is None for row in rows)
