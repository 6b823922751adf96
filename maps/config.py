"""Settings of maps and of the costmap made from one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from wayproof.bounds import Bounds, check_fields

UnknownPolicy = Literal["forbid", "penalize", "allow"]
"""Rule of a planner for a cell that was never observed."""

LEAST_WINDOW = 24.0
"""Least edge of a rolling window, m: sensors and stops reach about 12 m ahead."""

NoReturn = Literal["free", "ignored"]
"""Evidence of a beam without return."""


@dataclass(frozen=True)
class DynamicConfig:
    """Settings of the map kind `dynamic`, which separates moving objects from the static scene.

    Attributes:
        burn_in: Time for which a cell and its neighbours must be free before an object that appears
            there counts as dynamic, s. 5 sweeps of 0.1 s, the burn-in of Dynablox (Schmid et al.
            2023, RA-L 8).
        flag_on_first_hit: Whether a cell is dynamic from its first hit on. If not, only the cells
            of an object that was seen to move are: a surface that is hit for the first time is
            static.
        free_after_misses: Consecutive sweeps that must cross a dynamic cell before it is free; 2 is
            Dynablox's temporal buffer, which bridges the gaps between beams.
        static_after: Time after which a new object that has not moved becomes part of the static
            scene, s. Dynablox waits for 150 sweeps of 0.1 s; but what looks like motion is often a
            surface between sparse beams, and at 0.25 m/s a body of 0.5 m has passed.
        prediction_horizon: Time for which moving objects are predicted and their paths held
            occupied, s. The default spans two sweeps of 0.1 s.

    Raises:
        ValueError: A value is out of its bounds.
    """

    burn_in: Annotated[float, Bounds(0.01, 3600.0, "s")] = 0.5
    flag_on_first_hit: bool = False
    free_after_misses: Annotated[int, Bounds(1, 1000, "sweeps")] = 2
    static_after: Annotated[float, Bounds(0.01, 1e6, "s")] = 2.0
    prediction_horizon: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.2

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "map.dynamic.")


@dataclass(frozen=True)
class MapConfig:
    """Settings of a map.

    Attributes:
        kind: Name of the representation, a key of `maps.MAPS`.
        resolution: Edge of a cell, m.
        log_odds_hit: Log-odds that one return adds to its cell; 0.9 is p = 0.71. Increments and
            clamping thresholds are near OctoMap's (Hornung et al. 2013, Autonomous Robots 34:
            p 0.7 / 0.4, 0.12 to 0.97).
        log_odds_miss: Log-odds that one beam takes from a cell it crosses; 0.4 is p = 0.40.
        prob_min: Lower clamping threshold of a cell's probability, so that free cells can change.
        prob_max: Upper clamping threshold.
        half_life: Time in which unobserved evidence loses half its log-odds, s of simulated time;
            0 means no decay.
        no_decay_radius: Half edge of the cube around the body's centre that is exempt from decay,
            m: sensors often do not see the ground under the body. 0 is off, as a change there that
            no sensor sees would be missed as well. Kinds `voxel` and `dynamic` only.
        decay_period: Time between two decay ticks, s of simulated time.
        minimum_range: Nearer returns are dropped, m: they are mostly the sensor's own housing.
        no_return: Evidence of a beam that its sensor reports as without return: `free`, all cells
            up to the range limit are free, as in OctoMap; or `ignored`, as by default in Nav2
            (`inf_is_valid`). Where returns get lost, the first makes holes in floors and walls; the
            second leaves ghosts where only open space is behind.
        filters: Filters of returns by name, see `harness.filters`; by default all for the built-in
            stack, and `grazing` alone for a stack on trial, whose returns count as they come.
        min_obstacle_height: Lower end of the heights that a flat grid takes in, m above the floor;
            above the noise of the floor's own returns. As in Nav2's obstacle layer.
        max_obstacle_height: Upper end, m; Nav2's default.
        memory_mib: Bound on the memory of the map's bricks, MiB; beyond it the bricks observed
            longest ago are dropped.
        dynamic: Settings of the kind `dynamic`.

    Raises:
        ValueError: A value is out of its bounds.
    """

    kind: str = "voxel"
    resolution: Annotated[float, Bounds(0.01, 0.5, "m")] = 0.1
    log_odds_hit: Annotated[float, Bounds(0.01, 10.0)] = 0.9
    log_odds_miss: Annotated[float, Bounds(0.01, 10.0)] = 0.4
    # Within these, 8 bits hold at least 18 units to one of log-odds.
    prob_min: Annotated[float, Bounds(0.001, 0.499)] = 0.12
    prob_max: Annotated[float, Bounds(0.501, 0.999)] = 0.97
    half_life: Annotated[float, Bounds(0.0, 1e6, "s")] = 30.0
    no_decay_radius: Annotated[float, Bounds(0.0, 5.0, "m")] = 0.0
    decay_period: Annotated[float, Bounds(0.01, 3600.0, "s")] = 1.0
    minimum_range: Annotated[float, Bounds(0.0, 60.0, "m")] = 0.3
    no_return: NoReturn = "free"
    filters: tuple[str, ...] | None = None
    min_obstacle_height: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.05
    max_obstacle_height: Annotated[float, Bounds(0.01, 100.0, "m")] = 2.0
    memory_mib: Annotated[int, Bounds(1, 65536, "MiB")] = 512
    dynamic: DynamicConfig = field(default_factory=DynamicConfig)

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "map.")
        low, high = self.min_obstacle_height, self.max_obstacle_height
        if high < low + 0.01:
            raise ValueError(
                f"map.max_obstacle_height: got {high:g}, expected {low + 0.01:g} to 100 m"
            )


@dataclass(frozen=True)
class CostmapConfig:
    """Settings of the costmap made from a map.

    Attributes:
        localization_margin: Distance added to the body's radius for the error of localization, m;
            two standard deviations of the believed position come on top.
        unknown_policy: `forbid`: unknown space is not entered; `penalize`: at a cost and slowly;
            `allow`: like free space.
        cost_scaling_factor: Rate at which the cost falls with distance, 1/m. The law is that of
            Nav2's inflation layer, whose default of 10 lets paths run along every corner.
        cost_range: Distance beyond the inscribed radius over which there is a cost, m.
        window: Edge of the window that costmap and distances are kept for, m; it moves along with
            the robot, and beyond it ways are planned in coarse cells. An operating area up to half
            as long again is held whole. 0 holds every area whole.
        max_slope: Steepest ramp that a walking robot may climb, rad; 0: the floor is flat. Cells
            must be no larger than the steps that matter: see `Terrain`.
        max_evidence_age: Greatest age of what the map holds of a way, s: the stopping distance must
            have been seen since, and all that a command of a stack on trial sweeps.
        class_margins: Extra distance kept to objects, by the name of their class, m; needs sweeps
            with classes.

    Raises:
        ValueError: A value is out of its bounds.
    """

    localization_margin: Annotated[float, Bounds(0.0, 5.0, "m")] = 0.1
    unknown_policy: UnknownPolicy = "forbid"
    cost_scaling_factor: Annotated[float, Bounds(0.1, 1000.0, "1/m")] = 4.0
    cost_range: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.6
    window: Annotated[float, Bounds(0.0, 1e4, "m")] = 32.0
    max_slope: Annotated[float, Bounds(0.0, 0.6, "rad")] = 0.0
    max_evidence_age: Annotated[float, Bounds(0.05, 1e6, "s")] = 0.5
    class_margins: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "costmap.")
        if 0.0 < self.window < LEAST_WINDOW:
            raise ValueError(
                f"costmap.window: got {self.window:g}, expected 0 or {LEAST_WINDOW:g} to 10000 m"
            )
        for name, margin in self.class_margins.items():
            if not 0.0 <= margin <= 5.0:
                raise ValueError(f"costmap.class_margins.{name}: got {margin:g}, expected 0 to 5 m")
