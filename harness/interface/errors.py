"""Failures of code from outside, each with the cause that it is of an episode's end."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Literal

from wayproof.harness.errors import InputError, NeverReturned
from wayproof.planners.ompl._plugin import UserCodeError, user_code

StackCause = Literal["stack_died", "stack_hung", "stack_broken"]
"""Cause of a stack's failure: it ended; gave no answer in time; or sent no valid command."""

PredictorCause = Literal["predictor_died", "predictor_hung", "predictor_broken"]
"""Cause of a predictor's failure: it ended; gave no answer in time; or no valid prediction."""

Way = Literal["died", "hung", "broken"]
"""Way in which code from outside fails."""


class OutsideError(UserCodeError):
    """Code from outside that cannot go on.

    Attributes:
        cause: Cause of the episode's end.
        traceback: Traceback of that code, as another process sent it; empty without one.
    """

    def __init__(
        self, who: str, what: str, cause: StackCause | PredictorCause, traceback: str = ""
    ) -> None:
        """Name the code and say what it did, in one line."""
        super().__init__(who, what)
        self.cause = cause
        self.traceback = traceback


class StackError(OutsideError):
    """A stack on trial that cannot go on."""

    def __init__(
        self, who: str, what: str, cause: StackCause = "stack_broken", traceback: str = ""
    ) -> None:
        """Name the stack and say what it did, in one line."""
        super().__init__(who, what, cause, traceback)


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


class PredictorError(OutsideError):
    """A predictor from outside that cannot go on."""

    def __init__(
        self, who: str, what: str, cause: PredictorCause = "predictor_broken", traceback: str = ""
    ) -> None:
        """Name the predictor and say what it did, in one line."""
        super().__init__(who, what, cause, traceback)


STACK_CAUSES: dict[Way, StackCause] = {
    "died": "stack_died",
    "hung": "stack_hung",
    "broken": "stack_broken",
}
"""Cause of each way in which a stack fails."""

PREDICTOR_CAUSES: dict[Way, PredictorCause] = {
    "died": "predictor_died",
    "hung": "predictor_hung",
    "broken": "predictor_broken",
}
"""Cause of a predictor's failure by its way."""


@contextlib.contextmanager
def code_from_outside(who: str, failure: Callable[[str, Way], OutsideError]) -> Iterator[None]:
    """Run code from outside; any exception becomes a failure of it.

    Args:
        who: The code, in words.
        failure: Makes the error from what the code did, in words, and the way in which it fails.

    Raises:
        OutsideError: As made by `failure`, with the exception as its cause.
    """
    try:
        with user_code(who):
            yield
    except UserCodeError as error:
        raised = error.__cause__
        way: Way = "hung" if isinstance(raised, NeverReturned) else "broken"
        raise failure(str(error).removeprefix(f"{who} "), way) from raised
