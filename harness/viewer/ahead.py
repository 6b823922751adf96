"""Prefetching of items in a thread."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Ahead(Generic[Item]):
    """Iterator that prefetches items in order.

    An exception is raised in the place of the item that raised it.
    """

    def __init__(self, items: Iterator[Item], most: int) -> None:
        """Start the thread; prefetch at most `most` items."""
        self._items = items
        self._room = threading.Semaphore(most)
        self._made: SimpleQueue[tuple[Item] | BaseException | None] = SimpleQueue()
        self._stopped = False
        self._thread = threading.Thread(target=self._make, name="ahead", daemon=True)
        self._thread.start()

    def __iter__(self) -> Iterator[Item]:
        """Yield all items, once."""
        while isinstance(made := self._made.get(), tuple):
            self._room.release()
            yield made[0]
        if made is not None:
            raise made

    def close(self) -> None:
        """Stop, and wait for the thread to finish its current item."""
        self._stopped = True
        self._room.release()
        self._thread.join()

    def _make(self) -> None:
        try:
            while self._room.acquire() and not self._stopped:
                self._made.put((next(self._items),))
        except StopIteration:
            self._made.put(None)
        except BaseException as error:  # raised again in the place of the item
            self._made.put(error)
        finally:
            del self._items  # releases the resources of a generator
