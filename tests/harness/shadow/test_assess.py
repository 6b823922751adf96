"""What a recording shows, on corridors whose answer is known."""

import numpy as np
import pytest

from tests.harness.shadow.conftest import shadowed, verdict_on, written
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import RecordedSweep
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.assess import Passed
from wayproof.harness.shadow.batches import batches
from wayproof.harness.shadow.legs import Leg
from wayproof.harness.shadow.summary import stops_of

STRAIGHT = [(0.1 * k, 0.0, 0.0) for k in range(40)]


def judged(tmp_path, robot, poses, settings=(), **world):
    recording = written(tmp_path / "corridor.clf", poses, **world)
    return verdict_on(shadowed(recording, robot, tmp_path / "corridor.mcap", settings))


def test_a_corridor_that_the_laser_saw_is_admitted_throughout(tmp_path, robot):
    summary = judged(tmp_path, robot, STRAIGHT)
    assert summary.verdict == "admitted"
    assert summary.admitted_share == 1.0
    assert summary.driven_m == pytest.approx(3.9, abs=0.06)
    assert summary.places == ()
    assert summary.least_clearance_m == pytest.approx(0.75, abs=0.11)  # 1 m to the wall, less 0.25
    assert summary.ahead_share == 1.0


def test_backing_into_space_that_no_beam_met_is_unknown(tmp_path, robot):
    poses = [(-0.1 * k, 0.0, 0.0) for k in range(20)]  # it looks ahead and drives back
    summary = judged(tmp_path, robot, poses)
    assert summary.verdict == "not admitted"
    assert summary.places[0].why == "unknown"
    assert summary.places[0].cells[0].place[0] < 0.0  # behind it
    assert summary.admitted_share < 0.5


def test_driving_over_what_was_seen_is_occupied_and_passing_it_is_margin(tmp_path, robot):
    over = judged(tmp_path, robot, STRAIGHT, block=(2.5, 0.0))
    assert "occupied" in over.refused_m
    past = judged(tmp_path, robot, STRAIGHT, block=(2.5, 0.5))
    assert set(past.refused_m) == {"margin"}
    assert past.least_clearance_m > 0.0 > over.least_clearance_m


def test_what_was_seen_long_ago_is_stale_and_never_unknown(tmp_path, robot):
    # It looks down the corridor, turns round, waits for a long time, and drives back into it.
    turn = [(0.0, 0.0, yaw) for yaw in np.linspace(0.0, np.pi, 10)]
    wait = [(0.0, 0.0, np.pi)] * 60
    back = [(0.1 * k, 0.0, np.pi) for k in range(1, 25)]
    poses = [(0.0, 0.0, 0.0)] * 5 + turn + wait + back
    settings = ["map.half_life=1.0"]
    summary = judged(tmp_path, robot, poses, settings)
    assert summary.refused_m["stale"] > 1.0
    assert "unknown" not in summary.refused_m
    kept = judged(tmp_path, robot, poses, ["map.half_life=0"])
    assert kept.verdict == "admitted"


@pytest.mark.parametrize(
    ("poses", "period", "reason"),
    [
        ([(0.01 * (k % 3), 0.005 * (k % 2), 0.0) for k in range(30)], 0.2, "never moved"),
        (STRAIGHT[:1], 0.2, ""),
        ([STRAIGHT[0], STRAIGHT[20]], 5.0, "; 2.00 m without poses were not judged"),  # a gap
    ],
)
def test_a_robot_that_stands_is_seen_once_or_is_lost_shows_nothing(
    tmp_path, robot, poses, period, reason
):
    summary = judged(tmp_path, robot, poses, period=period)
    assert summary.verdict == "nothing shown"
    assert summary.admitted_share is None
    assert reason in summary.reason
    assert len(poses) > 2 or summary.ahead_share is None
    assert len(poses) > 1 or summary.decisions == 1


def test_cells_that_are_occupied_in_the_end_are_hindsight(tmp_path, robot):
    free = written(tmp_path / "free.clf", STRAIGHT)
    late = written(tmp_path / "late.clf", [(0.5, 0.0, 0.0)] * 10, block=(2.0, 0.0))
    later = [line for line in late.read_text().splitlines(keepends=True) if "FLASER" in line]
    moved = []
    for number, line in enumerate(later):  # somebody stands there after the robot has passed
        words = line.split()
        words[-3] = words[-1] = f"{200.0 + 0.2 * number:.3f}"
        moved.append(" ".join(words) + "\n")
    both = tmp_path / "both.clf"
    both.write_text(free.read_text() + "".join(moved))
    summary = verdict_on(shadowed(both, robot, tmp_path / "both.mcap"))
    assert summary.hindsight_m > 0.2
    assert summary.hindsight_admitted_m > 0.2


def test_the_way_within_a_gap_of_the_poses_is_neither_driven_nor_admitted(tmp_path, robot):
    path = written(tmp_path / "gap.clf", STRAIGHT)
    lines = path.read_text().splitlines(keepends=True)
    after = [line.replace(" 10", " 11") for line in lines[32:]]  # 10 s later, from 3.0 m on
    path.write_text("".join(lines[:22] + after))  # up to 1.9 m
    log = shadowed(path, robot, tmp_path / "gap.mcap")
    summary = verdict_on(log)
    assert summary.unrecorded_m == pytest.approx(1.1)
    assert summary.driven_m == pytest.approx(1.9 + 0.9, abs=0.11)
    assert summary.verdict == "admitted"
    assert summary.reason.endswith("entered; 1.10 m without poses were not judged")
    assert summary.moving_s < 6.0
    assert contradictions(open_log(log)) == []


def test_no_decision_is_made_on_sweeps_of_both_sides_of_a_gap():
    directions, ranges = np.array([[1.0, 0.0, 0.0]]), np.ones(1, np.float32)
    mount = Transform(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    sweeps = [
        RecordedSweep(stamp, "scan", directions, ranges, None, mount) for stamp in (0, 10, 12, 50)
    ]
    assert [batch.time_ns for batch in batches(sweeps, 8)] == [0, 10, 50]
    cut = batches(sweeps, 8, has_gap=lambda begin, end: begin < 40 < end)
    assert [(batch.time_ns, len(batch.sweeps)) for batch in cut] == [
        (0, 1),
        (10, 1),
        (12, 1),
        (50, 1),
    ]


def passed(time_s, action):
    decision = pb.Decision(sequence=round(10 * time_s), action=action, reason="because")
    decision.timestamp.FromNanoseconds(round(time_s * 1e9))
    decision.trajectory.path.add(x=1.0, y=2.0)
    return Passed(decision, np.zeros(4), 1.0, None)


def leg(begin_s, end_s, length_m):
    begin_ns, end_ns = round(begin_s * 1e9), round(end_s * 1e9)
    return Leg(0, begin_ns, end_ns, np.zeros((2, 4)), length_m, True, "", ())


def test_only_the_time_in_which_the_robot_moved_counts_as_stopped():
    actions = ["follow", "stop_and_wait", "stop_and_wait", "follow", "abort", "follow"]
    decisions = [passed(float(k), action) for k, action in enumerate(actions)]
    moving, stops = stops_of(decisions, [leg(0.0, 3.0, 1.0), leg(3.0, 5.0, 0.05)])
    assert moving == pytest.approx(3.0)  # the second leg took two seconds for a step
    assert [(stop.sequence, stop.seconds) for stop in stops] == [(10, pytest.approx(2.0))]
    assert stops[0].position == (1.0, 2.0, 0.0)
