"""What a study says, on hand-made rows and on simulated studies with known effects."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.harness.study.here import paired
from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.analysis import pair, samples_of, summarise
from wayproof.harness.study.gate import read_gate
from wayproof.harness.study.gates import judge, verdict_of
from wayproof.harness.study.plan import Arm
from wayproof.harness.study.rows import Row, first_difference, prove, share_differing, write_table

CLEAN = Arm("warehouse", "drone", "", "none", 0)
DRIFT = Arm("warehouse", "drone", "", "pose_drift", 3)


def row(arm: Arm, seed: int, outcome: str = "success", **changes: object) -> Row:
    metrics = {**dict.fromkeys(METRICS), "success": float(outcome == "success")}
    made = Row(f"{arm}{seed}", arm, seed, outcome, "", "", "", 20.0, metrics, (b"a", b"b", b"c"))
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


def test_an_arm_by_hand() -> None:
    rows = [row(CLEAN, seed) for seed in range(4)] + [
        row(DRIFT, 0, acts=(b"a", b"x", b"c")),
        row(DRIFT, 1, "collision", duration=5.0, acts=(b"a", b"b")),
        row(DRIFT, 2, "error", duration=0.0, acts=()),  # it never ran: no failure of the arm
        row(DRIFT, 3),
    ]
    clean, drift = summarise(samples_of(paired(rows)), time_limit=60.0)
    assert clean.against is None
    assert clean.mean_time == 20.0
    assert drift.episodes == 4
    assert drift.outcomes == {"success": 2, "collision": 1, "error": 1}
    assert drift.mean_time == pytest.approx((20 + 60 + 20) / 3)  # failures count the limit
    against = drift.against
    assert against is not None
    assert (against.pairs, against.lost, against.won) == (3, (1,), ())
    assert against.drop.estimate == pytest.approx(1 / 3)
    assert against.p_value == pytest.approx(1.0)  # 1 of 1 discordant pairs one way: 2 / 2^1
    assert against.changed == 2
    assert against.first_difference == pytest.approx(1.5)  # median of 1 and 2
    assert against.share_differing == pytest.approx((1 / 3 + 1 / 3 + 0) / 3)


def test_differences_count_to_the_end_of_the_longer() -> None:
    one, other = row(CLEAN, 0), row(CLEAN, 0, acts=(b"a", b"b", b"c", b"d"))
    assert first_difference(one, one) is None
    assert first_difference(one, other) == 3
    assert share_differing(one.acts, other.acts) == 0.25
    assert share_differing((), ()) == 0.0


def test_pairs_keep_the_failures_of_either_side() -> None:
    """Keeping the pairs in which both succeed would show no harm at all."""
    clean = [row(CLEAN, 0), row(CLEAN, 1, "timeout"), row(CLEAN, 2)]
    drift = [row(DRIFT, 2, "collision"), row(DRIFT, 1), row(DRIFT, 0), row(DRIFT, 9)]
    pairs = pair(drift, clean)
    assert [(twin.seed, one.seed) for twin, one in pairs] == [(2, 2), (1, 1), (0, 0)]


def test_severities_share_a_correction() -> None:
    arms = [dataclasses.replace(DRIFT, severity=level) for level in (1, 2)]
    rows = [row(CLEAN, seed) for seed in range(8)]
    rows += [row(arms[0], seed) for seed in range(8)]
    rows += [row(arms[1], seed, "collision") for seed in range(8)]
    _, mild, harsh = summarise(samples_of(paired(rows)), 60.0)
    assert mild.against is not None
    assert harsh.against is not None
    assert harsh.against.p_value == pytest.approx(2 / 2**8)
    assert harsh.against.p_adjusted == pytest.approx(4 / 2**8)
    assert mild.against.p_adjusted == 1.0


@pytest.mark.parametrize(
    ("gate", "low", "high", "verdict"),
    [
        ("success.drop <= 0.05", -0.1, 0.04, "held"),
        ("success.drop <= 0.05", -0.1, 0.10, "inconclusive"),
        ("success.drop <= 0.05 proven", -0.1, 0.10, "inconclusive"),
        ("time_stopped.rise <= 2", -np.inf, np.inf, "inconclusive"),
        ("success.drop <= 0.05", 0.06, 0.30, "failed"),
        ("success.mean >= 0.9", 0.91, 1.0, "held"),
        ("success.mean >= 0.9", 0.5, 0.89, "failed"),
        ("success.mean >= 0.9", 0.5, 0.95, "inconclusive"),
    ],
)
def test_verdicts(gate: str, low: float, high: float, verdict: str) -> None:
    assert verdict_of(read_gate(gate), Interval((low + high) / 2, low, high)) == verdict


def test_a_against_a_gates_wrongly_in_at_most_one_of_twenty() -> None:
    """The same stack on other seeds, five severities at once: nothing has got worse."""
    generator = np.random.default_rng(3)
    gate = read_gate("success.drop <= 0")
    arms = [dataclasses.replace(DRIFT, severity=level) for level in range(1, 6)]
    wrong = 0
    for _ in range(300):
        reached = generator.random((6, 50)) < 0.85
        rows = [
            row(arm, seed, "success" if reached[k, seed] else "collision")
            for k, arm in enumerate([CLEAN, *arms])
            for seed in range(50)
        ]
        wrong += any(
            result.verdict == "failed" for result in judge(samples_of(paired(rows)), [gate])
        )
    assert wrong / 300 <= 0.05


def test_a_real_drop_is_found() -> None:
    generator = np.random.default_rng(4)
    rows = [row(CLEAN, seed) for seed in range(100)]
    rows += [
        row(DRIFT, seed, "collision" if generator.random() < 0.3 else "success")
        for seed in range(100)
    ]
    [result] = judge(samples_of(paired(rows)), [read_gate("success.drop <= 0.05")])
    assert result.verdict == "failed"
    assert result.interval.low > 0.05


LIDAR, POSE = b"lidar...", b"pose...."


def hashed(arm: Arm, seed: int, *hashes: bytes, declared: tuple[str, ...] = ()) -> Row:
    """Streams `sensor/lidar`, `pose` and `control`; eight bytes each a decision."""
    streams = ("sensor/lidar", "pose", "control")
    return row(arm, seed, hashes=hashes, streams=streams, declared=declared)


def test_streams_are_compared_up_to_the_first_other_action() -> None:
    same, moved = b"0" * 24, b"0" * 16 + b"moved..."
    twin = hashed(CLEAN, 0, same, same, same)
    drift = hashed(
        DRIFT, 0, same, b"0" * 8 + POSE + b"0" * 8, LIDAR + moved[8:], declared=("pose",)
    )
    proof = prove(drift, twin)
    assert proof is not None
    assert proof.pairing.changed == {"pose"}  # the lidar saw other things only after it had moved
    assert (proof.pairing.compared, proof.pairing.first_action) == (2, 2)
    assert proof.undeclared == ()
    leak = hashed(DRIFT, 1, LIDAR + b"0" * 16, declared=("pose",))
    other = prove(leak, hashed(CLEAN, 1, same))
    assert other is not None
    assert other.undeclared == ("sensor/lidar",)
    assert prove(row(DRIFT, 2), twin) is None
    rows = [twin, drift, hashed(CLEAN, 1, same), leak]
    against = summarise(samples_of(paired(rows)), 60.0)[1].against
    assert against is not None
    assert (against.proven, against.undeclared) == (1, (1,))
    assert against.streams == ("pose", "sensor/lidar")


def test_a_table_says_of_each_pair_which_inputs_differ(tmp_path: Path) -> None:
    same = b"0" * 24
    rows = [
        hashed(CLEAN, 0, same),
        hashed(DRIFT, 0, b"0" * 8 + POSE + b"0" * 8, declared=("pose",)),
        row(DRIFT, 1, "error"),
    ]
    write_table(paired(rows), tmp_path / "table.parquet")
    [clean, drift, error] = pq.read_table(tmp_path / "table.parquet").to_pylist()
    assert clean["streams_changed"] is None
    assert (drift["streams_changed"], drift["streams_undeclared"]) == (["pose"], [])
    assert (drift["decisions_compared"], drift["first_other_action"]) == (1, None)
    assert error["decisions_compared"] is None
    assert drift["severity"] == 3.0
