"""Files that the program writes: held by one writer, whole or not at all, in place of no device."""

import os
import stat
from pathlib import Path

import pytest
from mcap.writer import Writer

from tests.tools.soak.child import in_child
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.outputs import Draft, remove_abandoned, written_whole


def test_a_name_has_one_writer_at_a_time(tmp_path):
    path = tmp_path / "a.mcap"
    with Draft(path) as first:
        first.file.write(b"first")
        with pytest.raises(InputError, match="another run is writing it"):
            Draft(path)
        first.publish()
    assert path.read_bytes() == b"first"
    with Draft(path) as second:
        second.file.write(b"second")
        second.publish()
    assert path.read_bytes() == b"second"
    assert os.listdir(tmp_path) == ["a.mcap"]


def test_another_process_is_kept_out_too(tmp_path):
    def work(tell):
        try:
            Draft(tmp_path / "a.mcap")
        except InputError as error:
            tell(str(error))

    with Draft(tmp_path / "a.mcap"):
        ended = in_child(work, 20.0)
    [line] = ended.lines
    assert "another run is writing it" in line
    assert os.listdir(tmp_path) == []


def test_what_a_killed_writer_left_is_kept(tmp_path):
    path = tmp_path / "a.mcap"
    for number in range(1, 3):
        path.with_name("a.mcap.partial").write_bytes(b"evidence %d" % number)
        with Draft(path) as draft:
            assert draft.kept == tmp_path / f"a.mcap.partial.{number}"
            draft.file.write(b"anew")
            draft.publish()
    assert (tmp_path / "a.mcap.partial.1").read_bytes() == b"evidence 1"
    assert (tmp_path / "a.mcap.partial.2").read_bytes() == b"evidence 2"


def test_what_was_written_stays_partial_and_nothing_does_not(tmp_path):
    with Draft(tmp_path / "new" / "folder" / "a.mcap"):
        pass
    assert os.listdir(tmp_path) == []
    with Draft(tmp_path / "a.mcap") as draft:
        draft.file.write(b"some")
    assert os.listdir(tmp_path) == ["a.mcap.partial"]


def test_a_partial_file_that_was_replaced_is_not_published(tmp_path):
    """Else the log of another run would get this one's name."""
    with Draft(tmp_path / "a.mcap") as draft:
        draft.file.write(b"ours")
        draft.partial.unlink()
        draft.partial.write_bytes(b"another's")
        with pytest.raises(InputError, match="was taken away"):
            draft.publish()
    assert draft.partial.read_bytes() == b"another's"
    assert not draft.path.exists()


def test_abandoned_files_are_removed_and_held_ones_are_not(tmp_path):
    with Draft(tmp_path / "a.mcap") as draft:
        draft.file.write(b"some")
        with pytest.raises(InputError, match="another process is writing it"):
            remove_abandoned(draft.partial, 0.0)
    assert draft.partial.exists()
    remove_abandoned(draft.partial, 0.0)
    assert os.listdir(tmp_path) == []


def refused_targets(folder):
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "dangling").symlink_to(folder / "nowhere")
    (folder / "notes.txt").write_text("a user's own file")
    (folder / "piped.mcap.partial").symlink_to(folder / "pipe")
    return {
        "folder": "a folder, expected",
        "pipe": "a pipe, expected",
        "dangling": "a link, expected",
        "notes.txt": "a file that is no log",
        "piped.mcap": "a pipe, expected",
        "a.mcap.partial": "ends in .partial",
        "notes.txt/a.mcap": "is a file, expected a folder",
        "n" * 300: "File name too long",
    }


def identities(folder):
    found = {one.name: one.lstat() for one in folder.iterdir()}
    return {name: (one.st_ino, one.st_mode, one.st_size) for name, one in found.items()}


def test_a_log_takes_the_place_of_no_folder_device_or_other_file(tmp_path, capsys):
    """Before the episode: nothing is left of it, and what is there stays as it was."""
    targets = refused_targets(tmp_path)
    before = identities(tmp_path)
    texts = {tmp_path / name: text for name, text in targets.items()}
    for target, text in {**texts, "/dev/null": "a device", "/dev/full": "a device"}.items():
        run = ["run", "empty", "--robot", "drone", "--seed", "1", "--log", str(target)]
        assert main(run) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert text in line
    assert identities(tmp_path) == before
    assert all(stat.S_ISCHR(os.stat(name).st_mode) for name in ("/dev/null", "/dev/full"))


def foreign(path):
    """A bag of ROS 2 in one MCAP file, as far as its head says."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="libmcap 1.4.0")
        writer.finish()
    return path.read_bytes()


def test_a_file_of_another_program_is_not_overwritten(tmp_path, recorded, capsys):
    log = recorded("empty", "drone", 1).log
    cut = tmp_path / "cut.mcap.partial"
    cut.write_bytes(Path(log).read_bytes()[: Path(log).stat().st_size * 2 // 3])
    bag = tmp_path / "bag.mcap"
    data = foreign(bag)
    for arguments in (
        ["run", "empty", "--robot", "drone", "--seed", "1", "--log", str(bag)],
        ["replay", "simulate", log, "--log", str(bag)],
        ["replay", "fork", log, "3", "--log", str(bag)],
        ["export", str(cut), "--log", str(bag)],
        ["export", log, "--foxglove", str(bag)],
        ["export", log, "--bag", str(bag)],
        ["export", log, "--csv", str(bag)],
    ):
        assert main(arguments) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert "expected" in line
        assert bag.read_bytes() == data
    left = cut.read_bytes()
    for name, text in (("cut.mcap", "is a log, expected"), ("b.mcap", "")):
        assert main(["export", log, "--foxglove", str(tmp_path / name)]) == (2 if text else 0)
        assert text in capsys.readouterr().err
    assert main(["export", log, "--foxglove", str(tmp_path / "b.mcap")]) == 0  # over its own
    assert cut.read_bytes() == left
    assert sorted(os.listdir(tmp_path)) == ["b.mcap", "bag.mcap", "cut.mcap.partial"]


def test_a_log_finished_or_not_is_overwritten(tmp_path):
    path = tmp_path / "a.mcap"
    for _ in range(2):
        with LogWriter(path, b"{}", b"{}", "<mujoco/>") as log:
            log.finish({})
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with LogWriter(path, b"{}", b"{}", "<mujoco/>") as log:
        log.finish({})
    assert path.stat().st_size == len(whole)


def test_a_log_that_is_read_for_another_is_not_overwritten(tmp_path, recorded, capsys):
    path = tmp_path / "a.mcap"
    path.write_bytes(Path(recorded("empty", "drone", 1).log).read_bytes())
    (tmp_path / "same.mcap").hardlink_to(path)
    data = path.read_bytes()
    same = ["--log", str(tmp_path / "same.mcap")]
    for arguments in (
        ["shadow", str(path), "--robot", "drone", *same],
        ["run", "empty", "--robot", "drone", "--seed", "1", "--prior", str(path), *same],
    ):
        assert main(arguments) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert "is read for this log, expected another name" in line
    assert path.read_bytes() == data


def test_every_writer_of_logs_holds_the_name(tmp_path, recorded, capsys):
    log = recorded("empty", "drone", 1).log
    target = tmp_path / "held.mcap"
    cut = tmp_path / "cut.mcap.partial"
    cut.write_bytes(Path(log).read_bytes()[: Path(log).stat().st_size * 2 // 3])
    with Draft(target):
        for arguments in (
            ["replay", "simulate", log, "--log", str(target)],
            ["replay", "fork", log, "3", "--log", str(target)],
            ["export", str(cut), "--log", str(target)],
        ):
            assert main(arguments) == 2
            [line] = capsys.readouterr().err.splitlines()
            assert "another run is writing it" in line
        with pytest.raises(InputError, match="another run is writing it"):
            LogWriter(target, b"{}", b"{}", "<mujoco/>")


def test_other_files_are_whole_or_not_there(tmp_path):
    (tmp_path / "a.png.partial").write_bytes(b"of a killed writer")
    with written_whole(tmp_path / "a.png", "picture") as partial:
        assert partial.read_bytes() == b""
        partial.write_bytes(b"picture")
    assert (tmp_path / "a.png").read_bytes() == b"picture"
    with pytest.raises(TypeError), written_whole(tmp_path / "a.png", "picture") as partial:
        partial.write_bytes("no bytes")
    assert (tmp_path / "a.png").read_bytes() == b"picture"
    assert os.listdir(tmp_path) == ["a.png"]
    with pytest.raises(InputError, match=r"picture '/dev/null': a device"):
        Draft(Path("/dev/null"), "picture")
