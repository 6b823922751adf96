"""Policy of an ONNX file as a stack: documented tensors in, a velocity out.

Run by ONNX Runtime on one thread of the processor, one operator after the other. The file is all
that the policy is: weights in other files are refused, so that its SHA-256 identifies it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.interface.policy_tensors import (
    ACTION,
    OBSERVATION,
    PolicyObserver,
    velocity_of,
)
from wayproof.harness.interface.types import Command, Observation, Task

OUTPUT = "action"
"""Name of the output that is the action."""

MAX_BYTES = 2**29
"""Greatest size of a policy's file, bytes."""

FLOAT = "tensor(float)"
"""ONNX Runtime's name of the type float32."""


class Node(Protocol):
    """An input or an output of a model, as ONNX Runtime describes it."""

    name: str
    type: str
    shape: Sequence[int | str | None]


class PolicyStack:
    """Commands the velocity that a policy answers to the tensors of an observation."""

    def __init__(self, path: Path) -> None:
        """Load a policy, check its inputs and outputs, and run it once.

        Raises:
            InputError: There is no such file, it is no model, its inputs or outputs are others, or
                ONNX Runtime is not installed.
        """
        self._session = load_model(path)
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        _check_nodes(path, inputs, outputs)
        self._names = [node.name for node in inputs]
        zeros = {name: np.zeros(OBSERVATION[name].shape, np.float32) for name in self._names}
        try:
            action = self._run(zeros)
        except Exception as error:
            raise InputError(f"policy '{path}': cannot be run: {_one_line(error)}") from None
        if action.shape != (1, *ACTION.shape):
            raise InputError(
                f"policy '{path}': '{OUTPUT}' has shape {action.shape} when it is run; expected "
                f"{(1, *ACTION.shape)}"
            )

    def start(self, task: Task) -> None:
        """Take the body, its limits and the goal."""
        self._mission = task.mission
        self._observer = PolicyObserver(task)

    def step(self, observation: Observation) -> Command:
        """Return the policy's action as a velocity."""
        return Command(velocity_of(self.act(self._observer.tensors(observation)), self._mission))

    def close(self) -> None:
        """Do nothing: there is nothing to end."""

    def act(self, tensors: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return the action (4,) that answers the tensors of `OBSERVATION`, without a batch."""
        action: NDArray[np.float32] = self._run(tensors)[0]
        return action

    def _run(self, tensors: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return the output (1, 4) for a batch of one."""
        batch = {name: tensors[name][None] for name in self._names}
        return self._session.run([OUTPUT], batch)[0]


class Session(Protocol):
    """Part of an `onnxruntime.InferenceSession` that is used."""

    def get_inputs(self) -> Sequence[Node]:
        """Return the inputs of the model."""

    def get_outputs(self) -> Sequence[Node]:
        """Return the outputs of the model."""

    def run(
        self, names: Sequence[str], tensors: Mapping[str, NDArray[np.float32]]
    ) -> Sequence[NDArray[np.float32]]:
        """Return the outputs of some names."""


def load_model(path: Path, what: str = "policy") -> Session:
    """Load an ONNX model that is whole in its file.

    Args:
        path: The file.
        what: Kind of model, for messages.

    Raises:
        InputError: It cannot be loaded, or ONNX Runtime is not installed.
    """
    try:
        import onnxruntime
    except ImportError:
        raise InputError(
            f"{what} '{path}': expected onnxruntime to be installed (the extra 'policy')"
        ) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = 4  # what is wrong is raised
    data = read_model(path, what)
    with tempfile.TemporaryDirectory(prefix="wayproof-") as empty:  # of weights in other files
        options.add_session_config_entry(EXTERNAL_FOLDER, empty)
        try:
            session: Session = onnxruntime.InferenceSession(
                data, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            line = f"cannot be loaded: {_one_line(error)}"
            if "xternal data" in line:
                line = (
                    "has weights in other files, expected all in one: "
                    "onnx.save(onnx.load(FILE), OTHER)"
                )
            raise InputError(f"{what} '{path}': {line}") from None
    return session


EXTERNAL_FOLDER = "session.model_external_initializers_file_folder_path"
"""Key of ONNX Runtime for the folder of weights that are not in the model itself."""


def read_model(path: Path, what: str = "policy") -> bytes:
    """Return the bytes of a model's file.

    Args:
        path: The file.
        what: Kind of model, for messages.

    Raises:
        InputError: It is no file, too large, or cannot be read.
    """
    if not path.is_file():
        raise InputError(f"{what} '{path}': no such file, expected an ONNX model")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(
            f"{what} '{path}': {path.stat().st_size / 2**20:.0f} MiB, expected at most "
            f"{MAX_BYTES / 2**20:.0f} MiB"
        )
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{what} '{path}': {error.strerror}") from None


def _check_nodes(path: Path, inputs: Sequence[Node], outputs: Sequence[Node]) -> None:
    """Refuse inputs that are not observed, and outputs without an action."""
    if not inputs or any(node.name not in OBSERVATION for node in inputs):
        got = ", ".join(node.name for node in inputs) or "none"
        raise InputError(
            f"policy '{path}': got inputs {got}; expected some of {', '.join(OBSERVATION)}"
        )
    actions = [node for node in outputs if node.name == OUTPUT]
    if not actions:
        got = ", ".join(node.name for node in outputs)
        raise InputError(f"policy '{path}': got outputs {got}; expected one named '{OUTPUT}'")
    spaces = [*(OBSERVATION[node.name] for node in inputs), ACTION]
    for node, space in zip([*inputs, *actions], spaces, strict=True):
        check_node(f"policy '{path}'", node, (1, *space.shape))


def check_node(who: str, node: Node, *shapes: tuple[int | str, ...]) -> None:
    """Refuse an input or output that is no float32 of one of the shapes; names stand for any size.

    Args:
        who: Model, in messages.
        node: Its input or output.
        shapes: Sizes along each axis.

    Raises:
        InputError: It is another.
    """
    if node.type == FLOAT and any(_has_shape(node.shape, shape) for shape in shapes):
        return
    got, *expected = (f"({', '.join(map(str, shape))})" for shape in (node.shape, *shapes))
    raise InputError(
        f"{who}: '{node.name}' is a {node.type} of shape {got}; expected a {FLOAT} of shape "
        f"{' or '.join(expected)}"
    )


def _has_shape(got: Sequence[int | str | None], expected: Sequence[int | str]) -> bool:
    return len(got) == len(expected) and all(
        one == size
        for one, size in zip(got, expected, strict=True)
        if isinstance(one, int) and isinstance(size, int)
    )


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
