"""Calls in forked processes, beside one in this process.

A forked process has all that this one has imported and read, so a call needs no start of its own.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import TypeVar

from wayproof.harness.errors import InputError

T = TypeVar("T")
U = TypeVar("U")


class ForkFailed(Exception):
    """A call in a forked process raised, or its process ended without a result."""


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def beside(calls: Sequence[Callable[[], T]], own: Callable[[], U]) -> tuple[U, list[T]]:
    """Make calls in a process each, and one in this process meanwhile; return all results.

    Args:
        calls: Their results can be pickled.
        own: The call in this process.

    Raises:
        InputError: What one of the calls refuses, else what `own` does.
        ForkFailed: One of the calls failed otherwise, with its error in words.
        Exception: Whatever else `own` raises.
    """
    context = multiprocessing.get_context("fork")
    started = []
    try:
        for call in calls:
            receiver, sender = context.Pipe(duplex=False)
            process = context.Process(target=_call, args=(call, sender), daemon=True)
            process.start()
            sender.close()
            started.append((process, receiver))
        try:
            value = own()
        except InputError:
            for _, receiver in started:
                _result(receiver)
            raise
        return value, [_result(receiver) for _, receiver in started]
    finally:
        for process, receiver in started:
            receiver.close()
            process.terminate()
            process.join()


def _call(call: Callable[[], T], sender: Connection) -> None:
    try:
        sender.send((call(), None))
    except InputError as error:
        sender.send((None, error))
    except Exception as error:
        sender.send((None, ForkFailed(f"{type(error).__name__}: {error}")))
    sender.close()


def _result(receiver: Connection) -> T:  # type: ignore[type-var]
    try:
        value, failure = receiver.recv()
    except EOFError:
        raise ForkFailed("its process ended without a result") from None
    if failure is not None:
        raise failure
    return value  # type: ignore[no-any-return]
