"""Folders of depth images and of clouds, with poses."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from PIL import Image

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.transform import Transform, compose, mount_of, rotate

EVERY_PIXEL = RecordingOptions(pixel_stride=1, intrinsics=(2.0, 2.0, 1.0, 1.0))


def world_points(recording, sweep):
    """The ends of the beams with a return, in the world."""
    position, quaternion = recording.track.at(np.array([sweep.time_ns]))
    mount = sweep.T_body_sensor
    met = sweep.directions * sweep.ranges[:, None].astype(float)
    in_body = mount.position + rotate(mount.quaternion, met)
    return position[0] + rotate(quaternion[0], in_body)


def depth_image(path, millimetres):
    Image.fromarray(np.asarray(millimetres, np.uint16)).save(path)


def tum(folder, poses="0.5 1 2 3 0 0 0 1\n0.6 1 2 4 0 0 0 1\n", depths=("0.50", "0.60")):
    (folder / "depth").mkdir()
    lines = "# depth maps\n"
    for stamp in depths:
        pixels = np.full((2, 2), 5000)
        pixels[0, 0] = 0
        depth_image(folder / f"depth/{stamp}.png", pixels)
        lines += f"{stamp} depth/{stamp}.png\n"
    (folder / "depth.txt").write_text(lines)
    (folder / "groundtruth.txt").write_text("# ground truth\n" + poses)
    return folder


def test_a_tum_sequence_is_in_the_world_of_its_poses(tmp_path):
    recording = open_recording(tum(tmp_path), options=EVERY_PIXEL)
    first, second = recording.sweeps()
    assert recording.format == "tum"
    assert (first.time_ns, second.time_ns) == (0, 100_000_000)
    assert recording.start_ns == 500_000_000
    # Pixels (1, 0), (0, 1), (1, 1), a metre deep, seen from a camera at (1, 2, 3) unturned.
    expected = [[1.0, 1.5, 4.0], [0.5, 2.0, 4.0], [1.0, 2.0, 4.0]]
    np.testing.assert_allclose(world_points(recording, first), expected, atol=1e-6)
    assert recording.faults == {"pixel: no measurement": 2}
    ahead = rotate(recording.track.quaternions[0], np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(ahead, [0.0, 0.0, 1.0], atol=1e-15)  # x of the body is the view


def test_what_is_wrong_in_a_tum_sequence_is_counted(tmp_path):
    folder = tum(tmp_path, "0.5 1 2 3 0 0 0 1\nx 1\n0.6 1 2 3 0 0 0 0.5\n0.7 1 2 3 0 0 0 1\n")
    with (folder / "depth.txt").open("a") as file:
        file.write("0.62 depth/none.png\n0.61 depth/0.50.png\nword\n0.63 ../../etc/passwd\n")
    (folder / "depth/0.60.png").write_bytes((folder / "depth/0.60.png").read_bytes()[:40])
    recording = open_recording(folder, options=EVERY_PIXEL)
    assert len(list(recording.sweeps())) == 2
    (unread,) = [kind for kind in recording.faults if kind.startswith("message: cannot be read")]
    assert recording.faults == {
        unread: 2,
        "line: not a pose": 1,
        "line: not an image": 2,
        "pixel: no measurement": 2,
        "pose: quaternion far from unit length": 1,
    }


def frames(folder, poses):
    for k, pose in enumerate(poses):
        depth_image(folder / f"frame-{k:06d}.depth.png", [[1000, 65535], [0, 2000]])
        if pose is not None:
            np.savetxt(folder / f"frame-{k:06d}.pose.txt", pose)
    return folder


def test_frames_are_turned_so_that_z_is_up(tmp_path, monkeypatch):
    moved = np.eye(4)
    moved[:3, 3] = [0.0, 0.0, 0.5]  # forward, in the frame of the first camera
    frames(tmp_path, [np.eye(4), moved])
    monkeypatch.chdir(tmp_path.parent)
    recording = open_recording(Path(tmp_path.name), options=EVERY_PIXEL)
    first, second = recording.sweeps()
    assert recording.format == "frames"
    assert second.time_ns == 33_333_333
    np.testing.assert_allclose(recording.track.positions, [[0, 0, 0], [0.5, 0, 0]], atol=1e-15)
    # Pixel (0, 0) is half a metre to the left and half a metre up at a metre's depth.
    expected = [[1.0, 0.5, 0.5], [2.0, 0.0, 0.0]]
    np.testing.assert_allclose(world_points(recording, first), expected, atol=1e-6)
    assert recording.faults == {"pixel: no measurement": 4}


def test_frames_with_lost_poses_and_intrinsics_of_their_own(tmp_path):
    poses = [np.eye(4), np.full((4, 4), -np.inf), None, 2.0 * np.eye(4), np.eye(4)]
    frames(tmp_path, poses)
    np.savetxt(tmp_path / "camera-intrinsics.txt", [[3.0, 0, 1], [0, 4.0, 1], [0, 0, 1]])
    recording = open_recording(tmp_path, options=RecordingOptions(pixel_stride=1))
    assert "intrinsics 3,4,1,1" in recording.chosen
    assert len(list(recording.sweeps())) == 5  # between two poses 0.13 s apart
    assert recording.faults["pose: no rotation"] == 2
    assert recording.faults["pose: no matrix"] == 1


def test_a_layout_with_folders(tmp_path):
    for name in ("depth", "pose"):
        (tmp_path / name).mkdir()
    for k in range(11):
        depth_image(tmp_path / f"depth/{k}.png", [[1000]])
        np.savetxt(tmp_path / f"pose/{k}.txt", np.eye(4))
    recording = open_recording(tmp_path, options=EVERY_PIXEL)
    times = [sweep.time_ns for sweep in recording.sweeps()]
    assert times == [k * 10**9 // 30 for k in range(11)]


def test_a_world_whose_z_is_up_is_not_turned(tmp_path):
    level = np.eye(4)
    level[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # z of the camera along the world's x
    recording = open_recording(frames(tmp_path, [level, level]), options=EVERY_PIXEL)
    assert "z up in the poses" in recording.chosen
    first = next(recording.sweeps())
    expected = [[1.0, 0.5, 0.5], [2.0, 0.0, 0.0]]
    np.testing.assert_allclose(world_points(recording, first), expected, atol=1e-6)


@pytest.mark.parametrize("layout", ["tum", "frames", "kitti"])
def test_a_mount_places_the_body_under_the_sensor(tmp_path, layout):
    folder = {"tum": tum, "frames": lambda f: frames(f, [np.eye(4)] * 2), "kitti": kitti}[layout](
        tmp_path
    )
    few = RecordingOptions() if layout == "kitti" else EVERY_PIXEL
    own = open_recording(folder, options=few)
    given = (0.2, -0.1, 0.5, 30.0, 10.0, -5.0)
    mount = mount_of(given)
    carried = open_recording(folder, options=replace(few, mount=given))
    one, other = next(own.sweeps()), next(carried.sweeps())
    places = world_points(own, one), world_points(carried, other)
    np.testing.assert_allclose(*places, atol=1e-6)  # what was measured stays where it was
    sensor = compose(Transform(carried.track.positions[0], carried.track.quaternions[0]), mount)
    np.testing.assert_allclose(sensor.position, own.track.positions[0], atol=1e-12)
    ahead = rotate(sensor.quaternion, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(
        ahead, rotate(own.track.quaternions[0], np.array([1.0, 0.0, 0.0])), atol=1e-12
    )


def test_a_mount_turns_about_z_then_y_then_x():
    mount = mount_of([1.0, 2.0, 3.0, 90.0, 90.0, 180.0])
    assert mount.position.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(rotate(mount.quaternion, np.eye(3)[0]), [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(rotate(mount.quaternion, np.eye(3)[1]), [1, 0, 0], atol=1e-12)
    upside_down = mount_of([0.0, 0.0, 1.0, 0.0, 0.0, 180.0])
    np.testing.assert_allclose(rotate(upside_down.quaternion, np.eye(3)[2]), [0, 0, -1], atol=1e-12)
    for numbers in ([1.0, 2.0], [1.0] * 7, [np.nan, 0.0, 0.0]):
        with pytest.raises(InputError, match="expected X,Y,Z"):
            mount_of(numbers)


def kitti(folder, count=2):
    (folder / "velodyne").mkdir()
    points = np.array([[10, 0, 0, 0.5], [0, 5, -1, 0.5], [np.nan, 0, 0, 0]], np.float32)
    for k in range(count):
        points.tofile(folder / f"velodyne/{k:06d}.bin")
    camera = np.eye(4)[:3]
    moved = camera.copy()
    moved[2, 3] = 2.0  # along the camera's view
    np.savetxt(folder / "poses.txt", [camera.ravel(), moved.ravel()])
    return folder


def test_clouds_of_kitti_are_in_the_world_of_the_first_lidar(tmp_path):
    folder = kitti(tmp_path)
    turn = np.array([[0, -1, 0, 0], [0, 0, -1, -0.1], [1, 0, 0, -0.3]], float)  # T_camera_lidar
    (folder / "calib.txt").write_text("P0: 1 2\nTr: " + " ".join(map(str, turn.ravel())) + "\n")
    (folder / "times.txt").write_text("0.0\n0.104\n")
    recording = open_recording(folder)
    first, second = recording.sweeps()
    assert recording.format == "kitti"
    assert second.time_ns == 104_000_000
    np.testing.assert_allclose(recording.track.positions, [[0, 0, 0], [2, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(world_points(recording, first), [[10, 0, 0], [0, 5, -1]], atol=1e-5)
    np.testing.assert_allclose(world_points(recording, second), [[12, 0, 0], [2, 5, -1]], atol=1e-5)
    assert first.points.tolist() == [[10, 0, 0], [0, 5, -1]]
    assert recording.faults == {"point: not finite": 2}


def test_kitti_without_times_or_calibration(tmp_path):
    folder = kitti(tmp_path, count=3)
    (folder / "velodyne/000001.bin").write_bytes(b"\0" * 17)
    recording = open_recording(folder)
    assert [sweep.time_ns for sweep in recording.sweeps()] == [0]
    assert "10 sweeps a second" in recording.chosen
    unread = "message: cannot be read, the first: 000001.bin: 17 bytes, expected 16 for a point"
    assert recording.faults[unread] == 1
    assert recording.faults["sweep: no pose at its time"] == 1  # the third, of two poses


def test_the_poses_of_kitti_may_lie_beside_the_sequences(tmp_path):
    folder = tmp_path / "sequences/07"
    folder.mkdir(parents=True)
    kitti(folder)
    (tmp_path / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "poses/07.txt")
    recording = open_recording(folder)
    assert recording.format == "kitti"
    assert "poses: 07.txt" in recording.chosen
    assert len(list(recording.sweeps())) == 2


def test_an_option_without_a_meaning_is_refused(tmp_path):
    folder = kitti(tmp_path)
    for option in (RecordingOptions(pose="odom"), RecordingOptions(pixel_stride=1)):
        with pytest.raises(InputError, match="has no meaning for format 'kitti'"):
            open_recording(folder, options=option)


@pytest.mark.parametrize("content", ["", "# nothing\n"])
def test_a_folder_without_a_sweep_or_a_pose_is_refused(tmp_path, content):
    folder = tum(tmp_path)
    for name, said in (("depth.txt", "no sweep in it"), ("groundtruth.txt", "no pose of 0")):
        kept = (folder / name).read_text()
        (folder / name).write_text(content)
        with pytest.raises(InputError, match=said):
            open_recording(folder)
        (folder / name).write_text(kept)
    with pytest.raises(InputError, match="no sensor 'x', there is 'depth'"):
        open_recording(folder, options=RecordingOptions(sensors=("x",)))


def test_the_hash_is_of_all_files(tmp_path):
    first = open_recording(tum(tmp_path)).sha256
    assert first == open_recording(tmp_path).sha256
    depth_image(tmp_path / "depth/0.60.png", [[1, 2], [3, 4]])
    assert first != open_recording(tmp_path).sha256


def test_clouds_of_five_numbers_a_point_are_refused_with_their_width(tmp_path, capsys):
    folder = kitti(tmp_path)
    rows = np.zeros((400, 5), "<f4")
    angles = np.linspace(0.0, 2.0 * np.pi, len(rows))
    rows[:, :2] = np.column_stack([np.cos(angles), np.sin(angles)]) * 8.0
    rows[:, 2:] = 1.0, 40.0, 3.0
    for path in (folder / "velodyne").iterdir():
        path.write_bytes(rows.tobytes())
    assert main(["shadow", str(folder), "--robot", "drone", "--log", str(tmp_path / "a.mcap")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "no sweep with a pose (2 message: cannot be read, the first: 000000.bin: 5" in said
    assert "numbers a point, expected 4: x, y, z, intensity" in said
