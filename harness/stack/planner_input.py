"""The planner input of each decision: free space of the costmap, pose and settings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.mission import Mission
from wayproof.harness.stack.footprint import NARROW_COST, body_of, costs
from wayproof.harness.stack.gaits import gait_of
from wayproof.harness.stack.horizon import FarWays
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.prices import ELSEWHERE, UNKNOWN, with_costs
from wayproof.harness.stack.types import (
    EvidenceSpace,
    FreeSpaces,
    Horizon,
    Localization,
    PlannerInput,
)
from wayproof.maps import Costmap
from wayproof.planners import Disc, FreeSpace, MotionLimits

Array = NDArray[np.float64]

EDGE_COST_IN_FLIGHT = 0.5
"""Cost at the edge of the inflation to a robot that flies. Where it is 1, the floor alone has the
drone climb by 0.4 m before it goes anywhere, and it passes obstacles in needlessly wide bends."""

HELD_SHARE = 0.5
"""Part of an unheld direction in the axes of motion from which these are not held."""


class FreeSpaceBuilder:
    """Builds the free space of one costmap for one mission's body.

    An elongated body is several discs at its heading.
    """

    def __init__(
        self, config: Config, mission: Mission, costmap: Costmap, omnidirectional: bool
    ) -> None:
        """Build from one costmap, also after its updates.

        Args:
            config: Resolved.
            mission: Body and area.
            costmap: Costmap that the space is of.
            omnidirectional: Whether the sensors see all around, as `is_omnidirectional` says.
        """
        self._config, self._costmap = config, costmap
        self._body = body_of(mission)
        lowers = omnidirectional and not mission.planar
        self._edge_cost = EDGE_COST_IN_FLIGHT if lowers else 1.0
        self._costs_of: Array | None = None
        self._cost_by_distance = np.empty(0)

    def spaces(self) -> FreeSpaces:
        """Return free space by all readings of the costmap."""
        costmap = self._costmap
        traversable = known_free = self.known_free()
        if costmap.config.unknown_policy != "forbid":
            traversable = self._space(costmap.field())
        return FreeSpaces(traversable, known_free, self._optimistic(), costmap.states_between)

    def guided(self, measured: Costmap) -> FreeSpace:
        """Return optimistic space by all evidence.

        What is free by other evidence than measurements costs `prior.cost`.

        Args:
            measured: Costmap of what was measured, with the same cells and margin.
        """
        space = self._optimistic()
        measured_free = measured.clearance > space.collision_distance_sq
        elsewhere = np.where(measured_free, np.uint8(0), np.uint8(ELSEWHERE))
        prices = np.where(space.grid.price == UNKNOWN, np.uint8(UNKNOWN), elsewhere)
        beside = space.cost_by_price[UNKNOWN] - self._config.behaviour.unknown_cost
        costs = {ELSEWHERE: beside + self._config.prior.cost}
        return with_costs(replace(space, prices=prices), costs)

    def known_free(self) -> FreeSpace:
        """Return space known to be free."""
        return self._space(self._costmap.clearance)

    def _space(
        self,
        distances: NDArray[np.uint16],
        prices: NDArray[np.uint8] | None = None,
        cost_by_price: tuple[float, ...] = (0.0,),
    ) -> FreeSpace:
        costmap = self._costmap
        return FreeSpace(
            distances=distances,
            origin=costmap.origin,
            resolution=costmap.resolution,
            collision_distance_sq=self._threshold(),
            cost_by_distance=self._costs(),
            discs=self._discs(),
            prices=prices,
            cost_by_price=cost_by_price,
        )

    def _optimistic(self) -> FreeSpace:
        """Return space not known to be blocked: where unknown, as at an obstacle's edge.

        So a global path may cross the unknown, at `behaviour.unknown_cost`, and takes known space
        where it can.
        """
        costmap, cost = self._costmap, self._config.behaviour.unknown_cost
        cost += NARROW_COST if len(self._body.radii) > 1 else 0.0
        unknown = (costmap.clearance <= self._threshold()).view(np.uint8)  # 1: `UNKNOWN`
        return self._space(costmap.obstacle_clearance, unknown, (0.0, cost))

    def _costs(self) -> Array:
        """Return the costs by squared distance; again when the costmap's own have changed."""
        if self._costs_of is not self._costmap.cost_table:
            self._costs_of = self._costmap.cost_table
            self._cost_by_distance = self._edge_cost * costs(self._costmap, self._body)
        return self._cost_by_distance

    def _threshold(self) -> int:
        """Return the largest squared distance at which the least disc collides, cells^2."""
        return self._costmap.collision_distance_sq

    def _discs(self) -> tuple[Disc, ...]:
        """Return the discs that are checked at the heading; none if the body is one."""
        if len(self._body.radii) == 1:
            return ()
        return self._body.discs(self._costmap.margin, self._costmap.resolution, flat=True)


class PlannerInputBuilder:
    """Builds the planner input of each decision of one mission."""

    def __init__(
        self, config: Config, mission: Mission, mapper: Mapper, spaces: FreeSpaceBuilder
    ) -> None:
        """Read one map and its free space, whose arrays are allocated here."""
        self._config, self._mission = config, mission
        self._mapper, self._spaces = mapper, spaces
        self._goal = mapper.planning_point(np.array(mission.goal))
        around = mapper.omnidirectional
        self._gait = gait_of(mission, motion_limits(config, mission), around)
        guide, stages = mapper.guide, mapper.stages if len(mapper.stages) > 1 else ()
        self._guide = None if guide is None else FreeSpaceBuilder(config, mission, guide, around)
        self._stages = [
            (stage.provenance, FreeSpaceBuilder(config, mission, stage.costmap, around))
            for stage in stages
        ]
        self._far_ways = FarWays(config, mission, mapper)

    def build(self, inputs: Inputs) -> PlannerInput:
        """Return the planner input of the decision on some inputs."""
        pose = inputs.pose
        goal = self._goal if inputs.goal is None else self._mapper.planning_point(inputs.goal)
        return PlannerInput(
            time_ns=inputs.time_ns,
            effect_ns=inputs.time_ns + self._config.latency.expected_ns,
            sequence=inputs.sequence,
            position=self._mapper.planning_point(pose.position),
            heading=pose.heading,
            goal=goal,
            config=self._config,
            gait=self._gait,
            spaces=self._with_evidence(),
            localization=localization_of(pose, self._mission.axes),
            range_sigma=self._mapper.range_sigma,
            pose_age_s=self._mapper.pose_age_ns * 1e-9,
            horizon=Horizon(*self._mapper.window.inner, self._far_ways.way),
            observed_ns=self._mapper.map.observed_ns_at,
        )

    def _with_evidence(self) -> FreeSpaces:
        """Return the spaces with what was not measured, too."""
        guide, measured = self._guide, self._mapper.stages[0].costmap
        guided = None if guide is None else guide.guided(measured)
        evidence = tuple(
            EvidenceSpace(provenance, builder.known_free()) for provenance, builder in self._stages
        )
        return replace(self._spaces.spaces(), guided=guided, evidence=evidence)


def localization_of(pose: Pose, axes: int) -> Localization | None:
    """Return the uncertainty of a pose along the axes of motion, 2 or 3; None if not stated."""
    if pose.covariance is None:
        return None
    along = np.sqrt(np.square(pose.unheld[:, :axes]).sum(axis=1))
    return Localization(pose.position_sigma, held=not (along > HELD_SHARE).any())


def motion_limits(config: Config, mission: Mission) -> MotionLimits:
    """Return the greatest speed, acceleration, jerk, yaw rate and its change of a command."""
    return MotionLimits(
        speed=mission.max_speed * config.motion.speed_fraction,
        acceleration=mission.max_acceleration,
        jerk=mission.max_jerk,
        lateral_acceleration=mission.max_acceleration,
        yaw_rate=mission.max_yaw_rate,
        yaw_acceleration=mission.max_yaw_acceleration or math.inf,
        by_direction=mission.planar,
    )
