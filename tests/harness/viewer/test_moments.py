"""Decisions of a log with the map of each."""

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.fork import fork
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.moments import moments


def test_each_moment_has_the_map_that_its_decision_names(failed):
    log, seen = failed, 0
    for moment in moments(open_log(log)):
        assert moment.map.version() == moment.decision.map_version
        assert moment.truth.sequence == moment.decision.sequence
        assert moment.costmap.inflation_radius == moment.decision.inflation_radius_m
        seen += 1
    assert seen == int(open_log(log).result["decisions"])


def test_a_costmap_used_only_now_and_then_is_the_same(failed):
    each = [moment.costmap.state.copy() for moment in moments(open_log(failed))]
    fields = [moment.costmap.obstacle_clearance.copy() for moment in moments(open_log(failed))]
    for place, moment in enumerate(moments(open_log(failed))):
        if place % 3 == 2:
            np.testing.assert_array_equal(moment.costmap.state, each[place])
            np.testing.assert_array_equal(moment.costmap.obstacle_clearance, fields[place])


@pytest.mark.large
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


def test_a_decision_without_truth_is_an_error_at_its_place(tmp_path, log):
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
        pairs = open_log(out).records_with_truth()
        for sequence in range(lost):
            record, truth = next(pairs)
            assert record.decision.sequence == truth.sequence == sequence
        with pytest.raises(InputError, match=f"decision {lost} without its truth"):
            next(pairs)


def test_hits_lie_on_obstacles_and_are_thinned(log):
    moment = next(moments(open_log(log)))
    hits = moment.hits(100)
    assert 20 < len(hits) <= 100 + len(moment.record.inputs.sweeps)
    mission = open_log(log).mission
    low, high = np.array(mission.low) - 0.3, np.array(mission.high) + 0.3
    assert ((hits[:, :2] >= low[:2]) & (hits[:, :2] <= high[:2])).all()
