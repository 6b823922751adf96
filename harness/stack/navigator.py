"""The stack under test: sweeps and poses in, decisions out. Recording and replay run the same one.

Nothing here knows the simulator, the wall clock apart from the stage latencies, or any state but
its own; the same inputs give the same decisions, bit by bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from harness.config import Config
from harness.errors import InputError
from harness.inputs import Beams, Inputs
from harness.labels import bound_version, make_layer, vote, widened
from harness.mission import Mission
from harness.schema import wayproof_pb2 as pb
from harness.stack.behaviour import decide
from harness.stack.decision import add_points, seal, thinned, trajectory_message
from harness.stack.footprint import HEADING_TOLERANCE, NARROWEST, body_of, costs, lever
from harness.stack.reasons import Reason, reason_message, sentence
from harness.stack.view import Choice, Memory, View
from harness.stack.width import decide_by_width
from maps import MAPS, Costmap, Distances, VoxelMap
from planners import Disc, FreeSpace, MotionLimits, Trajectory, hold, state_space_for
from planners.body import blocked_at_or_below

Array = NDArray[np.float64]

MARGIN_SIGMAS = 2.0
"""Standard deviations of the believed position that the localization margin covers (95 %)."""


def build_navigator(config: Config, mission: Mission, beams: Mapping[str, Beams]) -> Navigator:
    """Start a navigator.

    Raises:
        InputError: The map or the costmap cannot be made for this mission with these settings, or
            its body cannot be planned for in the state space.
    """
    planner, flat = config.planner, mission.motion == "ground"
    try:
        state_space_for(planner.state_space, planner.name, flat=flat, discs=bool(mission.discs))
    except ValueError as error:
        raise InputError(f"robot '{config.robot}': {error}") from None
    try:
        return Navigator(config, mission, beams)
    except ValueError as error:
        raise InputError(f"no map for this mission: {error}") from None
    except MemoryError:
        raise InputError(
            f"no memory for the map and its costmap: map.memory_mib is {config.map.memory_mib}, "
            "expected less, or a machine that has more"
        ) from None


class Navigator:
    """Maps, plans and decides for one mission.

    Attributes:
        map: All that was sensed.
        labels: What it is of, if sweeps tell.
        costmap: Of the mission's body.
        informant: Tells the map more after each set of inputs; only a counterfactual has one.
    """

    def __init__(self, config: Config, mission: Mission, beams: Mapping[str, Beams]) -> None:
        """Start with an unknown map, but for the start area that the operator declares free."""
        self._config = config
        self._mission = mission
        self._beams = dict(beams)
        self._body = body_of(mission)
        self._slender = self._body.circumscribed_radius - min(self._body.radii)
        self.map = MAPS[config.map.kind](config.map, config.threads, mission.low, mission.high)
        self.labels = make_layer(config.map, config.sensors.semantics)
        self.costmap = Costmap(
            replace(config.map, cost_range=config.map.cost_range + self._slender),
            widened(self.map, self.labels, config.map.class_margins),
            mission.low,
            mission.high,
            mission.motion,
            min(self._body.radii),
            mission.height,
            mission.step_height,
            *_altitude_window(config, mission),
            threads=config.threads,
        )
        self._declare_start_free()
        start = self._planning_point(np.array(mission.start))
        self._goal = self._planning_point(np.array(mission.goal))
        self._memory = Memory(hold(start, 0, mission.start_heading))
        self._chain = ""
        self._costs_of: Array | None = None
        self._cost_by_distance = np.empty(0)
        self.informant: Callable[[Inputs], None] | None = None
        self._spaces(wide=bool(mission.discs))  # the system gives memory here, not in a decision

    @property
    def trajectory(self) -> Trajectory:
        """The last one committed."""
        return self._memory.trajectory

    @property
    def chain(self) -> str:
        """Hash over all decisions so far."""
        return self._chain

    @property
    def memory(self) -> Memory:
        """What the last decision hands to the next."""
        return self._memory

    def adopt(self, memory: Memory, chain: str) -> None:
        """Decide next as one that has this behind it, whatever was decided here."""
        self._memory = memory
        self._chain = chain

    def carry(self, beams: Mapping[str, Beams]) -> None:
        """Take the sweeps of these sensors from now on."""
        self._beams = dict(beams)

    def step(self, inputs: Inputs, sense_ms: float = 0.0) -> pb.Decision:
        """Integrate one set of inputs and decide; `commit` then settles whether it was in time.

        Args:
            inputs: The sweeps and the pose of one instant.
            sense_ms: Wall time that the sweeps took to cast, for the record.
        """
        clock = [time.perf_counter()]
        self.integrate(inputs)
        clock.append(time.perf_counter())
        self.inflate(inputs)
        version = bound_version(self.map.version(), self.labels)
        clock.append(time.perf_counter())
        decision = self._settle(inputs, version)
        clock.append(time.perf_counter())
        _write_stages(decision.stages, sense_ms, clock, self.costmap.clearances.spent_s)
        return decision

    def _settle(self, inputs: Inputs, version: str) -> pb.Decision:
        """Decide, until all distances that the decision and its record rest on are up to date."""
        view = self._view(inputs)
        while True:
            choice, self._draft, decided_on = self._decide(view)
            decision = self._record(inputs, decided_on, choice, version)
            if not self.costmap.clearances.catch_up():
                return decision

    def commit(self, decision: pb.Decision, delay_s: float) -> pb.Decision:
        """Settle the decision with the delay that it had, and bind it into the chain.

        Past the deadline it is discarded: the last trajectory stands, and that one ends at rest in
        space that was admitted.
        """
        deadline = self._config.latency.deadline
        decision.delay_s = delay_s
        decision.deadline_s = deadline
        decision.deadline_missed = delay_s > deadline
        if decision.deadline_missed:
            standing = self._memory.trajectory
            late = decision.timestamp.ToNanoseconds() - standing.start_ns
            decision.action = "stop_and_wait" if late >= standing.duration_s * 1e9 else "follow"
            decision.label = "deadline_missed"
            reason = Reason("deadline_missed", delay_s=delay_s, deadline_s=deadline)
            decision.reason = sentence(reason)
            decision.grounds.CopyFrom(reason_message(reason))
            decision.trajectory.CopyFrom(trajectory_message(standing))
            decision.committed_length_m = _length(standing.path)
            decision.ClearField("guide")
        else:
            self._memory = self._draft
        seal(decision, self._chain)
        self._chain = decision.chain
        return decision

    def perceive(self, inputs: Inputs) -> None:
        """Bring map and costmap to where `step` has them when it decides, and decide nothing."""
        self.integrate(inputs)
        self.inflate(inputs)

    def inflate(self, inputs: Inputs) -> None:
        """Bring the costmap up to date with the map, for inputs that it has taken in."""
        # A plane is worked out sooner than somebody looks around in it.
        self.costmap.update(self._margin(inputs), whole=self._mission.motion == "ground")

    def _margin(self, inputs: Inputs) -> float:
        margin = self._config.map.inflation_margin + MARGIN_SIGMAS * inputs.pose.position_sigma
        return margin + lever(self._body) * HEADING_TOLERANCE

    def integrate(self, inputs: Inputs) -> None:
        """Take one set of inputs into the map and decide nothing."""
        self.map.advance(inputs.time_ns)
        for sweep in inputs.sweeps:
            beams = self._beams[sweep.sensor]
            placed = beams.place(sweep, inputs.pose, inputs.sequence)
            if self._config.map.no_return == "ignored":
                placed = placed.without_silent()
            self.map.integrate(
                placed.origins,
                placed.directions,
                placed.ranges_mm,
                beams.range,
                inputs.time_ns,
                placed.moments,
            )
            if self.labels is not None and sweep.classes is not None:
                limits = self._config.map.minimum_range, beams.range
                vote(self.labels, placed, sweep.classes, limits, inputs.sequence)
        if (reach := self._config.map.hold_under_body) > 0.0 and isinstance(self.map, VoxelMap):
            position = inputs.pose.position
            self.map.hold(position - reach, position + reach, inputs.time_ns)
        if self.informant is not None:
            self.informant(inputs)

    def _view(self, inputs: Inputs) -> View:
        """Of a long body for the disc about it."""
        config, mission = self._config, self._mission
        delay_ns = round(config.latency.expected * 1e9)
        admitted, known, passable = self._spaces(wide=bool(mission.discs))
        return View(
            time_ns=inputs.time_ns,
            effect_ns=inputs.time_ns + delay_ns,
            sequence=inputs.sequence,
            seed=config.seed,
            position=self._planning_point(inputs.pose.position),
            heading=inputs.pose.heading,
            goal=self._goal,
            goal_tolerance=0.8 * config.episode.goal_tolerance,
            admitted=admitted,
            known=known,
            passable=passable,
            states=self.costmap.states_between,
            unknown_blocks=config.map.unknown_policy == "forbid",
            turns_in_place=mission.motion == "ground",
            penalize_unknown=config.map.unknown_policy == "penalize",
            limits=_limits(config, mission),
            planner=config.planner,
            behaviour=config.behaviour,
        )

    def _decide(self, view: View) -> tuple[Choice, Memory, View]:
        """The choice, the memory that it leaves, and the view that it was made on."""
        if not self._mission.discs:
            return *decide(view, self._memory), view
        return decide_by_width(view, lambda: self._as_it_lies(view), self._memory)

    def _as_it_lies(self, view: View) -> View:
        """The same for the discs of a long body at their heading."""
        admitted, known, passable = self._spaces()
        return replace(view, admitted=admitted, known=known, passable=passable)

    def _record(self, inputs: Inputs, view: View, choice: Choice, version: str) -> pb.Decision:
        path = choice.trajectory.path
        search = choice.search
        decision = pb.Decision(
            sequence=inputs.sequence,
            trigger=f"{inputs.sweeps[0].sensor} sweep" if inputs.sweeps else "pose",
            representation=self._config.map.kind,
            map_version=version,
            resolution_m=self.map.resolution,
            unknown_policy=self._config.map.unknown_policy,
            inflation_radius_m=self._inflation_radius(view),
            localization_margin_m=self.costmap.margin,
            blocked_at_or_below=view.admitted.blocked_at_or_below,
            position=inputs.pose.position.tolist(),
            quaternion=inputs.pose.quaternion.tolist(),
            position_sigma=inputs.pose.position_sigma,
            input_digest=inputs.digest,
            evidence_age_s=self._evidence_age(path, inputs.time_ns),
            planner=self._config.planner.name if search else "",
            planner_seed=choice.search_seed,
            planner_iterations=search.iterations if search else 0,
            path_cost=self._path_cost(view, choice.guide),
            path_length_m=_length(choice.guide),
            least_clearance_m=view.known.least_clearance(path),
            action=choice.action,
            reason=sentence(choice.reason),
            grounds=reason_message(choice.reason),
            label=choice.label,
            trajectory=trajectory_message(choice.trajectory),
            committed_length_m=_length(path),
        )
        add_points(decision, "guide", thinned(choice.guide))
        decision.timestamp.FromNanoseconds(inputs.time_ns)
        return decision

    def _inflation_radius(self, view: View) -> float:
        """Of the disc or discs that the decision was made for, m."""
        return self.costmap.inflation_radius + (0.0 if view.admitted.discs else self._slender)

    def _path_cost(self, view: View, guide: Array | None) -> float:
        weight = self._config.planner.clearance_weight
        return 0.0 if guide is None else view.passable.path_cost(guide, weight)

    def _evidence_age(self, path: Array, time_ns: int) -> float:
        """Age of the oldest evidence along the path, s; the declared start counts as time 0."""
        observed = self.map.observed_ns_at(path)
        return float(time_ns - max(int(observed.min()), 0)) * 1e-9

    def _spaces(self, wide: bool = False) -> tuple[FreeSpace, FreeSpace, FreeSpace]:
        """What the policy admits, what is known to be free, and what is not known to be blocked."""
        costmap = self.costmap
        admitted = known = self._space(costmap.admitted, wide)
        if costmap.known is not costmap.admitted:
            known = self._space(costmap.known, wide)
        return admitted, known, self._passable(wide)

    def _space(
        self, distances: Distances, wide: bool = False, table: Array | None = None
    ) -> FreeSpace:
        """Free space for the body as it lies, or for the disc about it, by default at its costs."""
        costmap = self.costmap
        return FreeSpace(
            distances=distances,
            origin=costmap.origin,
            resolution=costmap.resolution,
            blocked_at_or_below=self._threshold(wide),
            cost_by_distance=self._costs() if table is None else table,
            discs=() if wide else self._discs(),
            sparing=True,
        )

    def _costs(self) -> Array:
        """By squared distance; worked out anew when the costmap's own have changed."""
        if self._costs_of is not self.costmap.cost_table:
            self._costs_of = self.costmap.cost_table
            self._cost_by_distance = costs(self.costmap, self._body)
        return self._cost_by_distance

    def _threshold(self, wide: bool) -> int:
        """The largest forbidden squared distance, cells^2."""
        costmap = self.costmap
        if not wide:
            return costmap.blocked_at_or_below
        radius = self._body.circumscribed_radius + costmap.margin
        return blocked_at_or_below(radius, costmap.resolution, flat=True)

    def _discs(self) -> tuple[Disc, ...]:
        """The discs that are checked at the heading; none if the body is one."""
        if not self._mission.discs:
            return ()
        return self._body.discs(self.costmap.margin, self.costmap.resolution, flat=True)

    def _passable(self, wide: bool = False) -> FreeSpace:
        """Space not known to be blocked: distances to obstacles, an obstacle's edge where unknown.

        So a guide may cross the unknown, at `behaviour.unknown_cost`, and takes known space where
        it can.
        """
        edge = self._threshold(wide) + 1
        slender = bool(self._mission.discs) and not wide
        table = self._costs().copy()
        table[edge] = self._config.behaviour.unknown_cost + (NARROWEST if slender else 0.0)
        return self._space(self.costmap.presumed(edge), wide, table)

    def _planning_point(self, position: Array) -> Array:
        """The point in the costmap's frame: ground robots plan in the plane of its one layer."""
        if self._mission.motion == "air":
            return position.copy()
        layer = self.costmap.origin[2] + 0.5 * self.costmap.resolution
        return np.array([position[0], position[1], layer])

    def _declare_start_free(self) -> None:
        """No sensor sees what stands right beside the body: the operator vouches for that space."""
        mission, config = self._mission, self._config
        radius = self.costmap.inflation_radius + self._slender + config.episode.start_clear_radius
        x, y, z = mission.start
        if mission.motion == "air":
            self.map.mark_free_sphere((x, y, z), radius, 0)
            return
        low, high = (x - radius, y - radius), (x + radius, y + radius)
        self.map.mark_floor(low, high, 0)
        top = mission.height + self.map.resolution
        self.map.mark_free((*low, self.costmap.origin[2]), (*high, top), 0)


def _altitude_window(config: Config, mission: Mission) -> tuple[float, float]:
    if mission.motion == "ground":
        return -math.inf, math.inf
    return config.motion.altitude_low, config.motion.altitude_high


def _limits(config: Config, mission: Mission) -> MotionLimits:
    return MotionLimits(
        speed=mission.max_speed * config.motion.speed_fraction,
        acceleration=mission.max_acceleration,
        jerk=mission.max_jerk,
        lateral_acceleration=mission.max_acceleration,
        yaw_rate=mission.max_yaw_rate,
    )


def _length(path: Array | None) -> float:
    if path is None or len(path) < 2:
        return 0.0
    return float(np.sqrt(np.square(np.diff(path, axis=0)).sum(axis=1)).sum())


def _write_stages(
    stages: pb.StageLatency, sense_ms: float, clock: list[float], caught_up_s: float
) -> None:
    """What each stage took; distances that were worked out while planning are the costmap's."""
    stages.sense_ms = sense_ms
    stages.map_ms, stages.costmap_ms, stages.plan_ms = np.diff(clock) * 1e3
    stages.costmap_ms += caught_up_s * 1e3
    stages.plan_ms -= caught_up_s * 1e3
