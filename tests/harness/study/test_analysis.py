"""What a study says, on hand-made rows and on simulated studies with known effects."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.harness.study.here import ARM, paired, row
from wayproof.harness.study.analysis import Sample, pair, samples_of, summarise
from wayproof.harness.study.changes import changes_of
from wayproof.harness.study.default_gates import DEFAULT_GATES
from wayproof.harness.study.gate import read_gate
from wayproof.harness.study.gates import gate_in_words, judge
from wayproof.harness.study.lost import lost_in_words, lost_of
from wayproof.harness.study.plan import Arm
from wayproof.harness.study.rows import first_difference, prove, share_differing, write_table

DRIFT = Arm("warehouse", "drone", "", "pose_drift", 3)


def ran(arm, seed, outcome="success", **known):
    """An episode of three decisions and 20 s."""
    return row(seed, arm, outcome, **{"duration": 20.0, "acts": (b"a", b"b", b"c"), **known})


def test_an_arm_by_hand():
    rows = [ran(ARM, seed) for seed in range(4)] + [
        ran(DRIFT, 0, acts=(b"a", b"x", b"c")),
        ran(DRIFT, 1, "collision", duration=5.0, acts=(b"a", b"b")),
        ran(DRIFT, 2, "error", duration=0.0, acts=()),  # it never ran: no failure of the arm
        ran(DRIFT, 3),
    ]
    clean, drift = summarise(samples_of(paired(rows)), time_limit=60.0)
    assert clean.against is None
    assert clean.mean_time == 20.0
    assert drift.episodes == 4
    assert drift.outcomes == {"success": 2, "collision": 1, "error": 1}
    assert drift.mean_time == pytest.approx((20 + 60 + 20) / 3)  # failures count the limit
    against = drift.against
    assert (against.pairs, against.lost, against.won) == (3, (1,), ())
    assert against.drop.estimate == pytest.approx(1 / 3)
    assert against.p_value == pytest.approx(1.0)  # 1 of 1 discordant pairs one way: 2 / 2^1
    assert against.changed == 2
    assert against.first_difference == pytest.approx(1.5)  # median of 1 and 2
    assert against.share_differing == pytest.approx((1 / 3 + 1 / 3 + 0) / 3)


def test_differences_count_to_the_end_of_the_longer():
    one, other = ran(ARM, 0), ran(ARM, 0, acts=(b"a", b"b", b"c", b"d"))
    assert first_difference(one, one) is None
    assert first_difference(one, other) == 3
    assert share_differing(one.acts, other.acts) == 0.25
    assert share_differing((), ()) == 0.0


def test_pairs_keep_the_failures_of_either_side():
    """Keeping the pairs in which both succeed would show no harm at all."""
    clean = [ran(ARM, 0), ran(ARM, 1, "timeout"), ran(ARM, 2)]
    drift = [ran(DRIFT, 2, "collision"), ran(DRIFT, 1), ran(DRIFT, 0), ran(DRIFT, 9)]
    pairs = pair(drift, clean)
    assert [(twin.seed, one.seed) for twin, one in pairs] == [(2, 2), (1, 1), (0, 0)]


def test_severities_share_a_correction():
    arms = [replace(DRIFT, severity=level) for level in (1, 2)]
    rows = [ran(ARM, seed) for seed in range(8)]
    rows += [ran(arms[0], seed) for seed in range(8)]
    rows += [ran(arms[1], seed, "collision") for seed in range(8)]
    _, mild, harsh = summarise(samples_of(paired(rows)), 60.0)
    assert harsh.against.p_value == pytest.approx(2 / 2**8)
    assert harsh.against.p_adjusted == pytest.approx(4 / 2**8)
    assert mild.against.p_adjusted == 1.0


LIDAR, POSE = b"lidar...", b"pose...."


def hashed(arm, seed, *hashes, declared=()):
    """Streams `sensor/lidar`, `pose` and `control`; eight bytes each a decision."""
    streams = ("sensor/lidar", "pose", "control")
    return ran(arm, seed, hashes=hashes, streams=streams, declared=declared)


def test_streams_are_compared_up_to_the_first_other_action():
    same, moved = b"0" * 24, b"0" * 16 + b"moved..."
    twin = hashed(ARM, 0, same, same, same)
    drift = hashed(
        DRIFT, 0, same, b"0" * 8 + POSE + b"0" * 8, LIDAR + moved[8:], declared=("pose",)
    )
    proof = prove(drift, twin)
    assert proof.pairing.changed == {"pose"}  # the lidar saw other things only after it had moved
    assert (proof.pairing.compared, proof.pairing.first_action) == (2, 2)
    assert proof.undeclared == ()
    leak = hashed(DRIFT, 1, LIDAR + b"0" * 16, declared=("pose",))
    other = prove(leak, hashed(ARM, 1, same))
    assert other.undeclared == ("sensor/lidar",)
    assert prove(ran(DRIFT, 2), twin) is None
    rows = [twin, drift, hashed(ARM, 1, same), leak]
    against = summarise(samples_of(paired(rows)), 60.0)[1].against
    assert (against.proven, against.undeclared) == (1, (1,))
    assert against.streams == ("pose", "sensor/lidar")


def test_a_table_says_of_each_pair_which_inputs_differ(tmp_path):
    same = b"0" * 24
    rows = [
        hashed(ARM, 0, same),
        hashed(DRIFT, 0, b"0" * 8 + POSE + b"0" * 8, declared=("pose",)),
        ran(DRIFT, 1, "error"),
    ]
    write_table(paired(rows), tmp_path / "table.parquet")
    [clean, drift, error] = pq.read_table(tmp_path / "table.parquet").to_pylist()
    assert clean["streams_changed"] is None
    assert (drift["streams_changed"], drift["streams_undeclared"]) == (["pose"], [])
    assert (drift["decisions_compared"], drift["first_other_action"]) == (1, None)
    assert error["decisions_compared"] is None
    assert drift["severity"] == 3.0


BEFORE = (0.441, 0.449, 0.372, 0.401, 0.373, 0.356, 0.404, 0.416)
AFTER = (0.050, 0.323, 0.047, 0.009, 0.004, 0.044, 0.039, 0.070)
"""Least clearances of a stack in eight worlds, and of one whose margin was cut, m."""


def sample(pairs):
    return Sample(ARM, [second for _, second in pairs], pairs, compared=True)


def scraped():
    both = enumerate(zip(BEFORE, AFTER, strict=True))
    return sample([(row(n, least_clearance=a), row(n, least_clearance=b)) for n, (a, b) in both])


def test_scraping_comes_first_and_is_decided_by_eight_worlds():
    first, *others = changes_of([scraped()], 60.0)
    assert (first.metric, first.side, first.worse, first.worlds) == ("least_clearance", "bad", 8, 8)
    assert first.before - first.after == pytest.approx(np.mean(BEFORE) - np.mean(AFTER))
    assert not any(one.side for one in others)
    assert "worse in 8 of 8 worlds" in first.in_words()
    gates = judge([scraped()], [read_gate(text) for text in DEFAULT_GATES], 60.0)
    assert gates[2].verdict == "failed", gate_in_words(gates[2])


def test_an_estimate_beyond_the_bound_says_how_many_worlds_would_show_it_broken():
    some = sample(scraped().pairs[:4])
    [gate] = judge([some], [read_gate("least_clearance.drop <= 0.1")], 60.0)
    assert gate.verdict == "inconclusive"
    assert "worlds would show it failed if the estimate stayed" in gate_in_words(gate)


def test_two_pairs_show_no_side():
    two = sample([(row(n, ate=0.0), row(n, ate=9.0)) for n in range(2)])
    assert {one.metric: one.side for one in changes_of([two], 60.0)}["ate"] == ""


def test_a_difference_too_small_to_matter_has_no_side():
    pairs = [(row(n, ate=0.1), row(n, ate=0.1001 + 1e-6 * n)) for n in range(20)]
    [change] = [one for one in changes_of([sample(pairs)], 60.0) if one.metric == "ate"]
    assert change.p_value < 0.01
    assert change.side == ""


def test_a_metric_of_neither_build_is_left_out():
    changes = changes_of([sample([(row(n), row(n)) for n in range(6)])], 60.0)
    assert {one.metric for one in changes} == {"success", "collisions"}
    assert {one.p_value for one in changes} == {1.0}


def test_unchanged_builds_seldom_show_a_difference():
    generator = np.random.default_rng(3)
    false = 0
    for _ in range(100):
        values = generator.normal(0.4, 0.1, (8, 2, 3))
        pairs = [
            tuple(row(n, least_clearance=own[0], jerk=own[1], time_to_goal=own[2]) for own in both)
            for n, both in enumerate(values)
        ]
        false += any(one.side for one in changes_of([sample(pairs)], 60.0))
    assert false <= 9  # 5, and two deviations


def test_what_was_won_before_is_lost_first_with_its_command():
    rows = [row(1, outcome="timeout"), row(2, outcome="collision"), row(3)]
    pairs = [(row(1, outcome="timeout"), rows[0]), (row(2), rows[1])]
    lost = lost_of(rows, pairs)
    assert [(one.seed, one.won_before) for one in lost] == [(2, True), (1, False)]
    assert lost_in_words(lost)[0].startswith(
        "lost (won before): warehouse drone, seed 2: collision"
    )
