"""Tables of a log against its messages, and files against what a reader finds in them."""

import math
from pathlib import Path

import numpy as np
import pyarrow.csv as csv
import pyarrow.parquet as pq
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.tables.files import WRITERS, write_csv, write_kitti, write_parquet, write_tum
from wayproof.harness.tables.tables import TABLES
from wayproof.harness.trajectory_error import rotations


@pytest.fixture(scope="module")
def log(recorded):
    return open_log(Path(recorded("empty", "drone", 1).log))


@pytest.mark.parametrize("name", TABLES)
def test_a_table_has_its_columns_with_units(log, name):
    table = TABLES[name](log)
    assert len(table) > 20
    assert table.column_names == [one.name for one in TABLES[name].columns]
    for field, column in zip(table.schema, TABLES[name].columns, strict=True):
        assert field.metadata[b"unit"].decode() == column.unit
        assert field.metadata[b"meaning"]


def test_decisions_are_those_of_the_log(log):
    table = TABLES["decisions"](log)
    messages = list(log.decisions())
    assert table["chain"].to_pylist() == [one.chain for one in messages]
    assert table["action"].to_pylist()[-1] == messages[-1].action
    assert table["committed_path"][5].as_py()[0] == [
        getattr(messages[5].trajectory.path[0], axis) for axis in "xyz"
    ]
    assert table["verdict"].null_count == len(table)  # no referee judges the built-in stack
    assert table["time_s"].to_numpy() == pytest.approx(
        [one.timestamp.ToNanoseconds() / 1e9 for one in messages]
    )


def test_the_error_of_a_pose_is_its_distance_from_the_truth(log):
    poses, truth = TABLES["poses"](log), TABLES["truth"](log)
    row, true = poses.slice(10, 1).to_pylist()[0], truth.slice(10, 1).to_pylist()[0]
    assert row["sequence"] == true["sequence"]
    distance = math.dist([row[axis] for axis in "xyz"], [true[axis] for axis in "xyz"])
    assert row["position_error_m"] == distance > 0.0
    assert abs(row["heading_error_rad"]) < 0.1


def test_ranges_are_metres_and_silence_is_no_distance(log):
    sweeps = TABLES["sweeps"](log)
    ranges = sweeps["ranges_m"][0].values.to_numpy()
    assert len(ranges) == sweeps["rows"][0].as_py() * sweeps["columns"][0].as_py()
    met = ranges[np.isfinite(ranges)]
    assert 0.0 < met.min() < met.max() < 66.0


def test_a_log_without_sweeps_says_so(recorded):
    thin = open_log(Path(recorded("empty", "drone", 1, "record=decisions").log))
    with pytest.raises(InputError, match="its sweeps were left out"):
        TABLES["sweeps"](thin)
    assert len(TABLES["poses"](thin)) == len(TABLES["decisions"](thin))


def test_parquet_and_csv_hold_the_table(log, tmp_path):
    table = TABLES["decisions"](log)
    write_parquet(table, tmp_path / "d.parquet")
    assert pq.read_table(tmp_path / "d.parquet").equals(table)
    write_csv(table, tmp_path / "d.csv")
    again = csv.read_csv(tmp_path / "d.csv")
    assert "committed_path" not in again.column_names
    assert again["x"].to_pylist() == table["x"].to_pylist()  # bit by bit


def test_tum_has_the_scalar_last_and_every_bit(log, tmp_path):
    poses = TABLES["poses"](log)
    write_tum(poses, tmp_path / "d.tum")
    found = np.loadtxt(tmp_path / "d.tum")
    names = ("time_s", "x", "y", "z", "qx", "qy", "qz", "qw")
    assert np.array_equal(found, np.stack([poses[name].to_numpy() for name in names], axis=1))


def test_kitti_has_a_matrix_a_line(log, tmp_path):
    truth = TABLES["truth"](log)
    write_kitti(truth, tmp_path / "d.kitti")
    found = np.loadtxt(tmp_path / "d.kitti").reshape(-1, 3, 4)
    assert np.array_equal(found[:, 0, 3], truth["x"].to_numpy())
    quaternions = np.stack([truth[f"q{axis}"].to_numpy() for axis in "wxyz"], axis=1)
    assert np.array_equal(found[:, :, :3], rotations(quaternions))


@pytest.mark.parametrize("kind", ["tum", "kitti"])
def test_a_trajectory_is_of_poses(log, tmp_path, kind):
    with pytest.raises(InputError, match="expected --table poses or truth"):
        WRITERS[kind](TABLES["decisions"](log), tmp_path / "x")
    assert not list(tmp_path.iterdir())
