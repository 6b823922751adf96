"""Falsification: the search for a perturbation that makes an episode fail.

An evolution strategy minimises the robustness of the episode, its least true clearance. The
episodes are chosen to fail, so no rate of failure follows from them.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import LatinHypercube

from wayproof.harness.clearance import true_in_metres
from wayproof.harness.perturbations import PERTURBATIONS, AnyPerturbation
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.file import LEAST_SEVERITY, FalsifyOptions, StudyFile
from wayproof.harness.study.plan import Arm, Planned, perturbation_at
from wayproof.harness.study.search import Asked, Steps, Trial, halved

FIRST, OFFSPRING = 16, 6
"""Number of first episodes, spread over the whole space, and of offspring of one parent."""

STEPS = (0.03, 0.2, 0.3)
"""Least, first and greatest standard deviation of an offspring, as a share of the space."""

GROWTH = (0.5, 1.1)
"""Factor of the step when no offspring is better, and when one is."""

APART = 0.3
"""Distance below which two points count as one, as a share of the space in every parameter."""

RESOLUTION = 0.05
"""Accuracy of either end of the shortest window, s."""

NO_RATE = "these episodes were chosen to fail: no rate follows from them"

Floats = NDArray[np.float64]
Place = tuple[float, Floats]
"""Robustness, and its point of the space."""


@dataclass(frozen=True)
class Space:
    """Perturbations of one kind, each acting within one window.

    Attributes:
        name: `KIND` or `KIND:MODE`.
        latest: Latest beginning of a window, s.
        length: Length of a window, s.
        greatest: Greatest severity.
    """

    name: str
    latest: float
    length: float
    greatest: float = MAX_SEVERITY

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Bounds of each parameter: beginning, severity, and direction if the kind has one."""
        bounds = {"begin": (0.0, self.latest), "severity": (LEAST_SEVERITY, self.greatest)}
        if "direction" in PERTURBATIONS[self.name.partition(":")[0]].__struct_fields__:
            bounds["direction"] = (-180.0, 180.0)
        return bounds

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Least and greatest value of each parameter, (parameters,) each."""
        low, high = np.array(list(self.parameters.values())).T
        return low, high

    def inside(self, points: Floats) -> Floats:
        """Return points (n, parameters) reflected at the bounds, with directions wrapped.

        Clipping would put many points right on the bounds.
        """
        low, high = self.ends
        folded = (points - low) % (2.0 * (high - low))
        kept = low + np.minimum(folded, 2.0 * (high - low) - folded)
        for column, name in enumerate(self.parameters):
            if name == "direction":
                kept[:, column] = (points[:, column] + 180.0) % 360.0 - 180.0
        return np.asarray(kept)

    def apart(self, one: Floats, other: Floats) -> float:
        """Return the greatest distance in any parameter of two points, as a share of the space."""
        low, high = self.ends
        parts = np.abs(one - other) / (high - low)
        around = np.array([name == "direction" for name in self.parameters])
        return float(np.where(around, np.minimum(parts, 1.0 - parts), parts).max())

    def perturbation(self, point: Sequence[float]) -> AnyPerturbation:
        """Return the perturbation at a point, rounded to hundredths of each unit."""
        values = {
            name: min(max(round(float(value), 2), low), high)
            for (name, (low, high)), value in zip(self.parameters.items(), point, strict=True)
        }
        begin, severity = values.pop("begin"), values.pop("severity")
        return _changed(
            perturbation_at(self.name, severity),
            window=(begin, round(begin + self.length, 2)),
            **values,
        )


def _changed(perturbation: AnyPerturbation | None, **fields: Any) -> AnyPerturbation:
    """Return a perturbation with some fields changed and checked."""
    assert perturbation is not None
    replaced: AnyPerturbation = msgspec.structs.replace(perturbation, **fields)
    return replaced


class _Over(Exception):
    """Signal that a failure is found or the budget is spent."""


@dataclass
class Hunt:
    """Search for a failure of one episode so far.

    Attributes:
        planned: The unperturbed episode.
        name: `KIND` or `KIND:MODE` of the perturbation.
        options: Window, severities, budget and seed of the search.
        episodes: Number of episodes up to the first failure, with those run beside it.
        nearest: The episode of the least clearance.
        failing: The first failure.
        shortest: The failure with the shortest window.
        cuts: Number of episodes run to shorten the window.
        ended: Whether the search is finished.
        error: Reason why there is no result; empty with one.
    """

    planned: Planned
    name: str
    options: FalsifyOptions
    episodes: int = 0
    nearest: Trial | None = None
    failing: Trial | None = None
    shortest: Trial | None = None
    cuts: int = 0
    ended: bool = False
    error: str = ""

    def steps(self) -> Steps:
        """Run the unperturbed episode, search for a failure, and shorten its window."""
        [clean] = yield [None]
        if clean.failed:
            self.error = f"the unperturbed episode ends in '{clean.outcome}': nothing to search for"
            return
        options = self.options
        space = Space(self.name, clean.duration, options.window, options.greatest)
        yield from self.search(space)
        yield from self.shorten()
        self.ended = True

    def search(self, space: Space) -> Steps:
        """Search until an episode fails or the budget is spent, by a (1 + 6) evolution strategy.

        Rechenberg (1973), from points of a Latin hypercube. The step grows while an offspring is
        better than its parent, and shrinks otherwise. When it has become small, the search
        restarts, alternately at the best point of the hypercube that it has not been close to yet,
        and at the best point of all with half the step: the way to a failure may lead away from the
        point that was best at first. It found a box of 0.17 % of the space within 100 episodes for
        all of 60 seeds.
        """
        try:
            yield from self._evolve(space)
        except _Over:
            pass

    def _evolve(self, space: Space) -> Steps:
        rng = np.random.default_rng(self.options.seed)
        low, high = space.ends
        points = low + (high - low) * LatinHypercube(len(low), rng=rng).random(FIRST)
        values = yield from self._try(space, points)
        left = [(values[n], points[n]) for n in np.argsort(values, kind="stable")]
        best, ends = left[0], list[Floats]()
        while True:
            left = [one for one in left if all(space.apart(one[1], end) > APART for end in ends)]
            if not left:
                points = low + (high - low) * rng.random((OFFSPRING, len(low)))
                left = [_best(points, (yield from self._try(space, points)))]
            end = yield from self._climb(space, rng, start=left.pop(0), step=STEPS[1])
            ends.append(end[1])
            best = min(best, end, key=itemgetter(0))
            again = yield from self._climb(space, rng, start=best, step=0.5 * STEPS[1])
            best = min(best, again, key=itemgetter(0))

    def _climb(
        self, space: Space, rng: np.random.Generator, start: Place, step: float
    ) -> Generator[Asked, list[Trial], Place]:
        """Return the best point reached from a start until the step has become small."""
        low, high = space.ends
        place = start
        while step >= STEPS[0]:
            spread = step * (high - low) * rng.standard_normal((OFFSPRING, len(low)))
            offspring = space.inside(place[1] + spread)
            nearest = _best(offspring, (yield from self._try(space, offspring)))
            if nearest[0] < place[0]:
                place, step = nearest, min(GROWTH[1] * step, STEPS[2])
            else:
                step *= GROWTH[0]
        return place

    def _try(self, space: Space, points: Floats) -> Generator[Asked, list[Trial], Floats]:
        """Return the robustness (n,) at points (n, parameters); 0 is a collision.

        Raises:
            _Over: A failure is found or the budget is spent.
        """
        left = self.options.budget - self.episodes
        trials = yield [space.perturbation(point) for point in points[:left].tolist()]
        self.episodes += len(trials)
        failures = [number for number, one in enumerate(trials) if one.failed]
        counted = trials[: failures[0] + 1] if failures else trials
        known = [*([self.nearest] if self.nearest else []), *counted]
        self.nearest = min(known, key=lambda one: one.clearance)
        if failures:
            self.failing = self.shortest = trials[failures[0]]
        if failures or self.episodes >= self.options.budget:
            raise _Over
        return np.array([one.clearance for one in trials])

    def shorten(self) -> Steps:
        """Shorten the window of the failure by bisection: first its end, then its beginning.

        Assumes that a window within one that does not fail does not fail either.
        """
        for end in (1, 0) if self.shortest is not None else ():
            window = _window(self.shortest)
            fails, holds = window[end], window[1 - end]
            while (middle := halved(holds, fails, RESOLUTION)) is not None:
                middle = round(middle, 3)
                cut = (window[0], middle) if end else (middle, window[1])
                assert self.shortest is not None
                [tried] = yield [_changed(self.shortest.perturbation, window=cut)]
                self.cuts += 1
                if tried.failed:
                    self.shortest, fails = tried, middle
                else:
                    holds = middle


def _window(trial: Trial | None) -> tuple[float, float]:
    assert trial is not None
    assert trial.perturbation is not None
    assert trial.perturbation.window is not None
    return trial.perturbation.window


def _best(points: Floats, robustness: Floats) -> Place:
    least = int(np.argmin(robustness))
    return float(robustness[least]), points[least]


@dataclass(frozen=True)
class Falsification:
    """Result of the search for a failure of one episode; no rate follows from it.

    Attributes:
        arm: World, robot, variant and kind of perturbation.
        seed: Seed of the episode.
        episodes: Number of episodes up to the first failure, with those run beside it.
        failing: The first failure; None without one.
        nearest: The episode of the least clearance; None before the first.
        shortest: The failure with the shortest window.
        cuts: Number of episodes run to shorten the window.
        setting: Perturbation of that failure, as a value of `--set perturbation=`.
        error: Reason why there is no result; empty with one.
    """

    arm: Arm
    seed: int
    episodes: int
    failing: Trial | None
    nearest: Trial | None
    shortest: Trial | None
    cuts: int
    setting: str
    error: str

    @property
    def exit_code(self) -> int:
        """1 if a failure was found, 3 without a result, else 0."""
        return 3 if self.error else int(self.failing is not None)

    def in_words(self) -> str:
        """Return the failure and its shortest trigger, or the nearest miss, in words."""
        text = f"seed {self.seed}: "
        if self.error:
            return text + self.error
        if self.failing is None or self.shortest is None:
            assert self.nearest is not None
            least = true_in_metres(self.nearest.clearance)
            return (
                f"{text}no failure in {self.episodes} episodes; least clearance {least} with "
                f"{self.nearest.perturbation}; {NO_RATE}"
            )
        begin, end = _window(self.shortest)
        return (
            f"{text}{self.failing.outcome} after {self.episodes} episodes: {self.failing.reason}; "
            f"log {self.failing.log}; shortest trigger: {begin:g} to {end:g} s, found in "
            f"{self.cuts} more episodes; log {self.shortest.log}; --set "
            f"'perturbation={self.setting}'; {NO_RATE}"
        )


def hunts_of(study: StudyFile, planned: Sequence[Planned]) -> list[Hunt]:
    """Return the search of each episode for each perturbation, none of them begun."""
    return [Hunt(one, name, study.falsify) for one in planned for name in study.perturbations]


def falsification_of(hunt: Hunt) -> Falsification:
    """Return the result of a search."""
    setting = b"" if hunt.shortest is None else msgspec.json.encode(hunt.shortest.perturbation)
    return Falsification(
        arm=replace(hunt.planned.arm, perturbation=hunt.name),
        seed=hunt.planned.seed,
        episodes=hunt.episodes,
        failing=hunt.failing,
        nearest=hunt.nearest,
        shortest=hunt.shortest,
        cuts=hunt.cuts,
        setting=setting.decode(),
        error=hunt.error or ("" if hunt.ended else "the search has not ended"),
    )
