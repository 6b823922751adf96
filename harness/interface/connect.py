"""Connections to a stack or a predictor: a name, a class, a network, a command, a socket, ROS 2.

Each gives a session. That of a stack is started with a task and answers observations with commands,
that of a predictor answers boxes of the map.
"""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from wayproof.harness.config import BUILTIN
from wayproof.harness.errors import InputError, printable, unknown_name
from wayproof.harness.interface.box_messages import Answer
from wayproof.harness.interface.command_messages import CommandError, command_message
from wayproof.harness.interface.connection import ChildProcess, Connection, Socket
from wayproof.harness.interface.errors import (
    NotStarted,
    PredictorError,
    StackError,
    code_from_outside,
)
from wayproof.harness.interface.policy import PolicyStack
from wayproof.harness.interface.remote import (
    MOST_NAME,
    STARTING_S,
    RemotePredictor,
    RemoteStack,
)
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.interface.types import Observation, Stack, Task
from wayproof.harness.prediction.predicted_box import PredictionError, in_steps
from wayproof.harness.prediction.predictor import ANY_SHAPE, BoxPredictor, MapBox, Shape
from wayproof.harness.prediction_config import ONNX_FILE
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.maps import Costmap
from wayproof.plugin import (
    SEPARATOR,
    SUFFIX,
    UserCodeError,
    digest_of,
    files_of,
    load_class,
    source_digest,
    user_code,
)

EXEC, SOCKETS, ROS2, POLICY = "exec:", ("unix:", "tcp:"), "ros2", "policy:"

PREDICTOR_SETTING = "prediction.source"


_isolated = ContextVar("isolated", default=False)


@contextlib.contextmanager
def isolating() -> Iterator[None]:
    """Run classes of the user's own in processes of their own: here they could change the judge."""
    before = _isolated.set(True)
    try:
        yield
    finally:
        _isolated.reset(before)


def is_isolated() -> bool:
    """Return whether a stack or predictor of the user's own runs in a process of its own."""
    return _isolated.get()


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


class PredictorSession(Protocol):
    """A predictor that is connected.

    Attributes:
        name: Name by which it calls itself.
        shape: Cells of the boxes that it takes.
    """

    name: str
    shape: Shape

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box.

        Raises:
            PredictorError: It failed, or what came is no prediction.
        """

    def close(self) -> None:
        """End the predictor."""

    def stderr(self) -> str:
        """Return the end of its standard error; empty of a class."""


class Here:
    """A session that is no other process: nothing to wake, to end or to hear."""

    def start(self, task: Task) -> None:
        """Do nothing."""

    def announce(self) -> None:
        """Do nothing: a class of this process does not sleep."""

    def close(self) -> None:
        """Do nothing."""

    def stderr(self) -> str:
        """Return nothing: it shares this process's."""
        return ""


class InProcess(Here):
    """A stack of this process as a session."""

    def __init__(self, stack: Stack, who: str) -> None:
        """Call its methods, and name it in messages."""
        self._stack, self._who = stack, who

    def start(self, task: Task) -> None:
        """Start it."""
        with code_from_outside(self._who, StackError):
            self._stack.start(task)

    def query(self, observation: Observation) -> sb.Command:
        """Return the command that answers an observation.

        Raises:
            StackError: It raised, or returned what is no command.
        """
        with code_from_outside(self._who, StackError):
            command = self._stack.step(observation)
        try:
            return command_message(command, observation.sequence)
        except CommandError as error:
            raise StackError(self._who, f"returned no valid command: {error}") from None

    def close(self) -> None:
        """Close it; what it raises then changes nothing, as in a process of its own."""
        with contextlib.suppress(StackError), code_from_outside(self._who, StackError):
            self._stack.close()


class InProcessPredictor(Here):
    """A predictor of this process as a session."""

    def __init__(self, source: str) -> None:
        """Make the predictor of a source; see `make_predictor`."""
        self._predictor, self.name = make_predictor(source)
        self._who = f"predictor '{source}'"
        self.shape: Shape = getattr(self._predictor, "shape", ANY_SHAPE)

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box."""
        with code_from_outside(self._who, PredictorError):
            answer = self._predictor.predict(box)
        try:
            return Answer(in_steps(answer, box))
        except PredictionError as error:
            raise PredictorError(self._who, f"predicted what is none: {error}") from None


class FailedInStart(Here):
    """A stack that failed as it was started, as a session that fails at the first observation."""

    def __init__(self, failure: StackError) -> None:
        """Take the failure."""
        self._failure = failure

    def query(self, observation: Observation) -> sb.Command:
        """Fail.

        Raises:
            StackError: The failure.
        """
        raise self._failure


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
    if runs_elsewhere(name) or (runs_in_process(name) and _leaves(name)):
        return RemoteStack(_connection(name, wall_s, "--stack", "stack"), who, wall_s)
    if is_ros2(name):
        from wayproof.harness.interface.ros2.stack import Ros2Stack  # of an extra

        return Ros2Stack(name, wall_s, max(wall_s, STARTING_S))
    return InProcess(make_stack(name), who)


def connect_predictor(source: str, wall_s: float) -> PredictorSession:
    """Connect to a predictor from outside.

    Args:
        source: `module:Class`, `path/to/file.py:Class`, `FILE.onnx`, `exec:COMMAND`, `unix:PATH`
            or `tcp:HOST:PORT`.
        wall_s: Wall time for each answer of another process, s.

    Raises:
        InputError: There is no such predictor, or it does not answer.
    """
    if runs_elsewhere(source) or _leaves(source):
        connection = _connection(source, wall_s, PREDICTOR_SETTING, "predictor")
        return RemotePredictor(connection, f"predictor '{source}'", wall_s)
    return InProcessPredictor(source)


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
    methods = ("start", "step", "close")
    made: Stack = _instance(
        "stack.name", name, "stack", methods, "start(task), step(observation) and close()"
    )
    return made


def make_predictor(source: str) -> tuple[BoxPredictor, str]:
    """Return a network of a file, or an instance of a class of the user's own, and its name.

    Raises:
        InputError: There is none, or it cannot be made.
    """
    made: BoxPredictor
    if source.endswith(ONNX_FILE):
        from wayproof.harness.interface.predictors.onnx_predictor import OnnxPredictor

        made = OnnxPredictor(Path(source))
    else:
        made = _instance(PREDICTOR_SETTING, source, "predictor", ("predict",), "predict(box)")
    name = str(getattr(made, "name", "")) or source.rpartition(":")[2]
    return made, printable(name)[:MOST_NAME]


def _instance(setting: str, name: str, what: str, methods: tuple[str, ...], expected: str) -> Any:
    """Return an instance of a class of the user's own.

    Raises:
        InputError: It cannot be loaded or made, or lacks one of the methods.
    """
    try:
        kind = load_class(name)
    except ValueError as error:
        raise InputError(f"{setting}: got '{name}', which cannot be loaded: {error}") from None
    missing = [one for one in methods if not callable(getattr(kind, one, None))]
    if missing:
        raise InputError(
            f"{setting}: got '{name}', a class without {', '.join(missing)}; expected one with "
            f"{expected}"
        )
    try:
        with user_code(f"{what} '{name}'"):
            return kind()
    except UserCodeError as error:
        raise InputError(f"{setting}: {error}") from None


def code_digest(name: str) -> str:
    """Return the SHA-256, in hex, of the files of a class, network or command; empty without any.

    Of a command those that its words name: a program, a script with what it imports, a module.
    """
    if name.startswith(EXEC):
        return digest_of(_files_of_command(name.removeprefix(EXEC)))
    if not name.startswith(POLICY) and not name.endswith(ONNX_FILE):
        return source_digest(name)
    file = Path(name.removeprefix(POLICY))
    return digest_of([file] if file.is_file() else [])


def _files_of_command(command: str) -> list[Path]:
    """Return the files that the words of a command name, each with what it imports."""
    files: dict[Path, None] = {}
    with contextlib.suppress(ValueError):  # quotes that do not end: the run says so
        words = shlex.split(command)
        for before, word in zip(["", *words], words, strict=False):
            if before == "-m":
                word = f"{word.replace('.', '/')}.py"
            file = Path(word.split(SEPARATOR, 1)[0])
            if file.is_file():
                files |= dict.fromkeys(files_of(file) if file.suffix == SUFFIX else [file])
    return list(files)


def is_users(name: str) -> bool:
    """Return whether a stack's name names code of the user's own."""
    return name != BUILTIN and name not in STACKS


def is_ros2(name: str) -> bool:
    """Return whether a stack's name means ROS 2 nodes."""
    return name.partition(":")[0] == ROS2


def runs_in_process(name: str) -> bool:
    """Return whether a stack of the user's own runs in this process."""
    return is_users(name) and not runs_elsewhere(name) and not is_ros2(name)


def runs_elsewhere(name: str) -> bool:
    """Return whether a stack's or predictor's name is a command or the address of a socket."""
    return name.startswith((EXEC, *SOCKETS))


def _leaves(name: str) -> bool:
    """Return whether a class, but no network, runs in a process of its own."""
    return is_isolated() and not name.startswith(POLICY) and not name.endswith(ONNX_FILE)


def _connection(name: str, wall_s: float, given: str, who: str) -> Connection:
    if name.startswith(EXEC):
        return ChildProcess(name.removeprefix(EXEC), given)
    if name.startswith(SOCKETS):
        return Socket(name, wall_s, given, who)
    serve = [sys.executable, "-m", "wayproof", "serve", name]
    serve += ["--predictor"] if who == "predictor" else []
    return ChildProcess(shlex.join(serve), given, sys.path)
