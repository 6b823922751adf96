"""Goals of a mission: the one of a decision, as a message, and the distance left.

The robot claims each goal by a decision of its own, at rest and near enough by the truth; the next
decision leads to the next goal. So the decisions in a log say how many were reached. In a mission
with several goals the goal of each decision is an input in the log.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb

Array = NDArray[np.float64]


def goals_claimed(decisions: Iterable[pb.Decision]) -> int:
    """Return the number of goals that decisions claim."""
    return len([one for one in decisions if one.action == "goal"])


def goals_before_last(decisions: Sequence[pb.Decision]) -> int:
    """Return the number of goals reached before the last decision: the index of its goal."""
    return goals_claimed(decisions[:-1])


def goals_reached(decisions: Sequence[pb.Decision], outcome: str) -> int:
    """Return the number of goals reached in an episode; only a false claim ends it as `aborted`."""
    false = outcome == "aborted" and bool(decisions) and decisions[-1].action == "goal"
    return goals_claimed(decisions) - false


def goal_message(mission: Mission, reached: int, sequence: int, time_ns: int) -> pb.Goal | None:
    """Return the goal of a decision as an input; None of a mission with one goal.

    Args:
        mission: Mission with all goals.
        reached: Number of goals reached before the decision.
        sequence: Number of the decision.
        time_ns: Its simulated time, ns.
    """
    if not mission.waypoints:
        return None
    message = pb.Goal(sequence=sequence, position=mission.goals[reached], index=reached)
    message.timestamp.FromNanoseconds(time_ns)
    return message


def mission_towards(mission: Mission, goal: ArrayLike | None) -> Mission:
    """Return the mission with one decision's goal, (3,) m, as its only one; unchanged without."""
    if goal is None:
        return mission
    x, y, z = (float(value) for value in np.asarray(goal))
    return replace(mission, goal=(x, y, z), waypoints=())


def leg_towards(mission: Mission, goal: pb.Goal | None) -> Mission:
    """Return the mission from the goal before, or the start, to the goal of one decision."""
    if goal is None:
        return mission
    leg = mission_towards(mission, goal.position)
    before = mission.goals[: goal.index]
    return replace(leg, start=before[-1]) if before else leg


def distance_left(mission: Mission, reached: int, position: Array) -> float:
    """Return the straight distance from (3,) to the next goal and on through the others, m.

    In the plane for a ground robot.

    Args:
        mission: Mission with all goals.
        reached: Number of goals reached.
        position: Position of the base, m.
    """
    axes = mission.axes
    left = [np.array(goal[:axes]) for goal in mission.goals[reached:]]
    way = 0.0
    for a, b in pairwise([position[:axes], *left]):
        way += distance(a, b)  # `sum` rounds by the version of Python
    return way


def distance(a: Array, b: Array) -> float:
    """Return the distance of two points; not by `math.dist`, whose last bit varies by version."""
    return float(np.sqrt(np.square(a - b).sum()))


def goal_name(mission: Mission, reached: int) -> str:
    """Return the next goal in words: `the goal`, or `goal 2 of 3`."""
    count = len(mission.goals)
    return "the goal" if count == 1 else f"goal {min(reached + 1, count)} of {count}"
