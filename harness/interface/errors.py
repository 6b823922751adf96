"""Failures of a stack on trial, each with the cause that it is of an episode's end."""

from __future__ import annotations

from typing import Literal

from wayproof.planners.ompl._plugin import UserCodeError

StackCause = Literal["stack_died", "stack_hung", "stack_broken"]
"""Ended by itself; gave no answer in time; raised, or sent what is no command."""


class StackError(UserCodeError):
    """A stack on trial that cannot go on.

    Attributes:
        cause: Of the episode's end.
        traceback: Of the stack, as another process sent it; empty without one.
    """

    def __init__(
        self, who: str, what: str, cause: StackCause = "stack_broken", traceback: str = ""
    ) -> None:
        """Name the stack and say what it did, in one line."""
        super().__init__(who, what)
        self.cause = cause
        self.traceback = traceback
