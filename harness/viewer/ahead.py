"""Items that are made in a thread before they are asked for."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Ahead(Generic[Item]):
    """The same items in the same order, the next ones made meanwhile; the first from now on.

    What making one raises is raised in its place.
    """

    def __init__(self, items: Iterator[Item], most: int) -> None:
        """Begin, and never be more than so many ahead."""
        self._items = items
        self._room = threading.Semaphore(most)
        self._made: SimpleQueue[tuple[Item] | BaseException | None] = SimpleQueue()
        self._stopped = False
        self._thread = threading.Thread(target=self._make, name="ahead", daemon=True)
        self._thread.start()

    def __iter__(self) -> Iterator[Item]:
        """All of them, once."""
        while isinstance(made := self._made.get(), tuple):
            self._room.release()
            yield made[0]
        if made is not None:
            raise made

    def close(self) -> None:
        """Make no more, and wait until the thread is done with what it is at."""
        self._stopped = True
        self._room.release()
        self._thread.join()

    def _make(self) -> None:
        try:
            while self._room.acquire() and not self._stopped:
                self._made.put((next(self._items),))
        except StopIteration:
            self._made.put(None)
        except BaseException as error:  # raised again where the item is asked for
            self._made.put(error)
        finally:
            del self._items  # a generator lets go of what it holds
