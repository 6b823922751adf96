"""Clearances as lower bounds: none is measured beyond a maximum distance."""

from __future__ import annotations

import math

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.truth import CLEARANCE_REACH


def true_clearance_is_bound(clearance: float) -> bool:
    """Return whether a true clearance, m, is a lower bound."""
    return clearance >= CLEARANCE_REACH


def map_clearance_is_bound(decision: pb.Decision, cost_range: float) -> bool:
    """Return whether a decision's least clearance in the map is a lower bound.

    Distances in the map end at a whole number of cells, the first one that holds the costs.

    Args:
        decision: Decision with the clearance and the inflation radius.
        cost_range: `costmap.cost_range` of its config, m.
    """
    size, clearance = decision.resolution_m, decision.least_clearance_m
    cells = round(clearance / size)
    reach = math.ceil(decision.inflation_radius_m / size + cost_range / size)
    return cells >= reach and math.isclose(clearance, cells * size)


def in_metres(clearance: float, is_bound: bool) -> str:
    """Return `0.53 m`, or `>= 0.80 m` for a bound."""
    return f"{'>= ' if is_bound else ''}{clearance:.2f} m"


def true_in_metres(clearance: float) -> str:
    """Return a true clearance in words."""
    return in_metres(clearance, true_clearance_is_bound(clearance))
