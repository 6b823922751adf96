"""Distances from the volumes of cells, against values computed by hand."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.judge.body import Body
from wayproof.harness.judge.volumes import segment_from_boxes
from wayproof.harness.log.reader import Record
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.committed import Committed, standing_at_start
from wayproof.harness.replay.audit.volumes import (
    Volumes,
    measure,
    shortfall,
    together,
)
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import VoxelMap

UNIT = np.zeros((1, 2)), np.ones((1, 2))
CUBE = np.zeros((1, 3)), np.ones((1, 3))


@pytest.mark.parametrize(
    ("a", "b", "box", "distance"),
    [
        ((2.0, -1.0), (2.0, 2.0), UNIT, 1.0),  # along a face
        ((2.0, 2.0), (3.0, 3.0), UNIT, math.sqrt(2.0)),  # away from a corner
        ((0.5, 2.5), (2.5, 0.5), UNIT, math.sqrt(0.5)),  # past a corner
        ((-1.0, 0.5), (2.0, 0.6), UNIT, 0.0),  # through
        ((1.3, 0.5), (1.3, 0.5), UNIT, 0.3),  # a point
        ((0.5, 1.5, 1.5), (0.5, 3.0, 3.0), CUBE, math.sqrt(0.5)),  # away from an edge
        ((2.0, 0.5, 1.0), (0.5, 0.5, 2.5), CUBE, math.sqrt(0.5)),  # past an edge
        ((2.0, 2.0, 2.0), (3.0, 2.0, 2.0), CUBE, math.sqrt(3.0)),
    ],
)
def test_a_segment_and_a_box_by_hand(a, b, box, distance):
    assert segment_from_boxes(np.array(a), np.array(b), *box) == pytest.approx(distance)


def test_a_segment_and_boxes_against_points_on_it():
    rng = np.random.default_rng(1)
    for axes in (2, 3):
        low = rng.uniform(-3.0, 3.0, (20, axes))
        high = low + rng.uniform(0.1, 1.0, (20, axes))
        for _ in range(20):
            a, b = rng.uniform(-4.0, 4.0, (2, axes))
            points = a + np.linspace(0.0, 1.0, 2001)[:, None] * (b - a)
            beyond = np.maximum(low - points[:, None], points[:, None] - high).clip(0.0)
            least = np.sqrt((beyond**2).sum(axis=-1)).min()
            exact = segment_from_boxes(a, b, low, high)
            assert least - math.dist(a, b) / 4000 <= exact <= least + 1e-12


def on_its_way(motion, radius, free, way):
    """A round body on its way through boxes of free space."""
    mission = Mission(
        motion, radius, 0.4, 0.03, 2.0, 2.0, 10.0, 1.0,
        (-3.0, -3.0, -0.2), (3.0, 3.0, 3.0), (0.0, 0.0, 1.0), 0.0, (2.0, 0.0, 1.0),
    )  # fmt: skip
    config = Config("empty", "drone", 1)
    voxel_map = VoxelMap(config.map, mission.low, mission.high)
    for low, high in free:
        voxel_map.mark_floor(low, high, 0)
        voxel_map.mark_free((*low, 0.0 if motion == "ground" else -0.5), (*high, 2.5), 0)
    trajectory = pb.Trajectory(
        path=[pb.Point(x=x, y=y, z=1.0) for x, y in way],
        arc_length=[0.0, 0.1],
        heading=[0.0, 0.0],
        sample_period_s=0.1,
    )
    pose = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), position_sigma=0.0)
    decision = pb.Decision(action="follow", trajectory=trajectory)
    record = Record(Inputs(0, 1, pose, (), ""), pb.Latency(), decision)
    body = Body(config, mission, "forbid")
    before = (standing_at_start(mission),)
    return Committed(record, config, mission, voxel_map, voxel_map, "", body, before)


def test_past_a_wall_in_the_air():
    """The ball of 0.21 m with a margin of 0.1 m may be in the fourth cell from the wall at 1 m."""
    free = [((-2.0, -2.0), (1.0, 2.0))]
    far = on_its_way("air", 0.21, free, [(0.62, -0.5), (0.62, 0.5)])
    near = on_its_way("air", 0.21, free, [(0.62, -0.5), (0.695, 0.0), (0.62, 0.5)])
    assert all(
        one.body.first_blocked(one.map, one.poses, one.margin) is None for one in (far, near)
    )
    assert shortfall(far, far.body.discs) == pytest.approx(0.31 - 0.38)
    assert shortfall(near, near.body.discs) == pytest.approx(0.31 - 0.305)
    assert measure(far) == Volumes(1, 0, 0.0, pytest.approx(0.05 * math.sqrt(3.0)), 0)
    assert measure(near).greatest_m == pytest.approx(0.005)


def test_past_a_corner_in_the_air():
    """Three cells away along both axes: 0.424 m between the centres, 0.284 m from the edge."""
    free = [((-2.0, -2.0), (1.0, 2.0)), ((-2.0, -2.0), (2.0, 1.0))]
    moment = on_its_way("air", 0.21, free, [(0.72, 0.72), (0.799, 0.799), (0.72, 0.74)])
    assert moment.body.first_blocked(moment.map, moment.poses, moment.margin) is None
    missing = 0.31 - math.sqrt(2.0) * 0.201
    assert shortfall(moment, moment.body.discs) == pytest.approx(missing)
    assert measure(moment) == Volumes(
        1, 1, pytest.approx(missing), pytest.approx(0.05 * math.sqrt(3.0)), 0
    )


def test_past_a_column_on_the_ground():
    """One column of which nothing is known, three and four cells away: a square, at any height."""
    whole = [(-2.0, 1.0), (1.0, 1.1), (1.1, 2.0)]
    free = [((x[0], y[0]), (x[1], y[1])) for x in whole for y in whole if (x, y) != (whole[1],) * 2]
    moment = on_its_way("ground", 0.3, free, [(0.72, 0.62), (0.799, 0.699)])
    assert moment.body.first_blocked(moment.map, moment.poses, moment.margin) is None
    assert shortfall(moment, moment.body.discs) == pytest.approx(0.4 - math.hypot(0.201, 0.301))
    closer = on_its_way("ground", 0.3, free, [(0.72, 0.72), (0.799, 0.799)])
    assert closer.body.first_blocked(closer.map, closer.poses, closer.margin) is not None


def test_parts_add_up():
    parts = [Volumes(3, 1, 0.02, 0.07, 0), Volumes(4, 2, 0.01, 0.09, 1)]
    assert together(parts) == Volumes(7, 3, 0.02, 0.09, 1)
    assert together([]) == Volumes()


def test_the_command_measures_volumes(recorded, capsys):
    log = Path(recorded("corridor", "quadruped", 1, "episode.time_limit=2").log)
    assert main(["audit", str(log), "--volumes", "--json"]) == 0
    volumes = json.loads(capsys.readouterr().out)["volumes"]
    assert volumes["paths"] > 0
    assert volumes["greatest_m"] <= volumes["bound_m"] == pytest.approx(0.0707, abs=0.02)
    assert main(["audit", str(log), str(log), "--volumes"]) == 0
    assert "volumes, 2 logs: " in capsys.readouterr().out
