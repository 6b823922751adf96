"""Settings of the section `behaviour`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from wayproof.maps.bounds import Bounds, check_fields


@dataclass(frozen=True)
class BehaviourConfig:
    """Rules by which the stack waits, recovers and gives up.

    Attributes:
        wait_timeout: Time at rest before the robot explores, s.
        max_recoveries: Frontiers it explores before the action is `abort`.
        tracking_tolerance: Distance from its trajectory beyond which the robot has left it, m.
        min_advance: Shortest committed part worth leaving rest for, m.
        rotate_in_place_angle: Heading error beyond which a ground robot at rest turns in place,
            rad.
        max_corner_angle: Sharpest corner taken without a stop, rad.
        blend_length: Longest stretch on each side of a corner over which it is rounded, m.
        replan_period: Time between searches for a cheaper global path, s.
        unknown_speed_fraction: Fraction of the speed while unknown space is entered under
            `penalize`.
        unknown_cost: Cost of unknown space to a global path; that of a cell at the edge of the
            inflation is 1. The robot may have to stop before unknown space. A sixteenth of it to a
            robot that flies, on a path of which it sees enough, from `rules` 6 on.
        goal_search_radius: Distance within which a goal inside the inflation is projected to the
            nearest free place, m.
        goal_wait_timeout: Time that the robot waits there for the goal to become free, s.
        max_backtracks: Times it goes back along its own trail before the action is `abort`.
        backtrack_length: Length of one backtrack, m.
        reverse_speed_fraction: Fraction of the speed at which an elongated body moves tail first.
        narrow_speed_fraction: Fraction of the speed of an elongated body that is planned for at its
            heading, between obstacles that come to light late.
        uncertain_sigma: Standard deviation of the position beyond which the robot slows down while
            the sweeps do not hold it, m; this and what follows of estimators that state a
            covariance.
        uncertain_speed_fraction: Fraction of the speed that is left then.
        noisy_sigma: Standard deviation of the ranges of a sweep beyond which the robot slows down
            to that fraction, too, m: half a cell, as echoes then fall into the cells beside theirs.
        lost_sigma: Standard deviation beyond which it goes back to where they did, or gives up, m.
        max_returns: Times it goes back there before the action is `abort`.
        keep_moving: Whether a stop or an escape that is under way is planned on from; else the
            robot comes to rest first.
        rules: Version of the rules of a decision, from 1; a log keeps its own, so that it replays.
            docs/planning.md has what each version changed.

    Raises:
        ValueError: A value is out of its bounds.
    """

    wait_timeout: Annotated[float, Bounds(1e-9, 1e6, "s")] = 1.0
    max_recoveries: Annotated[int, Bounds(1, 1e6)] = 12
    tracking_tolerance: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.8
    min_advance: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.3
    rotate_in_place_angle: Annotated[float, Bounds(1e-9, 1e6, "rad")] = 0.6
    max_corner_angle: Annotated[float, Bounds(1e-9, 1e6, "rad")] = 0.9
    blend_length: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.6
    replan_period: Annotated[float, Bounds(1e-9, 1e6, "s")] = 1.0
    unknown_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.4
    unknown_cost: Annotated[float, Bounds(1e-9, 1e6)] = 4.0
    goal_search_radius: Annotated[float, Bounds(1e-9, 1e6, "m")] = 1.0
    goal_wait_timeout: Annotated[float, Bounds(1e-9, 1e6, "s")] = 5.0
    max_backtracks: Annotated[int, Bounds(1, 1e6)] = 2
    backtrack_length: Annotated[float, Bounds(1e-9, 1e6, "m")] = 1.0
    reverse_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.4
    narrow_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.7
    uncertain_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.1
    uncertain_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.5
    noisy_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.05
    lost_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.5
    max_returns: Annotated[int, Bounds(0, 1e6)] = 1
    keep_moving: bool = True
    rules: Annotated[int, Bounds(1, 14)] = 14

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "behaviour.")

    @property
    def checks_corners(self) -> bool:
        """Whether trajectories are checked at the points of their paths."""
        return self.rules >= 2

    @property
    def bends_keep_clearance(self) -> bool:
        """Whether a bend to stop along comes no nearer to blocked cells than the path does."""
        return self.rules >= 2

    @property
    def grazes_in_order(self) -> bool:
        """Whether the cell that ends a path is sought finely before anything farther on is."""
        return self.rules >= 3

    @property
    def bends_reach_the_stop(self) -> bool:
        """Whether a bend to stop along is judged to where the robot comes to rest."""
        return self.rules >= 3

    @property
    def floor_stands_noise(self) -> bool:
        """Whether walls do not lift the fitted floor, nor single returns make holes in it."""
        return self.rules >= 4

    @property
    def leaves_ended_paths(self) -> bool:
        """Whether a robot at rest at the end of its path, and not at the goal, plans anew."""
        return self.rules >= 4

    @property
    def escapes_disc_by_disc(self) -> bool:
        """Whether each disc of a body keeps its distance to occupied cells on a way out."""
        return self.rules >= 5

    @property
    def whole_bends(self) -> bool:
        """Whether a bend that begins or ends a path limits the speed from that end on."""
        return self.rules >= 5

    @property
    def weighs_time(self) -> bool:
        """Whether a path that costs about as much, and is faster, replaces the present one."""
        return self.rules >= 5

    @property
    def lowers_costs_in_flight(self) -> bool:
        """Whether a robot that flies pays less for what it will see in time, and for nearness."""
        return self.rules >= 6

    @property
    def bends_early(self) -> bool:
        """Whether a body that need not face along its path may leave it before it could stop."""
        return self.rules >= 6

    @property
    def times_waypoints_alike(self) -> bool:
        """Whether waypoints of a stack on trial are timed as the built-in stack's paths are."""
        return self.rules >= 6

    @property
    def bends_by_jerk(self) -> bool:
        """Whether a bend to stop along allows for the jerk limit; else it brakes at once."""
        return self.rules >= 7

    @property
    def limits_yaw_acceleration(self) -> bool:
        """Whether the heading follows a path within the yaw acceleration of the robot."""
        return self.rules >= 7

    @property
    def escapes_oriented(self) -> bool:
        """Whether a body leaves an inflation that its discs only graze by their own way out."""
        return self.rules >= 7

    @property
    def keeps_admitted_trajectories(self) -> bool:
        """Whether an elongated body keeps an admitted trajectory where its path has closed."""
        return self.rules >= 7

    @property
    def judges_ranges(self) -> bool:
        """Whether lost echoes and noise are looked for in the sweeps themselves."""
        return self.rules >= 7

    @property
    def drops_false_returns(self) -> bool:
        """Whether single returns before all around them are no evidence, where there are many."""
        return self.rules >= 8

    @property
    def confirms_holes(self) -> bool:
        """Whether floor is missing only where many sweeps in a row find none, under `forbid`."""
        return self.rules >= 9

    @property
    def holds_seen_floor(self) -> bool:
        """Whether floor that was seen is no hole, though beams went below it."""
        return self.rules >= 9

    @property
    def judges_silence(self) -> bool:
        """Whether silence that the map contradicts counts after some sweeps in a row alone."""
        return self.rules >= 10

    @property
    def remembers_gaps(self) -> bool:
        """Whether ways through narrow gaps that closed before an elongated body cost more."""
        return self.rules >= 11

    @property
    def turns_early(self) -> bool:
        """Whether an elongated body turns as it drives where it can finish the turn on the way."""
        return self.rules >= 11

    @property
    def drops_hooks(self) -> bool:
        """Whether short steps back are left out of the path of a robot that walks."""
        return self.rules >= 11

    @property
    def steps_to_poses(self) -> bool:
        """Whether an elongated body steps to the next pose of its way where its path is blocked."""
        return self.rules >= 11

    @property
    def turns_by_direction(self) -> bool:
        """Whether a robot that walks and turns into its path keeps to a speed by its direction."""
        return self.rules >= 11

    @property
    def stops_at_heading(self) -> bool:
        """Whether an elongated body stops at its heading where it does not fit as it turns."""
        return self.rules >= 11

    @property
    def goes_on_shortened(self) -> bool:
        """Whether an elongated body drives its last path as far as it fits before it brakes."""
        return self.rules >= 11

    @property
    def turns_in_place_alone(self) -> bool:
        """Whether a robot that turns into its path goes on with no motion but a turn in place."""
        return self.rules >= 11

    @property
    def shortens_often(self) -> bool:
        """Whether an elongated body looks longer for the part of a path along which it fits."""
        return self.rules >= 11

    @property
    def steps_oriented(self) -> bool:
        """Whether a step to a pose goes on by the oriented footprint, which alone is checked."""
        return self.rules >= 12

    @property
    def escapes_at_heading(self) -> bool:
        """Whether an elongated body leaves the inflation at the heading that it is checked at."""
        return self.rules >= 12

    @property
    def slows_at_unknown(self) -> bool:
        """Whether unknown space under `penalize` limits the speed in it, not on the way to it."""
        return self.rules >= 13

    @property
    def limits_course(self) -> bool:
        """Whether commands of a stack on trial are limited in corners and first heading, too."""
        return self.rules >= 14

    @property
    def goes_on_turning(self) -> bool:
        """Whether waypoints of a stack on trial go on with a turn in place that is under way."""
        return self.rules >= 14
