"""Failures of a user's code in an episode: it may raise, never return, or take all memory.

A planner or controller of the user's own ends its episode as `error`, with its traceback in the
log. So does a fault of Wayproof's own, which is raised on besides.
"""

from __future__ import annotations

import contextlib
import faulthandler
import signal
import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from types import FrameType

from wayproof.harness.config import PLUGIN, Config
from wayproof.harness.errors import InputError, NeverReturned, printable
from wayproof.harness.interface.connect import (
    code_digest,
    is_isolated,
    runs_elsewhere,
    runs_in_process,
)
from wayproof.harness.interface.errors import OutsideError
from wayproof.harness.supervision import stacks_file
from wayproof.plugin import UserCodeError

LONGEST_TRACEBACK = 16_384
"""Maximum number of characters of a traceback in a log; its end is kept."""

LONGEST_LINE = 400
"""Maximum number of characters of a line of a traceback."""

REPEAT_S = 1.0
"""Time after which code that catches the first interruption gets another, s."""

LONGEST_GRACE_S = 10.0
"""Maximum time that code outside Python, which cannot be interrupted, gets besides, s."""


@dataclass(frozen=True)
class Failure:
    """Failure of code that ended an episode.

    Attributes:
        reason: Reason in one line, with the decision's number.
        traceback: Printable lines, the last of them the exception's; empty of a stack in another
            process that sent none.
        ours: Whether Wayproof's own code is at fault.
    """

    reason: str
    traceback: str
    ours: bool


def plugins_of(config: Config) -> list[str]:
    """Return the user's classes of a config, as `module:Class` or `path/to/file.py:Class`."""
    names = [config.planner.name]
    if runs_in_process(config.stack.name):
        names.append(config.stack.name)
    source = config.prediction.source
    if config.runs_predictor and PLUGIN in source and not runs_elsewhere(source):
        names.append(source)
    if config.robot_file:
        from wayproof.models.robots.custom import (  # it loads the simulator
            RobotSpecError,
            parse_spec,
        )

        with contextlib.suppress(RobotSpecError):
            names.append(parse_spec(config.robot_file).controller)
    return [name for name in names if PLUGIN in name]


def plugin_digests(config: Config) -> dict[str, str]:
    """Return the SHA-256 of the code of each of the user's classes, networks and commands.

    A socket or a ROS 2 node has none; `stack.version` names what Wayproof cannot read.
    """
    source = config.prediction.source
    names = [*plugins_of(config), config.stack.name, *([source] if config.runs_predictor else [])]
    digests = {name: code_digest(name) for name in names}
    return {name: digest for name, digest in digests.items() if digest}


def failure_of(error: BaseException, place: str, names: list[str]) -> Failure:
    """Classify an exception as a failure of a user's code or of ours.

    Args:
        error: The exception.
        place: Time of it, such as `at decision 12`.
        names: The user's classes in use.
    """
    raised = error.__cause__ if isinstance(error, UserCodeError) else None
    text = bounded("".join(traceback.format_exception(raised or error)))
    if isinstance(error, OutsideError) and raised is None:
        text = bounded(error.traceback) if error.traceback else ""  # ours would say nothing of it
    if isinstance(error, UserCodeError):
        line = f"{error.who} {raised}" if isinstance(raised, NeverReturned) else str(error)
        return Failure(printable(f"{line} {place}"), text, ours=False)
    if isinstance(error, NeverReturned):
        return Failure(printable(f"{', '.join(names)} {error} {place}"), text, ours=False)
    if isinstance(error, MemoryError) and names:
        return Failure(f"out of memory with {', '.join(names)} {place}", text, ours=False)
    line = " ".join(str(error).split())[:200]
    reason = printable(f"internal error: {type(error).__name__}: {line} {place}")
    return Failure(reason, text, ours=True)


def bounded(text: str) -> str:
    """Return the end of a text in printable lines, as a log and a terminal may hold them."""
    lines = [printable(line)[:LONGEST_LINE] for line in text.splitlines()]
    kept, size = [], 0
    for line in reversed(lines):
        size += len(line) + 1
        if size > LONGEST_TRACEBACK:
            kept.append("[the beginning is left out]")
            break
        kept.append(line)
    return "\n".join(reversed(kept)) + "\n"


class Watchdog:
    """Interrupts a user's code that does not return; without such code it does nothing.

    It needs the main thread, as only that one can be interrupted. Wall time decides when it acts,
    so what it ends is an `error`, and no decision follows from it.

    Attributes:
        names: The user's classes in use.
    """

    def __init__(self, config: Config) -> None:
        """Watch the user's classes of a config."""
        elsewhere = (config.stack.name, config.prediction.source) if is_isolated() else ()
        self.names = [name for name in plugins_of(config) if name not in elsewhere]
        self._wall_s = config.plugins.wall_s
        in_main = threading.current_thread() is threading.main_thread()
        self._active = bool(self.names) and in_main
        self._stacks = stacks_file()

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Bound the block.

        Raises:
            NeverReturned: It took longer.
        """
        if not self._active:
            yield
            return
        before = signal.signal(signal.SIGALRM, self._interrupt)
        signal.setitimer(signal.ITIMER_REAL, self._wall_s, REPEAT_S)
        if self._stacks is not None:
            longest = self._wall_s + min(self._wall_s, LONGEST_GRACE_S)
            faulthandler.dump_traceback_later(longest, exit=True, file=self._stacks.fileno())
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            if self._stacks is not None:
                faulthandler.cancel_dump_traceback_later()
            signal.signal(signal.SIGALRM, before)

    def _interrupt(self, _: int, __: FrameType | None) -> None:
        raise NeverReturned(f"had not returned after {self._wall_s:g} s (plugins.wall_s)")


PASSED_ON = (InputError, OSError)
"""Exceptions that end an episode but are no failure of code: bad input, a full disk."""
