"""Faults of the stack: its search gives up, or it disregards its map."""

from __future__ import annotations

from tests.tools.faults.breaks.body import NARROW, SHORT
from tests.tools.faults.breaks.broken import Break, Broken, Kind, Rng
from wayproof.harness.attribution.reckless import Reckless, Uninflated
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.stack.pipeline import Navigator


def _hasty_search(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the search give up at once."""
    return Broken(settings=("planner.iterations=1", "planner.restarts=1", "planner.shortcuts=0"))


def _with(stack: type[Navigator]) -> Break:
    """Let another stack decide."""

    def breaks(sound: Scenario, result: Result, rng: Rng) -> Broken:
        return Broken(stack=stack)

    return breaks


BENDS = (
    ("maze", "drone"), ("office", "drone"), ("maze", "quadruped"), ("corridor", "drone"),
    ("office", "quadruped"), ("cylinders", "quadruped"), ("corridor", "quadruped"),
)  # fmt: skip

KINDS = {
    "hasty_search": Kind("planner", _hasty_search, BENDS, ("planner.name=rrtconnect",)),
    "hasty_tree": Kind("planner", _hasty_search, BENDS, ("planner.name=rrtstar",)),
    "hasty_batch": Kind("planner", _hasty_search, BENDS, ("planner.name=bitstar",)),
    "reckless": Kind("disregarded_obstacle", _with(Reckless)),
    "uninflated": Kind("disregarded_obstacle", _with(Uninflated), NARROW, SHORT),
}
