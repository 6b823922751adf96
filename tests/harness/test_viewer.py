"""What is shown is what the log holds, and what the map was at each decision."""

import functools
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from threading import Event

import mujoco
import numpy as np
import pytest
from PIL import Image

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.reader import open_log, read_head
from wayproof.harness.replay.fork import fork
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.ahead import Ahead
from wayproof.harness.viewer.boxes import runs, surrounding_boxes, upright_boxes
from wayproof.harness.viewer.layer import COLOURS, FRONTIER, INFLATED, kinds, layer_at, pixels
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.rerun_view import loopback_viewer
from wayproof.harness.viewer.sight import geoms_in_front
from wayproof.harness.viewer.tiles import TILE, Tiles
from wayproof.harness.viewer.words import describe
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig, MapConfig, VoxelMap

LOW, HIGH = (0.0, 0.0, 0.0), (4.0, 4.0, 1.0)


@pytest.fixture(scope="module")
def log(recorded):
    return Path(recorded("empty", "drone", 1).log)


@pytest.fixture(scope="module")
def failed(recorded):
    return Path(recorded("empty", "drone", 1, "episode.time_limit=1").log)


RUN = ["run", "empty", "--robot", "drone", "--seed", "1", "--set", "episode.time_limit=1"]


def seen_map():
    """Free from x = 0 to 2 m, one obstacle in it, unknown beyond."""
    config = MapConfig(resolution=0.1, half_life=0.0)
    a_map = VoxelMap(config)
    a_map.mark_free((0.0, 0.0, 0.0), (2.0, 4.0, 1.0), 0)
    beam, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([500], np.uint16)
    for sweep in range(8):
        a_map.integrate((0.55, 2.05, 0.55), beam, ranges_mm, 2.0, sweep)
    return a_map, Costmap(CostmapConfig(), a_map, LOW, HIGH, "air", 0.15, 0.2, 0.0)


@pytest.mark.parametrize("wider", [0, 9])
def test_kinds_are_those_of_each_cell_alone(wider):
    _, costmap = seen_map()
    layer, limit = layer_at(costmap, 0.55), costmap.collision_distance_sq + wider
    told, states = kinds(costmap, layer, limit), costmap.state[:, :, layer]
    field = costmap.obstacle_clearance[:, :, layer]
    nx, ny = told.shape
    for x, y in np.ndindex(nx, ny):
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        unknown = any(states[i, j] == UNKNOWN for i, j in around if 0 <= i < nx and 0 <= j < ny)
        expected = states[x, y]
        if expected == FREE and field[x, y] <= limit:
            expected = INFLATED
        elif expected == FREE and unknown:
            expected = FRONTIER
        assert told[x, y] == expected
    assert set(np.unique(told)) == {UNKNOWN, FREE, OCCUPIED, INFLATED, FRONTIER}


def test_an_image_has_x_to_the_right_and_y_up():
    told = np.zeros((3, 2), np.uint8)
    told[2, 1] = OCCUPIED
    image = pixels(told)
    assert image.shape == (2, 3, 3)
    assert tuple(image[0, 2]) == COLOURS[OCCUPIED]
    assert tuple(image[1, 2]) == COLOURS[int(told[2, 0])]


def test_runs_by_hand():
    rows = np.array([[1, 1, 0, 1], [0, 0, 0, 0], [0, 1, 1, 1]], bool)
    row, first, end = runs(rows)
    assert list(zip(row, first, end, strict=True)) == [(0, 0, 2), (0, 3, 4), (2, 1, 4)]


def test_boxes_around_a_map_cover_what_is_outside_once_and_nothing_of_it():
    origin = np.array([-1.0, 2.0, 0.0])
    middles, halves = surrounding_boxes((20, 10), origin, 0.1, 3.0)  # x -1 to 1, y 2 to 3
    rng = np.random.default_rng(0)
    points = rng.uniform((-4.0, -1.0), (4.0, 6.0), (500, 2))
    inside = ((points > (-1.0, 2.0)) & (points < (1.0, 3.0))).all(axis=1)
    hits = (np.abs(points[:, None] - middles) <= halves).all(axis=2).sum(axis=1)
    assert inside.any()
    np.testing.assert_array_equal(hits, np.where(inside, 0, 1))


def test_the_viewer_s_background_is_unknown_and_not_free(log):
    """What lies outside the map has the colour that the unknown has in it."""
    pytest.importorskip("rerun")
    from wayproof.harness.viewer.layout import UNKNOWN_SPACE, layout

    column = layout({"log": open_log(log)}).root_container
    spaces = column.contents[0].contents
    assert len(spaces) == 2
    for view in spaces:
        (packed,) = view.properties["Background"].color.as_arrow_array().to_pylist()
        assert [packed >> shift & 255 for shift in (24, 16, 8)] == list(UNKNOWN_SPACE)
    assert max(UNKNOWN_SPACE) < 150  # free cells are white


def test_tiles_tell_a_change_once_and_boxes_hold_the_same_cells():
    a_map, _ = seen_map()
    tiles = Tiles(LOW, HIGH, 0.1)
    (tile,) = tiles.changed(a_map)
    centres = tiles.centres(tile)
    assert tile.name == "0_0"
    assert TILE * 0.1 > 2.1
    np.testing.assert_allclose(centres, [[1.05, 2.05, centres[0, 2]]])
    assert abs(centres[0, 2] - 0.55) < 0.1
    assert tiles.changed(a_map) == []
    middles, halves = upright_boxes(a_map, LOW, HIGH)
    np.testing.assert_allclose(middles, centres)
    np.testing.assert_allclose(halves, [[0.05, 0.05, 0.05]])


def test_each_moment_has_the_map_that_its_decision_names(log):
    seen = 0
    for moment in moments(open_log(log)):
        assert moment.map.version() == moment.decision.map_version
        assert moment.truth.sequence == moment.decision.sequence
        assert moment.costmap.inflation_radius == moment.decision.inflation_radius_m
        seen += 1
    assert seen == int(open_log(log).result["decisions"])


def test_a_costmap_that_is_asked_for_now_and_then_is_the_same(log):
    each = [moment.costmap.state.copy() for moment in moments(open_log(log))]
    fields = [moment.costmap.obstacle_clearance.copy() for moment in moments(open_log(log))]
    for place, moment in enumerate(moments(open_log(log))):
        if place % 3 == 2:
            np.testing.assert_array_equal(moment.costmap.state, each[place])
            np.testing.assert_array_equal(moment.costmap.obstacle_clearance, fields[place])


def test_what_is_made_ahead_comes_in_order_and_its_failure_at_its_place():
    def items():
        yield from range(20)
        raise ValueError("here")

    got = []
    with pytest.raises(ValueError, match="here"):
        got.extend(Ahead(items(), 8))  # what came before is kept by extend
    assert got == list(range(20))
    assert list(Ahead(iter(()), 8)) == []


def test_what_is_made_ahead_is_no_more_than_asked_for_and_lets_go_when_closed():
    made, closed, enough = [], [], Event()

    def items():
        try:
            for item in range(100):
                made.append(item)
                if item == 2:
                    enough.set()
                yield item
        finally:
            closed.append(True)

    coming = Ahead(items(), 3)
    assert enough.wait(10.0)
    coming.close()
    assert made == [0, 1, 2]
    assert closed == [True]


def test_a_forked_log_is_shown_with_the_map_of_each_side(tmp_path, log):
    """And so is one that was forked again, each side with its lidar."""
    first, forked = tmp_path / "first.mcap", tmp_path / "fork.mcap"
    fork(log, 6, ["costmap.localization_margin=0.2", "episode.time_limit=2"], first)
    again = [
        "costmap.localization_margin=0.3",
        "map.resolution=0.08",
        "sensors.lidar=velodyne-vlp16",
    ]
    fork(first, 9, again, forked)
    radii, beams = [], []
    for moment in moments(open_log(forked)):
        assert moment.map.version() == moment.decision.map_version
        assert moment.costmap.inflation_radius == moment.decision.inflation_radius_m
        radii.append(moment.costmap.inflation_radius)
        beams.append(moment.beams["lidar"].table.beams)
    for sides in (radii, beams):
        assert len(set(sides[:6])) == len(set(sides[6:9])) == len(set(sides[9:])) == 1
    assert radii[5] < radii[6] < radii[9]
    assert beams[5] == beams[6] != beams[9]


def test_a_decision_without_its_truth_is_told_at_its_place(tmp_path, log):
    """Whether another one follows it or it is the last."""
    last = int(open_log(log).result["decisions"]) - 1
    for lost in (3, last):
        messages = [
            message
            for message in read_messages(log)
            if not isinstance(message, pb.Truth) or message.sequence != lost
        ]
        head, out = read_head(walk(log, head_only=True), log, False), tmp_path / f"{lost}.mcap"
        write_copy(out, head, messages, open_log(log).result)
        told = open_log(out).records_with_truth()
        for sequence in range(lost):
            record, truth = next(told)
            assert record.decision.sequence == truth.sequence == sequence
        with pytest.raises(InputError, match=f"decision {lost} without its truth"):
            next(told)


def test_hits_lie_on_what_is_there_and_are_thinned(log):
    moment = next(moments(open_log(log)))
    hits = moment.hits(100)
    assert 20 < len(hits) <= 100 + len(moment.record.inputs.sweeps)
    mission = open_log(log).mission
    low, high = np.array(mission.low) - 0.3, np.array(mission.high) + 0.3
    assert ((hits[:, :2] >= low[:2]) & (hits[:, :2] <= high[:2])).all()


def test_words_tell_action_reason_and_map(log):
    opened = open_log(log)
    decision = next(opened.decisions())
    text = describe(decision, opened.config.costmap.cost_range)
    assert decision.action in text
    assert decision.reason in text
    assert decision.map_version[:12] in text


def entities(recording):
    """What Rerun's own command finds in a file."""
    rerun = Path(sys.executable).with_name("rerun")
    command = [str(rerun), "rrd", "print", str(recording)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_failure_is_marked_and_two_logs_stand_side_by_side(tmp_path, capsys, log, failed):
    pytest.importorskip("rerun")
    out = tmp_path / "new" / "both.rrd"
    assert main(["view", str(failed), "--compare", str(log), "--save", str(out)]) == 0
    capsys.readouterr()
    assert not list(out.parent.glob("*.partial"))
    told = entities(out)
    for name in ("world/robot", "world/truth", "world/layer", "world/sweep", "world/trajectory"):
        assert f"/log/{name}" in told
        assert f"/other/{name}" in told
    assert "/log/world/failure" in told
    assert "/other/world/failure" not in told
    assert "/log/plots/latency/deadline_ms" in told


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_no_display_is_told_in_a_line(capsys, monkeypatch, log):
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
        (["picture", "LOG"], "expected a decision's number N, or --movie"),
        (["picture", "LOG", "3", "--movie", "x.gif"], "and not both"),
        (["picture", "LOG", "3", "--out", "x.gif"], "a name that ends in .png"),
        (["picture", "LOG", "-3"], "N: got -3, expected 0 or more"),
        (["picture", "LOG", "--movie", "x.avi"], "a name that ends in .gif or .mp4"),
        (["picture", "LOG", "--movie", "x.gif", "--period", "0"], "--period: got 0"),
        ([*RUN, "--render", "x.png"], "a name that ends in .gif or .mp4"),
        ([*RUN, "--render", "x.gif", "--set", "record=decisions"], "got record=decisions"),
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


def drawn(arguments):
    """Draw in a process of its own, which chooses the driver; skip where nothing can be drawn."""
    command = [sys.executable, "-m", "wayproof", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True)
    if "no picture here" in ended.stderr and not driver_found():
        pytest.skip(ended.stderr)
    return ended.returncode, ended.stderr


@functools.cache
def driver_found():
    """Whether MuJoCo finds a driver that draws without a screen."""
    code = "import mujoco; mujoco.GLContext(8, 8).free()"
    without = {**os.environ, "MUJOCO_GL": "egl"}
    return (
        subprocess.run([sys.executable, "-c", code], env=without, capture_output=True).returncode
        == 0
    )


def test_a_picture_shows_the_map(tmp_path, log):
    out = tmp_path / "x.png"
    assert drawn(["picture", str(log), "5", "--out", str(out)]) == (0, "")
    image = np.asarray(Image.open(out).convert("RGB"), int)
    assert image.shape == (640, 960, 3)
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    assert (blue - red > 30).mean() > 0.01  # occupied cells
    assert (red - blue > 30).mean() > 0.005  # inflation and trail
    assert ((green - red > 30) & (green - blue > 30)).any()  # what it has committed to


def test_a_decision_that_is_not_there(tmp_path, failed):
    out = tmp_path / "x.png"
    code, told = drawn(["picture", str(failed), "999", "--out", str(out)])
    assert code == 2
    assert "no decision 999, expected 0 to" in told
    assert not out.exists()


ROOM = """<mujoco><asset><material name="brick" rgba="1 0 0 1"/></asset><worldbody>
<geom name="target" type="sphere" size="0.2" pos="0 0 1"/>
<geom name="near" material="brick" type="box" size="0.1 3 3" pos="-2 0 1"/>
<geom name="post" type="box" size="0.1 0.1 3" pos="-3 0.5 1"/>
<geom name="behind" type="box" size="0.1 3 3" pos="2 0 1"/>
<geom name="far_aside" type="box" size="0.1 0.1 3" pos="-3 2 1"/>
<geom name="at_the_camera_s_back" type="box" size="0.1 3 3" pos="-8 0 1"/>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("azimuth", "elevation", "names"),
    [(0.0, 0.0, {"near", "post"}), (90.0, 0.0, set()), (180.0, 0.0, {"behind"}), (0.0, -90, set())],
)
def test_what_stands_in_front_is_found_and_nothing_else(azimuth, elevation, names):
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = (0.0, 0.0, 1.0), 5.0
    camera.azimuth, camera.elevation = azimuth, elevation
    found = geoms_in_front(model, data, camera, 0.3)
    assert {model.geom(geom).name for geom in found} == names
    assert len(found) == len(names)
    assert (model.geom_rgba[found, 3] == 0.0).all()


def test_an_animation_plays_in_simulated_time(tmp_path, failed):
    out = tmp_path / "x.gif"
    words = ["picture", str(failed), "--movie", str(out), "--period", "0.5"]
    assert drawn(words) == (0, "")
    with Image.open(out) as animation:
        assert animation.n_frames == 3
        assert animation.info["duration"] == 500


def test_an_episode_is_rendered_once_it_is_run(tmp_path):
    av = pytest.importorskip("av")
    out = tmp_path / "films" / "x.mp4"
    code, told = drawn([*RUN, "--log", str(tmp_path / "x.mcap"), "--render", str(out)])
    assert (code, told) == (1, "")  # a second is too short to arrive
    with av.open(str(out)) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert stream.average_rate == 5
    assert len(frames) == 6
    assert frames[0].shape == (480, 720, 3)
    assert frames[0].std() > 20
    assert not list(out.parent.glob("*.partial"))


def test_a_missing_encoder_is_told_before_the_episode(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.chdir(tmp_path)
    assert main([*RUN, "--render", "x.mp4"]) == 2
    assert "pip install av (the extra 'video'), or name a .gif" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
