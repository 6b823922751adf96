"""Reference stacks: readable examples of the stack interface, and baselines to be compared with."""

from __future__ import annotations

from collections.abc import Callable

from wayproof.harness.interface.stacks.blind import Blind
from wayproof.harness.interface.stacks.dwa import Dwa
from wayproof.harness.interface.stacks.gap import Gap
from wayproof.harness.interface.stacks.imitation import Imitation
from wayproof.harness.interface.types import Stack

STACKS: dict[str, Callable[[], Stack]] = {
    "blind": Blind,
    "gap": Gap,
    "dwa": Dwa,
    "imitation": Imitation,
}
"""Reference stacks by name; `builtin` is the stack of `harness/stack`."""
