"""Failures of code from outside, a stack on trial or a predictor, in this process or another."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import ClassVar, Literal

from wayproof.harness.errors import InputError, NeverReturned
from wayproof.plugin import UserCodeError, user_code

Way = Literal["died", "hung", "broken"]
"""Way in which code from outside fails: it ended; gave no answer in time; or no valid one."""

StackCause = Literal["stack_died", "stack_hung", "stack_broken"]
PredictorCause = Literal["predictor_died", "predictor_hung", "predictor_broken"]


class OutsideError(UserCodeError):
    """Code from outside that cannot go on.

    Attributes:
        cause: Cause of the episode's end.
        traceback: Traceback of that code, as another process sent it; empty without one.
    """

    role: ClassVar[Literal["stack", "predictor"]]

    def __init__(self, who: str, what: str, way: Way = "broken", traceback: str = "") -> None:
        """Name the code and say what it did, in one line."""
        super().__init__(who, what)
        self.cause: StackCause | PredictorCause = f"{self.role}_{way}"  # type: ignore[assignment]
        self.traceback = traceback


class StackError(OutsideError):
    """A stack on trial that cannot go on."""

    role = "stack"


class PredictorError(OutsideError):
    """A predictor from outside that cannot go on."""

    role = "predictor"


class NotStarted(InputError):
    """A stack on trial that fails as it is started, before anything is decided.

    Attributes:
        failure: What it did.
    """

    def __init__(self, failure: StackError) -> None:
        """Say in one line what it did."""
        what = str(failure).removeprefix(f"{failure.who} ")
        super().__init__(f"{failure.who} cannot be started: it {what}")
        self.failure = failure


@contextlib.contextmanager
def code_from_outside(who: str, kind: type[OutsideError]) -> Iterator[None]:
    """Run code from outside; any exception becomes a failure of it.

    Args:
        who: The code, in words.
        kind: Error that it becomes.

    Raises:
        OutsideError: Of that kind, with the exception as its cause.
    """
    try:
        with user_code(who):
            yield
    except UserCodeError as error:
        raised = error.__cause__
        way: Way = "hung" if isinstance(raised, NeverReturned) else "broken"
        raise kind(who, str(error).removeprefix(f"{who} "), way) from raised
