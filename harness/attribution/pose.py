"""Error of the pose, compared with what the localization margin covers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.stack.mapping import MARGIN_SIGMAS
from wayproof.maps import CostmapConfig

REACH = 1.0
"""Distance at which a heading error counts if there is no place, m."""


@dataclass(frozen=True)
class PoseFacts:
    """Error of the pose over a range of decisions.

    Attributes:
        error: Position error where it exceeds the covered error most, m.
        height: Height error there, m: that of a body in the air is part of the position error.
        turn: Heading error there, rad.
        covered: Covered error there, m: a usual margin, see `usual_margin`, plus two stated
            standard deviations of the heading at the distance of the place.
        beyond: Greatest excess over the covered error in the range, m; at most 0 if it is covered.
        at_end: Position error at the end, m.
    """

    error: float = 0.0
    height: float = 0.0
    turn: float = 0.0
    covered: float = 0.1
    beyond: float = -0.1
    at_end: float = 0.0

    @property
    def nearly(self) -> bool:
        """Whether the error is more than half of what is covered."""
        return self.beyond > -0.5 * self.covered

    def __str__(self) -> str:
        """Return the error in words."""
        turned = f" and {abs(self.turn):.2f} rad" if abs(self.turn) > 0.02 else ""
        if self.height > self.covered:
            turned += f", and its height {self.height:.2f} m"
        return (
            f"the pose was {self.error:.2f} m{turned} off, and the margin covers "
            f"{self.covered:.2f} m"
        )


def pose_facts(case: Case, numbers: Sequence[int], place: np.ndarray | None = None) -> PoseFacts:
    """Measure the error over some decisions, at a place (3,) if there is one."""
    beyond = [_excess_error(case, case.moments[k], place) for k in numbers]
    worst = case.moments[numbers[int(np.argmax(beyond))]]
    return PoseFacts(
        error=error_of(case, worst),
        height=_height_error(case, worst),
        turn=worst.turn,
        covered=usual_margin(case, worst)
        + MARGIN_SIGMAS * worst.pose.heading_sigma * _reach(case, worst, place),
        beyond=max(beyond),
        at_end=error_of(case, case.moments[-1]),
    )


def usual_margin(case: Case, moment: Moment) -> float:
    """Return the localization margin of a decision, at least that of the default settings, m.

    An error that a usual margin covers is no fault of the pose or the body if less was set.
    """
    short = CostmapConfig().localization_margin - case.config.costmap.localization_margin
    return moment.decision.localization_margin_m + max(short, 0.0)


def error_of(case: Case, moment: Moment) -> float:
    """Return the position error in the axes of motion, m."""
    return float(np.linalg.norm(moment.error[: case.axes]))


def _excess_error(case: Case, moment: Moment, place: np.ndarray | None) -> float:
    reach = _reach(case, moment, place)
    doubt = max(abs(moment.turn) - MARGIN_SIGMAS * moment.pose.heading_sigma, 0.0)
    error = max(_within_margin(case, moment) + doubt * reach, _height_error(case, moment))
    return error - usual_margin(case, moment)


def _height_error(case: Case, moment: Moment) -> float:
    """Return the height error of a body that walks, m; 0 in the air, where motion has three axes.

    It puts the floor among what stands on it, or takes that for floor.
    """
    return abs(float(moment.error[2])) if case.axes == 2 else 0.0


def _within_margin(case: Case, moment: Moment) -> float:
    """Return the error that the margin has to cover beyond its widening along x and y, m."""
    decision, error = moment.decision, np.abs(moment.error[: case.axes])
    if len(decision.widening) == 2:
        widened = np.array(decision.widening) * decision.resolution_m
        error[:2] = np.maximum(error[:2] - widened, 0.0)
    return float(np.linalg.norm(error))


def _reach(case: Case, moment: Moment, place: np.ndarray | None) -> float:
    """Return the distance at which a heading error counts, m."""
    if place is None:
        return REACH
    return float(np.linalg.norm((place - moment.true_position)[: case.axes]))
