"""What one decision sees, made from the costmap, the pose and the settings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.inputs import Inputs
from wayproof.harness.mission import Mission
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.spaces import FreeSpaces
from wayproof.harness.stack.types import PlanPath, View
from wayproof.planners import FreeSpace, MotionLimits, Plan, PlannerConfig, plan

GOAL_SHARE = 0.8
"""Share of `episode.goal_tolerance` within which the robot holds itself to have arrived."""


class InputMaker:
    """Makes the input of each decision of one mission."""

    def __init__(
        self, config: Config, mission: Mission, mapper: Mapper, spaces: FreeSpaces
    ) -> None:
        """Read one map and its free space, whose arrays are allocated here."""
        self._config, self._mission = config, mission
        self._mapper, self._spaces = mapper, spaces
        self._goal = mapper.planning_point(np.array(mission.goal))
        spaces.circumscribed()  # allocates its arrays now, so that no decision waits for it

    def circumscribed(self, inputs: Inputs) -> View:
        """The input for the disc about the body."""
        config, mission = self._config, self._mission
        admitted, known, passable = self._spaces.circumscribed()
        return View(
            time_ns=inputs.time_ns,
            effect_ns=inputs.time_ns + round(config.latency.expected * 1e9),
            sequence=inputs.sequence,
            seed=config.seed,
            position=self._mapper.planning_point(inputs.pose.position),
            heading=inputs.pose.heading,
            goal=self._goal,
            goal_tolerance=GOAL_SHARE * config.episode.goal_tolerance,
            admitted=admitted,
            known=known,
            passable=passable,
            states=self._mapper.costmap.states_between,
            unknown_blocks=config.map.unknown_policy == "forbid",
            turns_in_place=mission.motion == "ground",
            penalize_unknown=config.map.unknown_policy == "penalize",
            limits=_limits(config, mission),
            planner=config.planner,
            behaviour=config.behaviour,
            plan=planned_once(),
        )

    @property
    def elongated(self) -> bool:
        """Whether the body is several discs."""
        return bool(self._mission.discs)

    def oriented(self, view: View) -> View:
        """The same for the discs of an elongated body at their heading."""
        admitted, known, passable = self._spaces.oriented()
        return replace(view, admitted=admitted, known=known, passable=passable)


def planned_once() -> PlanPath:
    """Memoize the planner for one decision.

    Paths rest on distances that hold until the next update of the costmap. So a decision that is
    made again, as some distances that it read were out of date, need not search again.
    """
    plans: dict[tuple[object, ...], Plan] = {}

    def plan_path(
        space: FreeSpace,
        start: NDArray[np.float64],
        goal: NDArray[np.float64],
        config: PlannerConfig,
        seed: int,
        heading: float,
    ) -> Plan:
        kind = id(space.distances), space.collision_distance_sq, space.discs, space.sparing
        query = *kind, start.tobytes(), goal.tobytes(), heading, seed
        if query not in plans:
            plans[query] = plan(space, start, goal, config, seed, heading)
        return plans[query]

    return plan_path


def _limits(config: Config, mission: Mission) -> MotionLimits:
    return MotionLimits(
        speed=mission.max_speed * config.motion.speed_fraction,
        acceleration=mission.max_acceleration,
        jerk=mission.max_jerk,
        lateral_acceleration=mission.max_acceleration,
        yaw_rate=mission.max_yaw_rate,
    )
