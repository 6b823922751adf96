"""Support of a figure of an episode: the values it can take, which decide on its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["rate", "share", "count", "measure"]


@dataclass(frozen=True)
class Support:
    """The values that a figure can take.

    Attributes:
        kind: `rate`: 0 or 1; `share`: bounded; `count`: whole, without an upper end; `measure`: any
            other number.
        low: Least value; -inf without one.
        high: Greatest value; inf without one.
        timed: A time within an episode, so that the time limit is its greatest value.
    """

    kind: Kind
    low: float = 0.0
    high: float = math.inf
    timed: bool = False

    def within(self, time_limit: float) -> Support:
        """Return the support in episodes of a time limit, s."""
        return replace(self, high=time_limit) if self.timed else self

    @property
    def difference(self) -> Support:
        """Support of the difference of two such figures."""
        return replace(self, low=self.low - self.high, high=self.high - self.low)


RATE = Support("rate", 0.0, 1.0)
SHARE = Support("share", 0.0, 1.0)
COUNT = Support("count")
MEASURE = Support("measure")
TIME = Support("measure", timed=True)
