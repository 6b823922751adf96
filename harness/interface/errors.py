"""Failures of code from outside, a stack on trial or a predictor, in this process or another."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from wayproof.harness.errors import InputError
from wayproof.plugin import UserCodeError, user_code

PLUGIN_FAILED = "plugin_failed"
"""Cause of what code from outside ends: it died, hung, or gave no valid answer, or none in time."""


class OutsideError(UserCodeError):
    """Code from outside that cannot go on.

    Attributes:
        traceback: Traceback of that code, as another process sent it; empty without one.
    """

    def __init__(self, who: str, what: str, traceback: str = "") -> None:
        """Name the code and say what it did, in one line."""
        super().__init__(who, what)
        self.traceback = traceback


class StackError(OutsideError):
    """A stack on trial that cannot go on."""


class PredictorError(OutsideError):
    """A predictor from outside that cannot go on."""


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
        raise kind(who, str(error).removeprefix(f"{who} ")) from error.__cause__
