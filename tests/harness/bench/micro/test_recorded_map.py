import numpy as np
import pytest

from wayproof.harness.bench.micro import recorded_map

pytest.importorskip("pyoctomap")


def clouds(folder, count):
    """A folder of clouds of a slanted wall 6 m ahead and one return 80 m away, as KITTI's are."""
    (folder / "velodyne").mkdir()
    rng = np.random.default_rng(2)
    for number in range(count):
        y, z = rng.uniform(-3, 3, 500), rng.uniform(-0.5, 1.5, 500)
        points = np.column_stack([6.0 + 0.1 * y, y, z, np.zeros(500)])
        points[0, :3] = 80.03, 0.0, 0.2
        points.astype("<f4").tofile(folder / f"velodyne/{number:06d}.bin")
    pose = np.eye(4)[:3].ravel()
    np.savetxt(folder / "poses.txt", [pose + 0.1 * k * np.eye(12)[3] for k in range(count)])


def test_both_maps_of_a_recording_hold_the_same_cells(tmp_path, capsys):
    clouds(tmp_path, 3)
    recorded_map.main([str(tmp_path), "--resolution", "0.2", "--sweeps", "2",
                       "--out", str(tmp_path / "rows.jsonl")])  # fmt: skip
    row = capsys.readouterr().out.splitlines()[-1].split(" | ")
    assert row[0].endswith("(2)")
    assert row[2] == "500"
    assert float(row[-2].rstrip("%")) > 99.8
    assert (tmp_path / "rows.jsonl").read_text().count("\n") == 1


def test_returns_beyond_a_range_are_left_out(tmp_path, capsys):
    clouds(tmp_path, 1)
    recorded_map.main([str(tmp_path), "--range-max", "20"])
    assert capsys.readouterr().out.splitlines()[-1].split(" | ")[2] == "499"


def test_a_map_of_other_points_does_not_agree(tmp_path):
    clouds(tmp_path, 1)
    recording = recorded_map.open_recording(tmp_path)
    (sweep,) = recorded_map.returns(recording)
    shifted = sweep.moved(np.array([0.0, 0.5, 0.0]))
    config = recorded_map.MapConfig(resolution=0.2, half_life=0.0, minimum_range=0.0)
    one, other = recorded_map.VoxelMap(config, 1), recorded_map.VoxelMap(config, 1)
    recorded_map.integrate(one, sweep, 0, 100.0)
    recorded_map.integrate(other, shifted, 0, 100.0)
    known, same, swapped, occupied = recorded_map.count_cells(one, other, [sweep, shifted])
    assert same < 0.9 * known
    assert 0 < swapped <= occupied
