"""Soak of the stack interface."""

from tests.tools.soak import interface
from tests.tools.soak.interface import soak_interface

BRIEF = ("episode.time_limit=1",)


def test_the_built_in_stack_is_the_same_by_every_way_in(monkeypatch):
    monkeypatch.setattr(interface, "ROBOTS", ("drone",))
    compared = soak_interface(1, 2, print, settings=BRIEF)
    assert compared.failures == []
    assert (compared.episodes, compared.same_chains) == (1, 1)
    assert compared.same_decisions == compared.decisions > 5
    assert compared.outcomes == {"timeout": 1}


def test_another_stack_is_found(monkeypatch):
    monkeypatch.setattr(interface, "ROBOTS", ("drone",))
    monkeypatch.setattr(interface, "BEHIND_EXEC", interface.ON_TRIAL)  # which is quicker
    monkeypatch.setattr(interface, "ON_TRIAL", "gap")
    compared = soak_interface(1, 2, print, settings=BRIEF)
    assert compared.same_chains == 0
    assert compared.same_decisions < compared.decisions
    assert "chain " in compared.failures[0]
    assert "other decisions, the first at 0" in compared.failures[1]
