"""Log-odds in whole units, and their decay."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.config import MapConfig
from wayproof.maps.elementary import LN_2, exponential_less_one, exponentials, logarithm
from wayproof.maps.kernels import decay as kernels
from wayproof.maps.kernels.update import LogOddsSteps
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

MAX_UNITS = 127
"""Greatest magnitude of log-odds that an int8 holds, units."""


@dataclass(frozen=True)
class LogOddsModel:
    """A configuration's steps and clamps in whole units of log-odds.

    Attributes:
        units: Units to one of log-odds.
        hit: Log-odds that a return adds.
        miss: Log-odds that a crossing takes.
        low: Lower clamp.
        high: Upper clamp.
    """

    units: int
    hit: int
    miss: int
    low: int
    high: int

    @classmethod
    def from_config(cls, config: MapConfig) -> LogOddsModel:
        """Choose the units that meet hit and miss best among those that still hold the clamps.

        Tried are the finer half of the possible ones; with equal errors the finest wins. The
        defaults come to 30 units, in which 0.9 and 0.4 are whole.
        """
        low, high = _log_odds(config.prob_min), _log_odds(config.prob_max)
        finest = math.floor(MAX_UNITS / max(-low, high))

        def error(units: int) -> float:
            return max(
                abs(max(round(units * step), 1) / units - step) / step
                for step in (config.log_odds_hit, config.log_odds_miss)
            )

        units = min(range(finest, finest // 2, -1), key=error)
        span = round(units * high) - round(units * low)
        hit, miss = (
            min(max(round(units * step), 1), span)
            for step in (config.log_odds_hit, config.log_odds_miss)
        )
        return cls(units, hit, miss, round(units * low), round(units * high))

    @property
    def steps(self) -> LogOddsSteps:
        """Steps and clamps as the kernels take them."""
        return LogOddsSteps(self.hit, self.miss, self.low, self.high)

    def probability(self, units: NDArray[np.int8] | int) -> NDArray[np.float64]:
        """Return the probability of occupancy of log-odds in units, -128 to 127."""
        table = _probabilities(self.units)
        return np.asarray(table[np.asarray(units, np.int64) + MAX_UNITS + 1])


@functools.cache
def _probabilities(units: int) -> NDArray[np.float64]:
    """Return the probabilities (256,) of log-odds from -128 to 127, `units` of them to one."""
    odds = exponentials(np.arange(-MAX_UNITS - 1, MAX_UNITS + 1) / units)
    probabilities: NDArray[np.float64] = odds / (1.0 + odds)
    probabilities.flags.writeable = False  # shared by all maps
    return probabilities


def states_of(log_odds: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Return states of cells by the sign of their log-odds, of the same shape."""
    states = np.where(log_odds < 0, FREE, np.where(log_odds > 0, OCCUPIED, UNKNOWN))
    return states.astype(np.uint8)


def decay_per_tick(config: MapConfig) -> NDArray[np.uint64]:
    """Return the loss of each magnitude (128,) at a decay tick, in 2^-40 units.

    That is v (1 - 2^(-period / half-life)); nothing if the half-life is 0.
    """
    share = 0.0
    if config.half_life > 0.0:
        share = -exponential_less_one(-LN_2[0] * config.decay_period / config.half_life)
    unit = float(1 << kernels.LOSS_BITS)
    return np.array([round(v * share * unit) for v in range(MAX_UNITS + 1)], np.uint64)


def _log_odds(probability: float) -> float:
    return logarithm(probability / (1.0 - probability))
