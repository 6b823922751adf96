"""Faults of change: something moves in, or leaves and stays in the map."""

from __future__ import annotations

from dataclasses import replace

from tests.tools.faults.breaks.broken import (
    CLEAR_OF_ENDS,
    Broken,
    Kind,
    Rng,
    crossing_axis,
    place_ahead,
    place_between,
    wall_across,
    with_movers,
)
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.worlds import Box, Mover

HERE = ((0.0, 0.0, 0.0),)
"""Route of a mover that does not move."""

PANELS = 6
"""Number of panels of an appearing wall: each keeps its own distance from the robot."""

UNLEARNS_SLOWLY = ("map.log_odds_miss=0.01", "map.half_life=0")
RESIGNED = ("behaviour.max_recoveries=1",)
"""Settings for a single exploration before the stack gives up."""


def _crowd(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let people walk to and fro across the path."""
    return Broken(perturbation=f"motion:{rng.uniform(3.0, 5.0):.2f}")


def _truck(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let a truck drive along the path and never stop."""
    mission = sound.mission
    (x0, y0, _), (x1, y1, _) = mission.goal, mission.start
    body = Box((0.0, 0.0, 1.4), (0.4, rng.uniform(0.6, 1.2), 1.2), 0.0, "vehicle")
    ways = ((float(x0), float(y0), 0.0), (float(x1), float(y1), 0.0))
    truck = Mover("truck", (body,), ways, rng.uniform(1.5, 3.0), returns=False, stands_off=0.0)
    return Broken(world=with_movers(sound.world, truck))


def _shut(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Shut a gate across the path while the robot is under way."""
    at, when = place_between(sound, rng), float(rng.uniform(0.5, 2.0))
    return Broken(world=with_movers(sound.world, *_appearing(sound, at, when)))


def _drop(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Drop a curtain close in front of the robot at its full speed."""
    mission = sound.mission
    speed, push = mission.max_speed, mission.max_acceleration
    when = float(rng.uniform(1.0, 1.6)) * (speed / push + push / mission.max_jerk)
    gone = speed * when - 0.5 * speed * speed / push
    at = place_ahead(sound, gone + mission.radius + float(rng.uniform(0.3, 0.6)))
    return Broken(world=with_movers(sound.world, *_appearing(sound, at, when)))


def _appearing(sound: Scenario, at: float, when: float) -> list[Mover]:
    """Return the panels of a wall across the path that appears at a time, s."""
    axis = crossing_axis(sound)
    low, high = sound.world.low[1 - axis], sound.world.high[1 - axis]
    ends = [low + (high - low) * k / PANELS for k in range(PANELS + 1)]
    movers = []
    for k in range(PANELS):
        panel = wall_across(sound, at, kind="curtain", low=ends[k], high=ends[k + 1])
        x, y, z = panel.centre
        panel = replace(panel, centre=(0.0, 0.0, z))
        name, route = f"panel_{k}", ((x, y, 0.0),)
        movers.append(Mover(name, (panel,), route, stands_off=0.0, appears=round(when, 2)))
    return movers


def _retentive(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Remove a wall before the start, in a map that hardly forgets it."""
    at = place_ahead(sound, CLEAR_OF_ENDS + float(rng.uniform(0.2, 0.6)))
    wall = wall_across(sound, at, "ghost")
    gone = Mover("gone", (wall,), HERE, vanishes=round(float(rng.uniform(0.6, 1.2)), 1))
    return Broken(world=with_movers(sound.world, gone), settings=UNLEARNS_SLOWLY)


def _trails(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the map hardly forget passing movers."""
    return Broken(settings=UNLEARNS_SLOWLY)


HALLS = (("crossing", "drone"), ("ghosts", "quadruped"), ("crossing", "quadruped"))
STRAIGHT = (("corridor", "drone"), ("empty", "drone"), ("empty", "quadruped"))
OPEN = (("empty", "drone"), ("empty", "quadruped"), ("cylinders", "drone"), ("ghosts", "drone"))

KINDS = {
    "crowd": Kind("moved_obstacle", _crowd),
    "truck": Kind("moved_obstacle", _truck, (*STRAIGHT, ("office", "drone"), ("ghosts", "drone"))),
    "shut": Kind("moved_obstacle", _shut),
    "drop": Kind("moved_obstacle", _drop, OPEN),
    "retentive": Kind("ghost_obstacle", _retentive, (*OPEN, STRAIGHT[0]), RESIGNED),
    "trails": Kind("ghost_obstacle", _trails, HALLS, (*RESIGNED, "difficulty=1")),
}
