"""Falls over the end of the floor: where it ends, and what the map held there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case
from wayproof.harness.attribution.commanded import commands_to
from wayproof.harness.attribution.contact_facts import last_chance
from wayproof.harness.decision import path_of
from wayproof.harness.log.paths import densely
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]

STRIDE = 0.5
"""Length of the path beyond the end of the floor in which the map is looked at, m."""

SPACING = 0.02
"""Distance of the points of a path at which floor is looked for, m."""

STATES = ((OCCUPIED, "blocked"), (UNKNOWN, "unknown"), (FREE, "admitted"))
"""States of the map, and the verdict of a referee on each."""

HELD = {
    "blocked": (
        "disregarded_obstacle",
        "where the map held a hole at decision {}, and the path led over it",
    ),
    "unknown": (
        "unseen_obstacle",
        "in space that was unknown at decision {}, and the path led into it",
    ),
    "admitted": ("missed_obstacle", "where the map held free space at decision {}"),
}
"""Cause of a fall by the verdict on what lay beyond the edge, and what that was, in words."""


@dataclass(frozen=True)
class FloorEdge:
    """The end of the floor on the path of a robot that fell.

    Attributes:
        place: (x, y, z) on the true path, the first point without floor below it, m.
        decision: Number of the last decision after which the body could have stopped before it.
        verdict: What the map held beyond: `blocked`, `unknown` or `admitted`; of a stack on trial
            that the referee did not admit, its verdict.
        commands: Numbers of the commands not admitted that a stack on trial was followed in.
    """

    place: tuple[float, float, float]
    decision: int
    verdict: str
    commands: tuple[int, ...]

    @property
    def cause(self) -> str:
        """Cause of the fall."""
        return HELD[self.verdict][0]

    def __str__(self) -> str:
        """Say where the floor ends, what was held of it, and who went there all the same."""
        x, y, _ = self.place
        held = HELD[self.verdict][1].format(self.decision)
        against = ""
        if self.commands:
            against = f"; {len(self.commands)} commands, from {self.commands[0]} on, not admitted"
        return f"the floor ends at ({x:.2f}, {y:.2f}), {held}{against}"


def floor_edge(case: Case) -> FloorEdge | None:
    """Return the end of the floor that a robot walked over; None if it did not fall there.

    Its path led over it: a robot that leaves a path over floor, and falls, did not track it.
    """
    last = case.moments[-1]
    trajectory = case.followed(last.time_ns)
    if case.outcome != "fall" or not case.mission.planar or trajectory is None:
        return None
    path = densely(path_of(trajectory.path), SPACING) - last.error
    path[:, 2] = 0.0
    if case.space.terrain(path[:1, :2]) is not None:
        return None  # on hills the floor is not at one height
    gone = np.flatnonzero(~case.space.borne(path))
    if not len(gone):
        return None
    place = path[gone[0]]
    if np.linalg.norm((place - last.true_position)[:2]) > case.mission.radius + _gone_on(case):
        return None  # it fell before
    number = last_chance(case, place, case.end_s)
    commands = commands_to(case, case.end_s)
    if commands:
        number = max(number, commands[0])
    x, y, z = place.tolist()
    verdict = case.moments[number].decision.verdict.verdict
    if verdict not in ("blocked", "unknown"):
        beyond = path[gone[0] :][np.linalg.norm(path[gone[0] :] - place, axis=1) <= STRIDE]
        verdict = _held(case.navigator_at(number), beyond + case.moments[number].error)
    return FloorEdge((x, y, z), number, verdict, commands)


def _gone_on(case: Case) -> float:
    """Return the way of the body from the last decision to the end, m."""
    last = case.moments[-1]
    speed = float(np.linalg.norm(np.array(last.truth.velocity)[:2]))
    return speed * (case.end_s - last.time_ns * 1e-9)


def _held(navigator: Navigator, believed: Array) -> str:
    """Return what most of a costmap's cells at places (n, 3) are, as a verdict."""
    costmap = navigator.costmap
    cells = np.floor((believed - costmap.origin) / costmap.resolution).astype(int)[:, :2]
    cells = np.unique(np.clip(cells, 0, np.array(costmap.shape[:2]) - 1), axis=0)
    states = costmap.state[cells[:, 0], cells[:, 1], 0]
    counts = [int((states == state).sum()) for state, _ in STATES]
    return STATES[int(np.argmax(counts))][1]
