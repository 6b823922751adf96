"""Search for a perturbation that makes an episode fail, within a budget of episodes.

An evolution strategy minimises the robustness of the episode, its least true clearance. The
episodes are chosen to fail, so no rate of failure follows from them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import LatinHypercube

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.study.falsify.space import Space, changed

FIRST, OFFSPRING = 16, 6
"""Number of first episodes, spread over the whole space, and of offspring of one parent."""

STEPS = (0.03, 0.2, 0.3)
"""Least, first and greatest standard deviation of an offspring, as a share of the space."""

GROWTH = (0.5, 1.1)
"""Factor of the step when no offspring is better, and when one is."""

APART = 0.3
"""Distance below which two points count as one, as a share of the space in every parameter."""

Floats = NDArray[np.float64]
Place = tuple[float, Floats]
"""Robustness, and its point of the space."""

NO_RATE = (
    "these episodes were chosen to fail: no rate follows from them; for a rate, run a study, whose "
    "seeds are chosen before anything is known of them"
)


@dataclass(frozen=True)
class Trial:
    """One episode of a search.

    Attributes:
        perturbation: Perturbation of the episode.
        failed: Whether it did not reach the goal.
        robustness: Least true clearance, m; the smaller, the closer to a failure.
    """

    perturbation: AnyPerturbation
    failed: bool
    robustness: float


Evaluate = Callable[[Sequence[AnyPerturbation]], Iterable[Trial]]
"""Function that runs an episode for each perturbation, lazily and in their order."""


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes:
        method: Key of `METHODS`.
        episodes: Number of episodes run.
        failing: The first episode that failed; None without one.
        nearest: The episode of the least robustness.
    """

    method: str
    episodes: int
    failing: Trial | None
    nearest: Trial


class _Over(Exception):
    """Signal that a failure is found or the budget is spent."""


class _Ledger:
    """Record of the episodes run, which ends the search."""

    def __init__(self, space: Space, evaluate: Evaluate, budget: int) -> None:
        self._space = space
        self._evaluate = evaluate
        self._budget = budget
        self.tried: list[Trial] = []

    def __call__(self, points: Floats) -> Floats:
        """Return the robustness (n,) at points (n, parameters); 0 is a collision.

        Raises:
            _Over: A failure is found or the budget is spent.
        """
        left = self._budget - len(self.tried)
        perturbations = [self._space.perturbation(point) for point in points[:left].tolist()]
        new: list[Trial] = []
        for one in self._evaluate(perturbations):
            new.append(one)
            self.tried.append(one)
            if one.failed:
                raise _Over
        if len(self.tried) >= self._budget:
            raise _Over
        return np.array([one.robustness for one in new])


def _evolve(space: Space, ledger: _Ledger, seed: int) -> None:
    """Search by a (1 + 6) evolution strategy (Rechenberg 1973) from points of a Latin hypercube.

    The step grows while an offspring is better than its parent, and shrinks otherwise. When it has
    become small, the search restarts, alternately at the best point of the hypercube that it has
    not been close to yet, and at the best point of all with half the step: the way to a failure may
    lead away from the point that was best at first. It found a box of 0.17 % of the space within
    100 episodes for all of 60 seeds.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array(list(space.parameters.values())).T
    points = low + (high - low) * LatinHypercube(len(low), rng=rng).random(FIRST)
    values = ledger(points)
    left = [(values[n], points[n]) for n in np.argsort(values, kind="stable")]
    best, ends = left[0], list[Floats]()
    while True:
        left = [one for one in left if all(space.apart(one[1], end) > APART for end in ends)]
        if not left:
            points = low + (high - low) * rng.random((OFFSPRING, len(low)))
            left = [_best(points, ledger(points))]
        end = _climb(space, ledger, rng, start=left.pop(0), step=STEPS[1])
        ends.append(end[1])
        best = min(best, end, key=itemgetter(0))
        best = min(
            best, _climb(space, ledger, rng, start=best, step=0.5 * STEPS[1]), key=itemgetter(0)
        )


def _climb(
    space: Space, ledger: _Ledger, rng: np.random.Generator, start: Place, step: float
) -> Place:
    """Return the best point reached from a start until the step has become small."""
    low, high = np.array(list(space.parameters.values())).T
    place = start
    while step >= STEPS[0]:
        spread = step * (high - low) * rng.standard_normal((OFFSPRING, len(low)))
        offspring = space.inside(place[1] + spread)
        nearest = _best(offspring, ledger(offspring))
        if nearest[0] < place[0]:
            place, step = nearest, min(GROWTH[1] * step, STEPS[2])
        else:
            step *= GROWTH[0]
    return place


def _best(points: Floats, robustness: Floats) -> Place:
    least = int(np.argmin(robustness))
    return float(robustness[least]), points[least]


def _draw(space: Space, ledger: _Ledger, seed: int) -> None:
    """Search at uniformly drawn points, for comparison."""
    rng = np.random.default_rng(seed)
    low, high = np.array(list(space.parameters.values())).T
    while True:
        ledger(rng.uniform(low, high, (OFFSPRING, len(low))))


METHODS: dict[str, Callable[[Space, _Ledger, int], None]] = {"evolution": _evolve, "random": _draw}
"""Name -> method that chooses the next episodes."""


def search(
    space: Space, evaluate: Evaluate, budget: int, seed: int, method: str = "evolution"
) -> SearchResult:
    """Search until an episode fails or the budget is spent.

    Args:
        space: Space of the perturbations.
        evaluate: Function that runs the episodes.
        budget: Maximum number of episodes.
        seed: Seed of the search.
        method: Key of `METHODS`.

    Raises:
        InputError: The method is unknown, or the budget is 0.
    """
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    if budget < 1:
        raise InputError(f"--budget {budget}: expected at least 1")
    ledger = _Ledger(space, evaluate, budget)
    try:
        METHODS[method](space, ledger, seed)
    except _Over:
        pass
    failing = next((one for one in ledger.tried if one.failed), None)
    nearest = min(ledger.tried, key=lambda one: one.robustness)
    return SearchResult(method, len(ledger.tried), failing, nearest)


def shorten(failing: Trial, evaluate: Evaluate, resolution: float = 0.05) -> tuple[Trial, int]:
    """Shorten the window of a failure by bisection: first its end, then its beginning.

    Assumes that a window within one that does not fail does not fail either.

    Args:
        failing: Failure with a window.
        evaluate: Function that runs the episodes.
        resolution: Accuracy of either end, s.

    Returns:
        The failure with the shortest window, and the number of episodes run.
    """
    shortest, episodes = failing, 0
    for end in (1, 0):
        window = shortest.perturbation.window
        assert window is not None
        fails, holds = window[end], window[1 - end]
        while abs(fails - holds) > resolution:
            middle = round((fails + holds) / 2.0, 3)
            cut = (window[0], middle) if end else (middle, window[1])
            [tried] = evaluate([changed(shortest.perturbation, window=cut)])
            episodes += 1
            if tried.failed:
                shortest, fails = tried, middle
            else:
                holds = middle
    return shortest, episodes
