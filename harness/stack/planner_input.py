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
from wayproof.maps import Costmap, collision_distance_sq
from wayproof.planners import Disc, FreeSpace, MotionLimits

Array = NDArray[np.float64]

EDGE_COST_IN_FLIGHT = 0.5
"""Cost at the edge of the inflation to a robot that flies. Where it is 1, the floor alone has the
drone climb by 0.4 m before it goes anywhere, and it passes obstacles in needlessly wide bends."""

HELD_SHARE = 0.5
"""Part of an unheld direction in the axes of motion from which these are not held."""


class FreeSpaceBuilder:
    """Builds the free space of one costmap for one mission's body.

    An elongated body is several discs at its heading (oriented footprint), or one disc about all
    of them (circumscribed footprint), which may turn as it likes.
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
        self._elongated = bool(mission.discs)
        lowers = omnidirectional and not mission.planar
        self._edge_cost = EDGE_COST_IN_FLIGHT if lowers else 1.0
        self._extra_radius = self._body.circumscribed_radius - min(self._body.radii)
        self._costs_of: Array | None = None
        self._cost_by_distance = np.empty(0)

    def inflation_radius(self, space: FreeSpace) -> float:
        """Return the inflation radius of the footprint that a space is for, m."""
        return self._costmap.inflation_radius + (0.0 if space.discs else self._extra_radius)

    def spaces(self, circumscribed: bool) -> FreeSpaces:
        """Return free space for the disc about the body, or for its discs at its heading."""
        costmap, circumscribed = self._costmap, circumscribed and self._elongated
        traversable = known_free = self._space(costmap.clearance, circumscribed)
        if costmap.config.unknown_policy != "forbid":
            traversable = self._space(costmap.field(), circumscribed)
        optimistic = self._optimistic(circumscribed)
        return FreeSpaces(traversable, known_free, optimistic, costmap.states_between)

    def guided(self, measured: Costmap, circumscribed: bool) -> FreeSpace:
        """Return optimistic space by all evidence, for the disc about the body or for its discs.

        What is free by other evidence than measurements costs `prior.cost`.

        Args:
            measured: Costmap of what was measured, with the same cells and margin.
            circumscribed: Whether for the disc.
        """
        space = self._optimistic(circumscribed and self._elongated)
        measured_free = measured.clearance > space.collision_distance_sq
        elsewhere = np.where(measured_free, np.uint8(0), np.uint8(ELSEWHERE))
        prices = np.where(space.grid.price == UNKNOWN, np.uint8(UNKNOWN), elsewhere)
        beside = space.cost_by_price[UNKNOWN] - self._config.behaviour.unknown_cost
        costs = {ELSEWHERE: beside + self._config.prior.cost}
        return with_costs(replace(space, prices=prices), costs)

    def known_free(self, circumscribed: bool) -> FreeSpace:
        """Return space known to be free, for the disc about the body or for its discs."""
        return self._space(self._costmap.clearance, circumscribed and self._elongated)

    def _space(
        self,
        distances: NDArray[np.uint16],
        circumscribed: bool,
        prices: NDArray[np.uint8] | None = None,
        cost_by_price: tuple[float, ...] = (0.0,),
    ) -> FreeSpace:
        costmap = self._costmap
        return FreeSpace(
            distances=distances,
            origin=costmap.origin,
            resolution=costmap.resolution,
            collision_distance_sq=self._threshold(circumscribed),
            cost_by_distance=self._costs(),
            discs=() if circumscribed else self._discs(),
            prices=prices,
            cost_by_price=cost_by_price,
        )

    def _optimistic(self, circumscribed: bool) -> FreeSpace:
        """Return space not known to be blocked: where unknown, as at an obstacle's edge.

        So a global path may cross the unknown, at `behaviour.unknown_cost`, and takes known space
        where it can.
        """
        costmap, threshold = self._costmap, self._threshold(circumscribed)
        oriented = self._elongated and not circumscribed
        cost = self._config.behaviour.unknown_cost + (NARROW_COST if oriented else 0.0)
        unknown = (costmap.clearance <= threshold).view(np.uint8)  # 1: `UNKNOWN`
        return self._space(costmap.obstacle_clearance, circumscribed, unknown, (0.0, cost))

    def _costs(self) -> Array:
        """Return the costs by squared distance; again when the costmap's own have changed."""
        if self._costs_of is not self._costmap.cost_table:
            self._costs_of = self._costmap.cost_table
            self._cost_by_distance = self._edge_cost * costs(self._costmap, self._body)
        return self._cost_by_distance

    def _threshold(self, circumscribed: bool) -> int:
        """Return the largest squared distance at which a body collides, cells^2."""
        costmap = self._costmap
        if not circumscribed:
            return costmap.collision_distance_sq
        radius = self._body.circumscribed_radius + costmap.margin
        return collision_distance_sq(radius, costmap.resolution, flat=True)

    def _discs(self) -> tuple[Disc, ...]:
        """Return the discs that are checked at the heading; none if the body is one."""
        if not self._elongated:
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

    @property
    def elongated(self) -> bool:
        """Whether the body is several discs."""
        return bool(self._mission.discs)

    def circumscribed(self, inputs: Inputs) -> PlannerInput:
        """Return the planner input for the circumscribed footprint."""
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
            spaces=self._with_evidence(circumscribed=True),
            localization=localization_of(pose, self._mission.axes),
            range_sigma=self._mapper.range_sigma,
            pose_age_s=self._mapper.pose_age_ns * 1e-9,
            horizon=Horizon(*self._mapper.window.inner, self._far_ways.way),
            observed_ns=self._mapper.map.observed_ns_at,
        )

    def oriented(self, circumscribed: PlannerInput) -> PlannerInput:
        """Return the planner input for the oriented footprint."""
        return replace(circumscribed, spaces=self._with_evidence(circumscribed=False))

    def _with_evidence(self, circumscribed: bool) -> FreeSpaces:
        """Return the spaces of a footprint with what was not measured, too."""
        spaces = self._spaces.spaces(circumscribed)
        guide, measured = self._guide, self._mapper.stages[0].costmap
        guided = None if guide is None else guide.guided(measured, circumscribed)
        evidence = tuple(
            EvidenceSpace(provenance, builder.known_free(circumscribed))
            for provenance, builder in self._stages
        )
        return replace(spaces, guided=guided, evidence=evidence)


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
