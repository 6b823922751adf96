"""The robot's own costmaps beside ours."""

import numpy as np
import pytest

from tests.harness.recordings.bags.drawn import START, SWEEPS, Plan, Recorder
from tests.harness.recordings.bags.making import at
from tests.harness.shadow.conftest import shadowed, verdict_on
from wayproof.harness.shadow.page import write_page

CELL, COLUMNS, ROWS = 0.1, 80, 60
CORNER = (-1.5, -2.5)
"""The grids lie within the room: nothing in them is occupied but a pillar at (3, 1.5)."""


def recorded(tmp_path, costs, kind="raw", updated=None):
    """A bag of a robot that drives through the drawn room, with a costmap (ROWS, COLUMNS)."""
    recorder = Recorder(Plan(sensor="scan", turn=0.0), 0)
    grid(recorder, costs, kind)
    if updated is not None:
        update(recorder, *updated)
    return recorder.record(tmp_path / "bag")


def grid(recorder, costs, kind):
    build = recorder.bag.build
    # The map lies in a frame of its own, a quarter turn from the poses'.
    recorder.bag.tf("odom", "map", 0.0, at(*CORNER, 0.0), "/tf_static")
    header = build.header(round((START + 0.1) * 1e9), "map")
    origin = {"orientation": {"w": 1.0}}
    if kind == "raw":
        metadata = build.make(
            "nav2_msgs/CostmapMetaData",
            map_load_time=build.time(0),
            update_time=build.time(0),
            layer="",
            resolution=CELL,
            size_x=COLUMNS,
            size_y=ROWS,
            origin=origin,
        )
        message = build.make(
            "nav2_msgs/Costmap",
            header=header,
            metadata=metadata,
            data=np.asarray(costs, np.uint8).ravel(),
        )
        recorder.bag.add("/global_costmap/costmap_raw", "nav2_msgs/Costmap", message, START + 0.1)
        return
    info = build.make(
        "nav_msgs/MapMetaData",
        map_load_time=build.time(0),
        resolution=CELL,
        width=COLUMNS,
        height=ROWS,
        origin=origin,
    )
    data = np.where(costs == 255, -1, np.where(costs >= 253, 100, 0)).astype(np.int8).ravel()
    message = build.make("nav_msgs/OccupancyGrid", header=header, info=info, data=data)
    recorder.bag.add("/global_costmap/costmap", "nav_msgs/OccupancyGrid", message, START + 0.1)


def update(recorder, x, y, costs):
    build = recorder.bag.build
    stamp = START + 0.1 * (SWEEPS - 1)
    rows, columns = costs.shape
    message = build.make(
        "nav2_msgs/CostmapUpdate",
        header=build.header(round(stamp * 1e9), "map"),
        x=x,
        y=y,
        size_x=columns,
        size_y=rows,
        data=np.asarray(costs, np.uint8).ravel(),
    )
    topic = "/global_costmap/costmap_raw_updates"
    recorder.bag.add(topic, "nav2_msgs/CostmapUpdate", message, stamp)


def beside(tmp_path, robot, path):
    log = shadowed(path, robot, tmp_path / "log.mcap", ["recording.decision_period=0.1"])
    (topic,), (own,) = zip(*verdict_on(log).own_maps.items(), strict=True)
    return log, topic, own


@pytest.mark.parametrize("kind", ["raw", "translated"])
def test_what_each_calls_the_cells_is_counted(tmp_path, robot, kind):
    costs = np.zeros((ROWS, COLUMNS), int)
    costs[20:30, 10:20] = 254  # x -0.5 to 0.5, y -0.5 to 0.5: where the robot stands
    costs[20:25, 22:24] = 255
    log, topic, own = beside(tmp_path, robot, recorded(tmp_path, costs, kind))
    assert topic == "/global_costmap/costmap" + "_raw" * (kind == "raw")
    assert own.maps == 1
    admitted, blocked = own.cells["admitted"], own.cells["blocked"]
    assert sum(row["lethal"] for row in own.cells.values()) == 100
    assert sum(row["unknown"] for row in own.cells.values()) == 10
    assert 20 <= admitted["lethal"] <= 100
    assert blocked["lethal"] == 0
    assert blocked["free"] >= 20  # the pillar, and its inflation
    text = f"of {sum(admitted.values())} that we admit it has {admitted['lethal']} lethal"
    assert text in own.text
    page = tmp_path / "page.html"
    write_page(log, page)
    assert f"<td>{topic}</td><td>blocked</td>" in page.read_text()


def test_an_update_changes_a_part_of_the_last_map(tmp_path, robot):
    costs = np.zeros((ROWS, COLUMNS), int)
    path = recorded(tmp_path, costs, updated=(10, 20, np.full((10, 10), 254)))
    _, _, own = beside(tmp_path, robot, path)
    assert own.maps == 2
    assert sum(row["lethal"] for row in own.cells.values()) == 100


def test_a_map_in_an_unknown_frame_is_counted(tmp_path, robot):
    recorder = Recorder(Plan(sensor="scan", turn=0.0), 0)
    grid(recorder, np.zeros((ROWS, COLUMNS), int), "raw")
    recorder.bag.messages = recorder.bag.messages[1:]
    log = shadowed(recorder.record(tmp_path / "bag"), robot, tmp_path / "log.mcap")
    found = verdict_on(log)
    assert found.own_maps == {}
    assert "1 costmap: no transform to the frame of the poses" in found.faults
