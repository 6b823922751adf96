from __future__ import annotations

import numpy as np

from tests.tools.statistics.verdicts import CHANGES, compared, share_failing, study_of
from wayproof.harness.cli.compare import DEFAULT_GATES
from wayproof.harness.study.gate import read_gate


def test_a_against_a_hardly_ever_fails_a_default_gate() -> None:
    """`python -m tests.tools.statistics alarms` has all studies and sizes."""
    for name in ("compare", "baseline"):
        for clusters in (2, 10):
            assert share_failing(name, *study_of(name), clusters, repeats=60, seed=1) <= 0.05


def test_what_is_broken_is_never_green_on_few_worlds_and_seen_on_many() -> None:

    before, after, text = CHANGES["success 0.95 to 0.75"]
    generator = np.random.default_rng(0)
    verdicts = [compared(generator, before, after, 50, read_gate(text)).verdict for _ in range(60)]
    assert verdicts.count("failed") >= 45
    broken = [
        compared(generator, before, after, k, read_gate(DEFAULT_GATES[0])).verdict
        for k in (2, 3, 5, 10, 25)
        for _ in range(20)
    ]
    assert broken.count("held") == 0
