"""The costmap of one body: what it may enter, how far it is from what it may not, and the cost."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maps import _field_kernels as kernels
from maps.config import MapConfig
from maps.states import FREE, OCCUPIED
from maps.window import Window

MAX_REACH = 181  # cells; twice its square still fits 16 bits
INSCRIBED_COST = 252.0
"""Cost at the edge of what is forbidden; Nav2 keeps 253 and 254 for what is inside."""

COST_STEPS = 2.0**20
"""Costs are whole multiples of one over this."""

MOTIONS = ("ground", "air")
ROUNDING = 1e-6  # of a cell


class Costmap:
    """Distances and cost for one body over a voxel map.

    On the ground the map is projected to a plane (nz = 1). A column is occupied if something stands
    between the step height and the body's height, or if a beam went through where the floor should
    be; it is free if all of that band is free and a floor was seen below; else unknown. What hangs
    above the body does not matter. In the air the map is used as it is, between floor and ceiling,
    and the body is a ball.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
        origin: (3,) corner of the first cell, m, world.
        shape: (nx, ny, nz) cells; nz is 1 on the ground.
        state: (nx, ny, nz) uint8, the three states.
        clearance: (nx, ny, nz) uint16, squared distance in cells to the nearest cell that is not
            free: occupied, unknown or outside; at most `truncation`.
        obstacle_clearance: (nx, ny, nz) uint16, the same to the nearest occupied or outside cell.
        margin: Localization margin of the last update, m.
        inflation_radius: Body's radius, margin and half a cell's diagonal, m.
        blocked_at_or_below: A cell is forbidden where its squared distance is at most this.
        truncation: Greatest squared distance that is told, cells^2.
        cost_table: (truncation + 1,) float64, cost by squared distance; inf where forbidden.
    """

    def __init__(
        self,
        config: MapConfig,
        voxel_map: Window,
        motion: str,
        radius: float,
        height: float,
        step_height: float,
        floor: float = -math.inf,
        ceiling: float = math.inf,
    ) -> None:
        """Make a costmap and update it with the configured margin.

        Args:
            config: The settings.
            voxel_map: The map that it follows.
            motion: `ground` or `air`.
            radius: Of the body's disc (ground) or ball (air), m.
            height: Of the body's back above the floor, m; ground only.
            step_height: What the body can step on, m above the floor; ground only.
            floor: Lowest altitude that any of the body may be at, m, world; air only.
            ceiling: Highest altitude that any of the body may be at, m, world; air only.

        Raises:
            ValueError: The body does not fit the map, or the motion is not known.
        """
        if motion not in MOTIONS:
            raise ValueError(f"motion: got {motion!r}, expected one of {', '.join(MOTIONS)}")
        if not 0.0 < radius < math.inf:
            raise ValueError(f"radius: got {radius:g}, expected more than 0 m")
        self.config = config
        self.motion = motion
        self.radius = radius
        self.resolution = voxel_map.resolution
        self._map = voxel_map
        # The layers that matter: the body's band on the ground, the altitude window in the air.
        self._first, self._end = (
            _body_band(voxel_map, height, step_height)
            if motion == "ground"
            else _altitude_window(voxel_map, floor, ceiling)
        )
        nx, ny, _ = voxel_map.shape
        self.shape = (nx, ny, 1 if motion == "ground" else self._end - self._first)
        self.origin = voxel_map.origin + np.array([0.0, 0.0, self._first * self.resolution])
        self.state = np.empty(self.shape, np.uint8)
        self.clearance = np.empty(self.shape, np.uint16)
        self.obstacle_clearance = np.empty(self.shape, np.uint16)
        self._scratch = np.empty(self.shape, np.uint16)
        self.update(config.inflation_margin)

    def update(self, margin: float) -> None:
        """Recompute states, distances and costs from the map as it is now.

        Args:
            margin: Localization margin that is added to the body's radius, m.

        Raises:
            ValueError: The margin is negative or not finite, or the distances that it asks for are
                longer than 181 cells.
        """
        self._set_margin(margin)
        if self.motion == "ground":
            kernels.project_columns(
                self._map.log_odds, self._map.grid.floor_layer, self._first, self._end, self.state
            )
        else:
            self.state[:] = self._map.states()[:, :, self._first : self._end]
        reach = math.isqrt(self.truncation)
        self._measure(self.state != FREE, reach, self.clearance)
        self._measure(self.state == OCCUPIED, reach, self.obstacle_clearance)

    def field(self) -> NDArray[np.uint16]:
        """The distances that the policy commits to, (nx, ny, nz).

        Under `forbid` those to anything not known to be free, otherwise those to obstacles.
        """
        forbid = self.config.unknown_policy == "forbid"
        return self.clearance if forbid else self.obstacle_clearance

    def admissible(self) -> NDArray[np.bool_]:
        """Where the body's centre may be under the policy, (nx, ny, nz)."""
        return self.field() > self.blocked_at_or_below

    def _set_margin(self, margin: float) -> None:
        """Work out the forbidden distance, the reach of the fields and the costs."""
        if not 0.0 <= margin < math.inf:
            raise ValueError(f"margin: got {margin:g}, expected 0 m or more")
        # Distances are between centres, but a surface may lie anywhere in its cell: half a
        # diagonal more. Where in its own cell the body stands is for the margin to cover.
        diagonal = math.sqrt(2.0 if self.motion == "ground" else 3.0)
        forbidden = (self.radius + margin) / self.resolution + 0.5 * diagonal  # cells
        reach = math.ceil(forbidden + self.config.cost_range / self.resolution)
        if reach > MAX_REACH:
            raise ValueError(
                f"margin: got {margin:g} m, which needs distances up to {reach} cells, "
                f"expected at most {MAX_REACH}"
            )
        self.margin = margin
        self.inflation_radius = forbidden * self.resolution
        self.blocked_at_or_below = math.floor(forbidden * forbidden + ROUNDING)
        self.truncation = reach * reach
        self.cost_table = self._costs(forbidden)

    def _costs(self, forbidden: float) -> NDArray[np.float64]:
        """Nav2's law (inflation layer): 252 exp(-scaling (distance - forbidden)); 0 at the end."""
        squared = np.arange(self.truncation + 1)
        beyond = (np.sqrt(squared) - forbidden) * self.resolution  # m
        costs = INSCRIBED_COST * np.exp(-self.config.cost_scaling_factor * np.maximum(beyond, 0.0))
        # The last bits of exp vary between processors; a decision must not.
        costs = np.rint(costs * COST_STEPS) / COST_STEPS
        costs[squared <= self.blocked_at_or_below] = math.inf
        costs[-1] = 0.0  # that far or farther
        return costs

    def _measure(self, blocked: NDArray[np.bool_], reach: int, squared: NDArray[np.uint16]) -> None:
        # A plane is handed over as (1, nx, ny), so that its rows are long and contiguous.
        shape = (1, *self.shape[:2]) if self.motion == "ground" else self.shape
        kernels.squared_distances(
            blocked.reshape(shape), reach, self._scratch.reshape(shape), squared.reshape(shape)
        )


def _body_band(voxel_map: Window, height: float, step_height: float) -> tuple[int, int]:
    """First and one past the last layer whose cells reach between the step height and height."""
    if not 0.0 <= step_height < height:
        raise ValueError(
            f"step_height: got {step_height:g}, expected 0 to below the height, {height:g} m"
        )
    floor_layer, layers = voxel_map.grid.floor_layer, voxel_map.shape[2]
    bottom = voxel_map.origin[2]
    first = math.floor((step_height - bottom) / voxel_map.resolution + ROUNDING)
    end = math.ceil((height - bottom) / voxel_map.resolution - ROUNDING)
    if not 0 <= floor_layer < first:
        raise ValueError(
            f"step_height: got {step_height:g} m, in layer {first}, expected above the floor's "
            f"layer {floor_layer}, and that one in the map"
        )
    if end > layers:
        top = bottom + layers * voxel_map.resolution
        raise ValueError(f"height: got {height:g}, expected up to the map's top, {top:g} m")
    return first, end


def _altitude_window(voxel_map: Window, floor: float, ceiling: float) -> tuple[int, int]:
    """First and one past the last layer that lie wholly between floor and ceiling."""
    bottom, layers = voxel_map.origin[2], voxel_map.shape[2]
    top = bottom + layers * voxel_map.resolution
    low, high = max(floor, bottom), min(ceiling, top)
    first = math.ceil((low - bottom) / voxel_map.resolution - ROUNDING)
    end = math.floor((high - bottom) / voxel_map.resolution + ROUNDING)
    if first >= end:
        raise ValueError(
            f"floor, ceiling: got {floor:g} to {ceiling:g}, "
            f"expected a layer of the map within them ({bottom:g} to {top:g} m)"
        )
    return first, end
