"""Whether a state is free: what OMPL asks, and where a planner finds the space that it plans in."""

from __future__ import annotations

from ompl import base as ob

from wayproof.planners import kernels
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.ompl.state_spaces import StateSpace


class BodyValidity(ob.StateValidityChecker):  # type: ignore[misc]
    """Checks one state; ``getStateValidityChecker()`` hands it to planners that look at the field.

    Attributes:
        space: Where the body may be.
        kind: What a state is.
        z: Of all states in a plane [m].
        any_heading: Whether a path may end at any heading.
    """

    def __init__(
        self,
        information: ob.SpaceInformation,
        space: FreeSpace,
        kind: StateSpace,
        z: float,
        any_heading: bool = False,
    ) -> None:
        """Check states of a kind in a space."""
        super().__init__(information)
        self.space = space
        self.kind = kind
        self.z = z
        self.any_heading = any_heading

    def isValid(self, state: ob.State) -> bool:
        """Whether the body is free there."""
        pose = self.kind.read(state, self.z)
        if self.kind.oriented:
            return bool(kernels.sweep_free(self.space.grid, self.space.shape, pose, pose))
        threshold = self.space.collision_distance_sq
        return bool(kernels.edge_free(self.space.grid, threshold, pose[:3], pose[:3]))
