"""Snapshots of an episode's parts at each decision, and their restoration.

Every part with state between physics steps is `Stateful` and listed in the recorder's `parts` under
its name: a new one is one line there.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb

Arrays = dict[str, NDArray[Any]]

DTYPES = ("<f8", "<f4", "<i8", "<i4", "|i1", "|u1", "|b1")
"""Element types that a log may name; any other text never reaches numpy."""

LOGGED = {np.dtype(name): name for name in DTYPES}
"""Names of these types; `dtype.str` takes longer than packing the array."""

MAX_ELEMENTS = 1 << 24
"""Maximum number of elements of one logged array."""


class Stateful(Protocol):
    """A part of an episode with state between physics steps."""

    def state(self) -> Arrays:
        """Copy the state into arrays, by name."""
        ...

    def restore(self, state: Arrays) -> None:
        """Continue from what `state` returned, bit by bit."""
        ...


class PhysicsState:
    """MuJoCo's state just before the physics step that leads up to a decision.

    What the controllers read of `MjData` (contact forces, bias forces, the mass matrix) belongs to
    the step before, and is no part of `mjSTATE_INTEGRATION`. So the state is taken one step early,
    with the controls in it, and restoring repeats that step: all of `MjData` is then as it was.
    """

    KIND = mujoco.mjtState.mjSTATE_INTEGRATION

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Save the state of the model and data that the episode steps."""
        self._model = model
        self._data = data
        self._before = np.zeros(mujoco.mj_stateSize(model, self.KIND))

    def save(self) -> None:
        """Save the state; called right before `mj_step`."""
        mujoco.mj_getState(self._model, self._data, self._before, self.KIND)

    def state(self) -> Arrays:
        """Return the state last saved."""
        return {"integration": self._before.copy()}

    def restore(self, state: Arrays) -> None:
        """Set the saved state and repeat its step.

        Raises:
            ValueError: It belongs to another model.
        """
        values = state["integration"]
        if values.shape != self._before.shape or values.dtype != np.float64:
            raise ValueError(f"got {values.shape} numbers, expected {self._before.shape}")
        if not np.isfinite(values).all():
            raise ValueError("got numbers that are not finite")
        mujoco.mj_setState(self._model, self._data, values, self.KIND)
        mujoco.mj_step(self._model, self._data)
        self._before[:] = values


class StepPoses:
    """The base's poses before each physics step of one decision period, for rolling shutters.

    Attributes:
        poses: (7,) each, oldest first.
    """

    def __init__(self, steps: int) -> None:
        """Keep the latest `steps` poses."""
        self.poses: deque[NDArray[np.float64]] = deque(maxlen=steps)

    def append(self, pose: NDArray[np.float64]) -> None:
        """Append a pose (7,) and drop the oldest."""
        self.poses.append(pose)

    def state(self) -> Arrays:
        """Return the poses (n, 7), oldest first."""
        return {"poses": np.array(self.poses).reshape(-1, 7)}

    def restore(self, state: Arrays) -> None:
        """Restore the poses; none in a log whose sensors have no rolling shutter.

        Raises:
            ValueError: The array has another shape.
        """
        self.poses.clear()
        if "poses" not in state:
            return
        if state["poses"].shape[1:] != (7,):
            raise ValueError(f"got shape {state['poses'].shape}, expected (n, 7)")
        self.poses.extend(state["poses"])


def state_message(parts: Mapping[str, Stateful], sequence: int) -> pb.State:
    """Encode the state of every part for the log; the caller sets the time."""
    message = pb.State(sequence=sequence)
    for part, stateful in parts.items():
        for name, array in stateful.state().items():
            _append_array(message, f"{part}/{name}", array)
    return message


def restore_parts(parts: Mapping[str, Stateful], message: pb.State) -> None:
    """Restore every part from a logged state.

    Raises:
        InputError: The state of a part is missing or does not fit.
    """
    arrays = _unpack(message.arrays)
    for part, stateful in parts.items():
        prefix = f"{part}/"
        own = {n.removeprefix(prefix): a for n, a in arrays.items() if n.startswith(prefix)}
        try:
            stateful.restore(own)
        except KeyError as error:
            raise InputError(
                f"state at decision {message.sequence}: no {prefix}{error.args[0]}, "
                "expected a log of this version with the same robot"
            ) from None
        except (ValueError, TypeError, IndexError) as error:
            raise InputError(f"state at decision {message.sequence}: {part}: {error}") from None


def _append_array(message: pb.State, name: str, array: NDArray[Any]) -> None:
    dtype = LOGGED.get(array.dtype)
    if dtype is None:
        dtype = array.dtype.newbyteorder("<").str
        array = array.astype(dtype)
    message.arrays.add(name=name, dtype=dtype, shape=array.shape, data=array.tobytes())


def _unpack(messages: Iterable[pb.Array]) -> Arrays:
    arrays = {}
    for message in messages:
        if message.dtype not in DTYPES:
            raise InputError(
                f"state: {message.name!r} of type {message.dtype!r}, expected one of "
                f"{', '.join(DTYPES)}"
            )
        count, shape = math.prod(message.shape), tuple(message.shape)
        size = np.dtype(message.dtype).itemsize
        if count > MAX_ELEMENTS or len(shape) > 8 or count * size != len(message.data):
            raise InputError(
                f"state: {message.name!r} of shape {shape} in {len(message.data)} bytes"
            )
        arrays[message.name] = np.frombuffer(message.data, message.dtype).reshape(shape).copy()
    return arrays
