"""Connections to a stack: a registered name, a class, a policy, a command, a socket, ROS 2.

Each gives a session, which is started with a task and answers observations with commands.
"""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import Protocol, runtime_checkable

from wayproof.harness.config import BUILTIN
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.interface.command_messages import CommandError, command_message
from wayproof.harness.interface.connection import ChildProcess, Socket
from wayproof.harness.interface.errors import (
    STACK_CAUSES,
    NotStarted,
    StackError,
    code_from_outside,
)
from wayproof.harness.interface.policy import PolicyStack
from wayproof.harness.interface.remote import STARTING_S, RemoteStack
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.interface.types import Observation, Stack, Task
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.maps import Costmap
from wayproof.planners.ompl._plugin import UserCodeError, load_class, source_digest, user_code

EXEC, SOCKETS, ROS2, POLICY = "exec:", ("unix:", "tcp:"), "ros2", "policy:"


class Session(Protocol):
    """A stack that is connected."""

    def start(self, task: Task) -> None:
        """Send the task."""

    def announce(self) -> None:
        """Announce that an observation follows at once."""

    def query(self, observation: Observation) -> sb.Command:
        """Return the command that answers an observation."""

    def close(self) -> None:
        """End the stack."""

    def stderr(self) -> str:
        """Return the end of its standard error; empty of a class."""


@runtime_checkable
class ShowsReferee(Protocol):
    """A session that shows the referee's costmap to observers."""

    def show(self, costmap: Costmap) -> None:
        """Show the costmap and its updates from now on."""


def stack_code(who: str) -> contextlib.AbstractContextManager[None]:
    """Run a stack's code; any exception becomes a `StackError`.

    Raises:
        StackError: With the exception as its cause.
    """
    return code_from_outside(who, lambda what, way: StackError(who, what, STACK_CAUSES[way]))


class InProcess:
    """A class of this process as a session."""

    def __init__(self, stack: Stack, who: str) -> None:
        """Call its methods, and name it in messages."""
        self._stack, self._who = stack, who

    def start(self, task: Task) -> None:
        """Start it."""
        with stack_code(self._who):
            self._stack.start(task)

    def announce(self) -> None:
        """Do nothing: a class of this process does not sleep."""

    def query(self, observation: Observation) -> sb.Command:
        """Return the command that answers an observation.

        Raises:
            StackError: It raised, or returned what is no command.
        """
        with stack_code(self._who):
            command = self._stack.step(observation)
        try:
            return command_message(command, observation.sequence)
        except CommandError as error:
            raise StackError(self._who, f"returned no valid command: {error}") from None

    def close(self) -> None:
        """Close it; what it raises then changes nothing, as in a process of its own."""
        with contextlib.suppress(StackError), stack_code(self._who):
            self._stack.close()

    def stderr(self) -> str:
        """Return nothing: it shares this process's."""
        return ""


class FailedInStart:
    """A stack that failed as it was started, as a session that fails at the first observation."""

    def __init__(self, failure: StackError) -> None:
        """Take the failure."""
        self._failure = failure

    def start(self, task: Task) -> None:
        """Do nothing: it failed."""

    def announce(self) -> None:
        """Do nothing: it failed."""

    def query(self, observation: Observation) -> sb.Command:
        """Fail.

        Raises:
            StackError: The failure.
        """
        raise self._failure

    def close(self) -> None:
        """Do nothing: it is closed."""

    def stderr(self) -> str:
        """Return nothing: its failure has the traceback."""
        return ""


def start_session(session: Session, task: Task) -> None:
    """Start a stack with its task.

    Raises:
        NotStarted: It fails in its start.
    """
    try:
        session.start(task)
    except StackError as failure:
        raise NotStarted(failure) from failure


def connect(name: str, wall_s: float) -> Session:
    """Connect to a stack.

    Args:
        name: A key of `STACKS`, `module:Class`, `path/to/file.py:Class`, `policy:FILE.onnx`,
            `exec:COMMAND`, `unix:PATH`, `tcp:HOST:PORT`, or `ros2` with options.
        wall_s: Wall time for each answer of another process, s.

    Raises:
        InputError: There is no such stack, or it does not answer.
    """
    who = f"stack '{name}'"
    if name.startswith(EXEC):
        return RemoteStack(ChildProcess(name.removeprefix(EXEC)), who, wall_s)
    if name.startswith(SOCKETS):
        return RemoteStack(Socket(name, wall_s), who, wall_s)
    if is_ros2(name):
        from wayproof.harness.interface.ros2.stack import Ros2Stack  # of an extra

        return Ros2Stack(name, wall_s, max(wall_s, STARTING_S))
    return InProcess(make_stack(name), who)


def make_stack(name: str) -> Stack:
    """Return a registered stack, a policy, or an instance of a class of the user's own.

    Raises:
        InputError: There is none, or it cannot be made.
    """
    if name in STACKS:
        return STACKS[name]()
    if name.startswith(POLICY):
        return PolicyStack(Path(name.removeprefix(POLICY)))
    if ":" not in name:
        raise unknown_name("stack.name", name, [BUILTIN, *STACKS, ROS2])
    try:
        kind = load_class(name)
    except ValueError as error:
        raise InputError(f"stack.name: got '{name}', which cannot be loaded: {error}") from None
    missing = [one for one in ("start", "step", "close") if not callable(getattr(kind, one, None))]
    if missing:
        raise InputError(
            f"stack.name: got '{name}', a class without {', '.join(missing)}; expected one with "
            "start(task), step(observation) and close()"
        )
    try:
        with user_code(f"stack '{name}'"):
            stack: Stack = kind()
    except UserCodeError as error:
        raise InputError(f"stack.name: {error}") from None
    return stack


def stack_digest(name: str) -> str:
    """Return the SHA-256, in hex, of the file of a stack in this process; empty if none."""
    if not name.startswith(POLICY):
        return source_digest(name)
    file = Path(name.removeprefix(POLICY))
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def is_users(name: str) -> bool:
    """Return whether a stack's name names code of the user's own."""
    return name != BUILTIN and name not in STACKS


def is_ros2(name: str) -> bool:
    """Return whether a stack's name means ROS 2 nodes."""
    return name.partition(":")[0] == ROS2


def runs_in_process(name: str) -> bool:
    """Return whether a stack of the user's own runs in this process."""
    return is_users(name) and not name.startswith((EXEC, *SOCKETS)) and not is_ros2(name)
