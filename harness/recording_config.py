"""Settings of the section `recording`: where the inputs come from, and how they are judged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from wayproof.bounds import Bounds, check_fields

SET_BY_RUN = ("format", "sha256", "options", "origin")
"""Fields that follow from the recording, and that `--set` refuses."""

GoalRule = Literal["ahead", "end"]
"""Place of a decision's goal: ahead on the recorded way, or at its end."""


@dataclass(frozen=True)
class RecordingConfig:
    """A recording, and how the stack is taken through it.

    Attributes:
        format: Format of the recording; set by the run.
        sha256: Hash of its files; set by the run.
        options: `name=value` of the options that it was read with, without the defaults
            (`RecordingOptions`); set by the run.
        goal: `ahead`: a place that the robot reached, at least `goal_distance` further along its
            way; `end`: the last place of the recording. `ahead` moves on when the robot comes near.
        goal_distance: Least length of the recorded way to the goal of `ahead`, and the spacing of
            its goals, m. Built in, about two seconds of way at 2 m/s.
        decision_period: Least time between two decisions, s; 0 decides at every sweep. Sweeps in
            between are integrated at the next decision, each from the pose that it was taken at.
        area_margin: Distance from the recorded way to the border of the operating area, m. Nothing
            is mapped beyond it. Not used where the recording states the area, as the topics of an
            episode do.
        origin: Point of the recording's world frame that is the origin of the log's, m; set by the
            run from the first pose and `body_height`.
        body_height: Height of the body's origin above the floor at the first pose, m. The default
            is what the recording states: our logs do, and the frame `base_footprint` of a bag.
        sensor_height: Height of a planar laser above the floor where the recording puts it on the
            floor, m. It matters only whether it lies between `map.min_obstacle_height` and
            `map.max_obstacle_height`.
        position_sigma: Standard deviation of the recorded position, m. Twice it is added to
            `costmap.localization_margin`.
        footprint_clearing: Whether the space of the bare body is marked free wherever it stands.
            The default is false for a recording of an episode's topics, which states its task.
        horizon: Time ahead for which the recorded way is judged, s.

    Raises:
        ValueError: A value is out of its bounds.
    """

    format: str = ""
    sha256: str = ""
    options: tuple[str, ...] = ()
    goal: GoalRule = "ahead"
    goal_distance: Annotated[float, Bounds(0.5, 1000.0, "m")] = 5.0
    decision_period: Annotated[float, Bounds(0.0, 60.0, "s")] = 0.1
    area_margin: Annotated[float, Bounds(0.5, 200.0, "m")] = 10.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    body_height: Annotated[float, Bounds(-100.0, 100.0, "m")] = 0.0
    sensor_height: Annotated[float, Bounds(0.01, 100.0, "m")] = 0.3
    position_sigma: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.0
    footprint_clearing: bool = True
    horizon: Annotated[float, Bounds(0.05, 60.0, "s")] = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "recording.")
