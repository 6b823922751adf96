"""Map and costmap of one mission."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.decision import MOST_WIDENING
from wayproof.harness.filters import AS_THEY_COME, Filters, Origin, names_of
from wayproof.harness.filters.filter import image_of
from wayproof.harness.inputs import Beams, Inputs, Pose, SweepInput, WorldSweep
from wayproof.harness.mission import Mission
from wayproof.harness.stack.footprint import HEADING_TOLERANCE, body_of, clear_footprint, lever_arm
from wayproof.harness.stack.gait import is_omnidirectional
from wayproof.harness.stack.labels import combined_version, make_layer, vote, with_class_margins
from wayproof.harness.stack.provenance import layers_of, stages_of
from wayproof.harness.stack.rolling_window import Cell, RollingWindow
from wayproof.maps import MAPS, Costmap, Representation, range_image
from wayproof.maps.columns import ColumnMap
from wayproof.maps.costmap.widening import NOT_WIDENED
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

Array = NDArray[np.float64]

ALIKE = 0.02
"""Difference of the margins of two axes up to which both take the greater one, m."""

MOST_DOUBT = 100
"""Greatest part of a margin for the stated covariance, cells: nothing is free with that already."""

POSE_WITHIN_NS = 300_000_000
"""Greatest time between a sweep and the pose that places it, ns: Nav2's `transform_tolerance` of a
costmap."""

FROZEN_ECHOES = 100
"""Number of echoes from which a sweep is not the one before by chance, to the millimetre."""

FROZEN_SHIFT = 0.05
"""Way of the sensor's body beyond which that sweep cannot be new, m."""

POSES = 64
"""Number of poses that are kept for sweeps that come late."""

MARGIN_SIGMAS = 2.0
"""Localization margin in standard deviations of the estimated position (95 %)."""


class Mapper:
    """Integrates sweeps into the map, and updates the costmap from it.

    Attributes:
        map: The map of the mission.
        measured: The map with the margins of its classes, as the costmap reads it.
        window: Part of the operating area that the costmap holds.
        labels: Classes of its cells, if sweeps have classes.
        costmap: Inflated for the mission's body: what the stack may enter.
        stages: The evidence by provenance, each with a costmap; the measured one first.
        guide: Costmap of all evidence, for the search of a global path; None if `costmap` is it.
        filters: Filters of returns that each sweep passes.
        newest: Inputs of the newest decision that the map holds; None before the first.
        returns: The map of the returns as they came, without the word of any filter; None unless
            `keep_returns` was asked for.
        pose_age_ns: Time since the pose was estimated, by its stamp or as it comes again, ns.
        range_sigma: Standard deviation of the ranges of the newest sweeps, of the worst sensor, m;
            0 where it is not estimated.
        on_integrated: Callback after each integration; only counterfactuals set one.
        on_placed: Callback with each placed sweep, its range, m, and its time, ns; only the
            assessment of a recording sets one.
    """

    def __init__(self, config: Config, mission: Mission, beams: Mapping[str, Beams]) -> None:
        """Start with an unknown map but for the start area, which the operator declares free."""
        self._config, self._mission = config, mission
        self._beams = dict(beams)
        self.omnidirectional = is_omnidirectional(beams.values())
        self._body = body_of(mission)
        recorded = config.recording
        self._clears_footprint = recorded is not None and recorded.footprint_clearing
        self._extra_radius = self._body.circumscribed_radius - min(self._body.radii)
        self._climbs = climbs(config, mission)
        self.map = MAPS[config.map.kind](config.map, mission.low, mission.high)
        self.filters = Filters(names_of(config), config, mission, self.map)
        self.labels = make_layer(config.map, config.sensors.semantics)
        self.window = RollingWindow(config, mission)
        low, high = self.window.corners
        floor, ceiling = _altitude_window(config, mission)
        costs = replace(config.costmap, cost_range=config.costmap.cost_range + self._extra_radius)

        def costmap_of(columns: ColumnMap) -> Costmap:
            return Costmap(
                config=costs,
                voxel_map=columns,
                low=low,
                high=high,
                motion=mission.motion,
                radius=min(self._body.radii),
                height=mission.height,
                step_height=mission.step_height,
                floor=floor,
                ceiling=ceiling,
            )

        self.measured = with_class_margins(self.map, self.labels, config.costmap.class_margins)
        self._layers = layers_of(config, mission)
        self.stages, self.costmap, self.guide = stages_of(self.measured, self._layers, costmap_of)
        self.newest: Inputs | None = None
        self.range_sigma = 0.0
        self.pose_age_ns = 0
        self.on_integrated: Callable[[Inputs], None] | None = None
        self.on_placed: Callable[[WorldSweep, float, int], None] | None = None
        self.returns: Representation | None = None
        self._poses: deque[tuple[int, Pose]] = deque(maxlen=POSES)
        self._estimated_ns = 0
        self._before: dict[str, tuple[SweepInput, Array]] = {}  # newest sweep and where it came
        self._as_they_come = Filters(AS_THEY_COME, config, mission, self.map)
        self._declare_start_free(self.map)

    def keep_returns(self) -> None:
        """Keep the map of the returns as they come as well, for a judge; before the first sweep."""
        settings = self._config.map
        self.returns = MAPS[settings.kind](settings, self._mission.low, self._mission.high)
        self._declare_start_free(self.returns)

    def set_sensors(self, beams: Mapping[str, Beams]) -> None:
        """Replace the sensors, by name, whose sweeps are integrated."""
        self._beams = dict(beams)

    def version(self) -> str:
        """Return the hash of the map's content and of its labels."""
        return combined_version(self.map.version(), self.labels)

    def integrate(self, inputs: Inputs) -> None:
        """Integrate the sweeps of one instant into the map, and roll the window along."""
        self.newest, self.range_sigma = inputs, 0.0
        self._take_pose(inputs)
        for a_map in self._maps:
            a_map.advance(inputs.time_ns)
        for sweep in inputs.sweeps:
            self._integrate_sweep(sweep, inputs)
        self._hold_about_body(inputs.pose, inputs.time_ns)
        self._roll_window(inputs.pose.position)
        if self.on_integrated is not None:
            self.on_integrated(inputs)

    def update_costmap(self, inputs: Inputs) -> None:
        """Update the costmap from the map, after the inputs have been integrated."""
        margin = margin_of(inputs.pose, self._config, self._mission)
        for layer in self._layers:
            if layer.follow is not None:
                layer.follow(self.map, inputs)
        self.stand_at(inputs.pose.position)
        for stage in self.stages:
            stage.costmap.update(margin.least, widening=margin.widening)

    def stand_at(self, position: Array) -> None:
        """Find the ground from the feet of a body that climbs, too, from the next update on.

        Args:
            position: (3,) of the body, m, world.
        """
        if self._climbs:
            feet = np.subtract(position, (0.0, 0.0, self._mission.rest_height))
            for stage in self.stages:
                stage.costmap.stand_at(feet)

    def update(self, inputs: Inputs) -> None:
        """Integrate the inputs and update the costmap, as before a decision."""
        self.integrate(inputs)
        self.update_costmap(inputs)

    def move_window(self, centre: Cell) -> None:
        """Centre the rolling window on a cell, or as near to it as it can be."""
        before = self.window.centre
        self.window.move(centre)
        if self.window.centre != before:
            self.costmap.move(*self.window.corners)

    def planning_point(self, position: Array) -> Array:
        """Return the point (3,) to plan from: ground robots plan in the plane of the costmap."""
        if not self._mission.planar:
            return position.copy()
        layer = self.costmap.origin[2] + 0.5 * self.costmap.resolution
        return np.array([position[0], position[1], layer])

    def evidence_age(self, path: Array, time_ns: int) -> float:
        """Age of the oldest evidence along the path, s; the declared start counts as time 0."""
        observed = self.map.observed_ns_at(path)
        return float(time_ns - max(int(observed.min()), 0)) * 1e-9

    def _integrate_sweep(self, sweep: SweepInput, inputs: Inputs) -> None:
        """Place a sweep by the pose, and integrate its beams and the classes that they hit.

        By that of its own time; without one near that, it is no evidence of any place.
        """
        time_ns = inputs.time_ns - sweep.age_ns
        pose = self._pose_at(time_ns)
        if pose is None or self._is_frozen(sweep, pose.position):
            return
        beams = self._beams[sweep.sensor]
        placed = beams.place(sweep, pose, inputs.sequence)
        if self._config.map.no_return == "ignored":
            placed = placed.without_no_returns()
        origin = Origin(sweep.sensor, beams, pose, range_deviation(placed, beams))
        self.range_sigma = max(self.range_sigma, origin.deviation)
        if self.returns is not None:
            _add(self._as_they_come(placed, origin), self.returns, beams=beams, time_ns=time_ns)
        placed = self.filters(placed, origin)
        _add(placed, to=self.map, beams=beams, time_ns=time_ns)
        if self.on_placed is not None:
            self.on_placed(placed, beams.range, time_ns)
        if self.labels is not None and sweep.classes is not None:
            limits = self._config.map.minimum_range, beams.range
            vote(self.labels, placed, sweep.classes, limits, inputs.sequence)

    def _take_pose(self, inputs: Inputs) -> None:
        """Keep a pose by its stamp, and note its age: one that comes again is no new one."""
        pose, stamp_ns = inputs.pose, inputs.time_ns - inputs.pose.age_ns
        before = self._poses[-1][1] if self._poses else None
        if before is None or (pose.position != before.position).any():
            self._estimated_ns = stamp_ns
        self.pose_age_ns = inputs.time_ns - min(stamp_ns, self._estimated_ns)
        self._poses.append((stamp_ns, pose))

    def _is_frozen(self, sweep: SweepInput, position: Array) -> bool:
        """Return whether a sweep is the one before again, bit by bit, from another position (3,).

        It is then no evidence of what is there now.
        """
        before, place = self._before.get(sweep.sensor, (None, position))
        if before is None or not np.array_equal(before.ranges_mm, sweep.ranges_mm):
            self._before[sweep.sensor] = sweep, position
            return False
        echoes = (sweep.ranges_mm != DROPPED) & (sweep.ranges_mm != NO_RETURN)
        moved = float(np.abs(position - place).max()) > FROZEN_SHIFT
        return moved and int(np.count_nonzero(echoes)) >= FROZEN_ECHOES

    def _pose_at(self, time_ns: int) -> Pose | None:
        """Return the pose nearest to a time; None if none is near."""
        stamp, pose = min(self._poses, key=lambda one: abs(one[0] - time_ns))
        return pose if abs(stamp - time_ns) <= POSE_WITHIN_NS else None

    def _hold_about_body(self, pose: Pose, time_ns: int) -> None:
        """Keep the blind zone about the body from decaying, and the body's own space free."""
        if (reach := self._config.map.no_decay_radius) > 0.0:
            low, high = pose.position - reach, pose.position + reach
            for a_map in self._maps:
                a_map.exempt_from_decay(low, high, time_ns)
        if self._clears_footprint:
            for a_map in self._maps:
                clear_footprint(a_map, self._mission, pose, time_ns)

    def _roll_window(self, position: Array) -> None:
        """Take the rolling window along with a robot at a position (3,)."""
        centre = self.window.centred_on(position)
        if self.window.leaves_behind(centre):
            self.move_window(centre)

    @property
    def _maps(self) -> tuple[Representation, ...]:
        return (self.map,) if self.returns is None else (self.map, self.returns)

    def _declare_start_free(self, a_map: Representation) -> None:
        """Mark the space about the start free: no sensor sees right beside the body."""
        mission, config = self._mission, self._config
        body_radius = self.costmap.inflation_radius + self._extra_radius
        radius = body_radius + config.episode.start_clear_radius
        x, y, z = mission.start
        if not mission.planar:
            a_map.mark_free_sphere((x, y, z), radius, 0)
            return
        low, high = (x - radius, y - radius), (x + radius, y + radius)
        ground = z - mission.rest_height if self._climbs else 0.0
        a_map.mark_floor(low, high, 0, ground)
        top = mission.height + a_map.resolution
        a_map.mark_free((*low, self.costmap.origin[2] + ground), (*high, top + ground), 0)


def _add(placed: WorldSweep, to: Representation, beams: Beams, time_ns: int) -> None:
    """Integrate a placed sweep into a map."""
    to.integrate(
        origins=placed.origins,
        directions=placed.directions,
        ranges_mm=placed.ranges_mm,
        range_limit=beams.range,
        time_ns=time_ns,
        moments=placed.moments,
        spared=placed.spared,
    )


def range_deviation(placed: WorldSweep, beams: Beams) -> float:
    """Estimate the standard deviation of the ranges of a sweep, m; 0 where it is no image."""
    if not beams.is_image:
        return 0.0
    return range_image.range_deviation(image_of(placed, beams)) or 0.0


class Margin(NamedTuple):
    """Localization margin of a decision.

    Attributes:
        least: Along the axis of the least, m.
        widening: Cells by which what is blocked is widened beyond that along x and y.
    """

    least: float
    widening: tuple[int, int]


def margin_of(pose: Pose, config: Config, mission: Mission) -> Margin:
    """Return the localization margin: the configured one and two standard deviations.

    By the stated covariance along the more uncertain of x and y, where these differ; else along the
    worst axis to all sides.
    """
    size = config.map.resolution
    margin = config.costmap.localization_margin
    lever = lever_arm(body_of(mission)) * HEADING_TOLERANCE
    if pose.covariance is None:
        return Margin(margin + MARGIN_SIGMAS * pose.position_sigma + lever, NOT_WIDENED)
    x, y, z = np.sqrt(np.diagonal(pose.covariance)[:3]).tolist()
    least, most = (min(x, y), max(x, y)) if mission.planar else (max(min(x, y), z), max(x, y))
    widened = MARGIN_SIGMAS * (most - least)
    if widened <= ALIKE:
        doubt = min(MARGIN_SIGMAS * pose.position_sigma, MOST_DOUBT * size)
        return Margin(margin + doubt + lever, NOT_WIDENED)
    doubt = min(MARGIN_SIGMAS * least, MOST_DOUBT * size)
    cells = math.ceil(min(widened / size, MOST_WIDENING))
    return Margin(margin + doubt + lever, (cells, 0) if x > y else (0, cells))


def climbs(config: Config, mission: Mission) -> bool:
    """Return whether the robot may walk over ramps."""
    return config.costmap.max_slope > 0.0 and mission.planar and mission.rest_height > 0.0


def _altitude_window(config: Config, mission: Mission) -> tuple[float, float]:
    if mission.planar:
        return -math.inf, math.inf
    return config.motion.altitude_low, config.motion.altitude_high
