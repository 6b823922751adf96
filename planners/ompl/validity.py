"""OMPL's validity checker of a state, which also hands the free space to planners of our own."""

from __future__ import annotations

from ompl import base as ob

from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import segment, sweep
from wayproof.planners.ompl.state_spaces import StateSpace


class BodyValidity(ob.StateValidityChecker):  # type: ignore[misc]
    """Checker of one state; planners that need the free space get it from the space information.

    Attributes:
        space: Free space.
        kind: State space.
        z: Height of all states in a plane, m.
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
        """Return whether the body is free there."""
        pose = self.kind.read(state, self.z)
        if self.kind.oriented:
            return bool(sweep.sweep_free(self.space.grid, self.space.shape, pose, pose))
        threshold = self.space.collision_distance_sq
        return bool(segment.edge_free(self.space.grid, threshold, pose[:3], pose[:3]))
