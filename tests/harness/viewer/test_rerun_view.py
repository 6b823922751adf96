"""Logs shown in Rerun."""

import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.harness.log.test_follow import Copying
from wayproof.harness.cli.main import main
from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.rerun_view import loopback_viewer

RUN = ["run", "empty", "--robot", "drone", "--seed", "1", "--set", "episode.time_limit=1"]


def test_the_viewer_s_background_is_unknown_and_not_free(log):
    """What lies outside the map has the colour that the unknown has in it."""
    pytest.importorskip("rerun")
    from wayproof.harness.viewer.layer import COLOURS
    from wayproof.harness.viewer.layout import layout
    from wayproof.maps import UNKNOWN

    column = layout({"log": open_log(log)}).root_container
    space, maps = column.contents[0].contents
    spaces = [space, *maps.contents]
    assert [view.name.split()[0].rstrip(",:") for view in spaces[1:]] == [
        "map", "age", "probability",
    ]  # fmt: skip
    for view in spaces:
        (packed,) = view.properties["Background"].color.as_arrow_array().to_pylist()
        assert [packed >> shift & 255 for shift in (24, 16, 8)] == list(COLOURS[UNKNOWN])


def entities(recording, *options):
    """What Rerun's own command finds in a file."""
    rerun = Path(sys.executable).with_name("rerun")
    command = [str(rerun), "rrd", "print", *options, str(recording)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_failure_is_marked_and_two_logs_stand_side_by_side(tmp_path, capsys, log, failed):
    pytest.importorskip("rerun")
    out = tmp_path / "new" / "both.rrd"
    assert main(["view", str(failed), "--compare", str(log), "--save", str(out)]) == 0
    capsys.readouterr()
    assert not list(out.parent.glob("*.partial"))
    shown = entities(out)
    for name in (
        "world/robot", "world/truth", "world/layer", "world/sweep", "world/trajectory",
        "world/scene/obstacles", "world/age", "world/probability", "world/pose_error",
        "world/believed_trail", "plots/pose/error_m", "plots/heading/error_deg", "event",
    ):  # fmt: skip
        assert f"/log/{name}" in shown
        assert f"/other/{name}" in shown
    assert "/log/world/failure" in shown
    assert "/other/world/failure" not in shown
    assert "/log/plots/delay/deadline_ms" in shown


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_a_missing_display_is_one_line(capsys, monkeypatch, log):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["view", str(log)]) == 2
    assert "--save FILE.rrd" in capsys.readouterr().err


LONGEST_START_S = 60.0
"""After which a server that listens nowhere hangs."""


@pytest.mark.skipif(sys.platform != "linux", reason="sockets are looked up in /proc")
def test_the_viewer_listens_on_this_machine_alone(tmp_path):
    """Rerun's own server, started by the command that starts its window."""
    pytest.importorskip("rerun")
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    command = [str(loopback_viewer(tmp_path)), "--serve-grpc", "--port", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        found, until = [], time.monotonic() + LONGEST_START_S
        while not found and server.poll() is None and time.monotonic() < until:
            time.sleep(0.05)
            found = listening(port)
        assert found == ["0100007F"]  # 127.0.0.1
    finally:
        server.kill()
        server.wait()


def listening(port):
    """Addresses in hex on which a port listens."""
    rows = [
        line.split()
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    ]
    local = [row[1].split(":") for row in rows if row[3] == "0A"]
    return [address for address, number in local if int(number, 16) == port]


class Started(Exception):
    """A viewer would have started."""


def start_nothing(*arguments, executable_path, **options):
    raise Started(Path(executable_path).read_text())


def test_windows_and_screenshots_are_of_that_viewer(monkeypatch, tmp_path, log):
    rerun = pytest.importorskip("rerun")
    experimental = pytest.importorskip("rerun.experimental")
    from docs.picture_view import main as picture_view

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(rerun, "spawn", start_nothing)
    monkeypatch.setattr(experimental.ViewerClient, "spawn", start_nothing)
    with pytest.raises(Started, match=r"exec \S+ --bind 127\.0\.0\.1 "):
        main(["view", str(log)])
    with pytest.raises(Started, match=r"exec \S+ --bind 127\.0\.0\.1 "):
        picture_view(tmp_path / "x.rrd", 1.0, tmp_path / "x.png")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["view", "LOG", "--save", "x.png"], "a name that ends in .rrd"),
        (["view", "none.mcap", "--save", "x.rrd"], "no such file"),
        (["view", "LOG", "3"], "expected the folder of a study before it"),
        (["view", "LOG", "--png", "x.png", "--movie", "x.gif"], "goes with no other way"),
        (["view", "LOG", "--png", "x.gif"], "a name that ends in .png"),
        (["view", "LOG", "--png", "x.png", "--decision=-3"], "--decision: got -3, expected 0 or"),
        (["view", "LOG", "--decision", "3"], "--decision: goes with --png"),
        (["view", "LOG", "--period", "1"], "--period: goes with --movie"),
        (["export", "LOG", "--map", "m.bt", "--table", "truth"], "--table: goes with --parquet or"),
        (["export", "LOG", "--csv", "x.csv", "--at", "3"], "--at: goes with --map"),
        (["explain", "LOG", "--long"], "--long: goes with --metrics"),
        (["view", "LOG", "--movie", "x.avi"], "a name that ends in .gif or .mp4"),
        (["view", "LOG", "--movie", "x.gif", "--period", "0"], "--period: got 0"),
        ([*RUN, "--view", "x.rrd", "--set", "record=failures"], "got record=failures"),
        ([*RUN, "--view", "x.png"], "a name that ends in .rrd"),
    ],
)
def test_bad_input_is_a_line_and_leaves_nothing(
    capsys, monkeypatch, tmp_path, log, arguments, said
):
    monkeypatch.chdir(tmp_path)
    assert main([str(log) if word == "LOG" else word for word in arguments]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_episode_is_shown_while_it_runs(tmp_path, capsys):
    """In a process of its own, which reads the log alone."""
    pytest.importorskip("rerun")
    out = tmp_path / "x.rrd"
    log = tmp_path / "x.mcap"
    arguments = [*RUN, "--set", "map.resolution=0.2", "--log", str(log), "--view", str(out)]
    assert main(arguments) == 1  # no time to reach the goal
    assert f"view: {out}" in capsys.readouterr().out.replace("\n", "")
    shown = entities(out)
    for name in ("world/scene/obstacles", "world/layer", "world/failure", "plots/pose/error_m"):
        assert f"/log/{name}" in shown


def test_a_log_is_shown_while_it_is_written(tmp_path, log):
    pytest.importorskip("rerun")
    from wayproof.harness.viewer.rerun_view import view_live

    copying = Copying(log, tmp_path / "x.mcap")
    copying.write(5)
    writer = threading.Timer(1.0, copying.finish)
    writer.start()
    out = tmp_path / "x.rrd"
    shown = view_live(tmp_path / "x.mcap", out)
    writer.join()
    assert shown.decisions == (len(list(open_log(log).decisions())),)
    assert "success" in entities(out, "-vvv")
