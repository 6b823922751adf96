"""Limits of how many messages a file may hold."""

import pytest

from wayproof.harness.log.codec import census
from wayproof.harness.log.codec.census import Census
from wayproof.harness.log.codec.fields import Broken


def test_a_large_file_may_hold_so_many_and_no_more(monkeypatch):
    monkeypatch.setattr(census, "MOST_MESSAGES", 30)
    monkeypatch.setattr(census, "MOST_DECISIONS", 10)
    counts = Census(2**40)
    for _ in range(10):
        counts.count("wayproof.Decision", "/decision", 100)
    with pytest.raises(Broken, match="11 decisions, expected at most 10"):
        counts.count("wayproof.Decision", "/decision", 100)
    for _ in range(19):
        counts.count("wayproof.Perturbation", "/perturbation", 100)
    with pytest.raises(Broken, match="31 messages, expected at most 30"):
        counts.count("wayproof.Perturbation", "/perturbation", 100)
