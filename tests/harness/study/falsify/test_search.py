from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.study.falsify.search import Trial, search, shorten
from wayproof.harness.study.falsify.space import Space

JUMPS = Space("pose_jump", latest=4.0, length=1.0)


def weak(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
    """A stack that fails in one corner of (when, how strongly, where), 0.17 % of the space.

    Its robustness is the distance from that corner, in parts of the space.
    """
    for one in perturbations:
        assert one.window is not None
        direction = getattr(one, "direction", 0.0)
        gap = np.abs([one.window[0] - 1.7, one.severity - 4.0, direction - 120.0]) / [4.0, 5.0, 360]
        yield Trial(one, bool((gap < 0.06).all()), float(np.linalg.norm(gap)))


def test_a_planted_weakness_is_found_where_chance_needs_more() -> None:
    evolved = [search(JUMPS, weak, 100, seed) for seed in range(10)]
    drawn = [search(JUMPS, weak, 2000, seed, "random") for seed in range(10)]
    assert all(one.failing is not None for one in evolved)
    assert max(one.episodes for one in evolved) <= 100
    assert sum(one.episodes > 100 for one in drawn) >= 9
    found = zip(evolved, drawn, strict=True)
    assert sum(ours.episodes < random.episodes for ours, random in found) >= 9


def test_a_budget_is_kept_and_the_nearest_returned() -> None:
    ran: list[Trial] = []

    def noted(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
        for one in perturbations:
            ran.append(Trial(one, False, one.severity))
            yield ran[-1]

    result = search(JUMPS, noted, 30, 1)
    assert (result.episodes, len(ran), result.failing) == (30, 30, None)
    assert result.nearest.robustness == min(one.perturbation.severity for one in ran)
    assert search(JUMPS, noted, 30, 1).nearest == result.nearest
    with pytest.raises(InputError, match="unknown method 'luck'"):
        search(JUMPS, noted, 30, 1, "luck")


def test_a_trigger_is_cut_down_to_its_window() -> None:
    """The stack fails if it is off at 1.80 s: of a window of 1.7 to 2.7 s a tenth is left."""

    def off_at(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
        for one in perturbations:
            assert one.window is not None
            yield Trial(one, one.window[0] <= 1.8 < one.window[1], 0.0)

    [whole] = off_at([JUMPS.perturbation([1.7, 4.0, 0.0])])
    assert whole.failed
    shortest, episodes = shorten(whole, off_at)
    assert shortest.failed
    assert shortest.perturbation.window is not None
    begin, end = shortest.perturbation.window
    assert begin <= 1.8 < end <= begin + 0.1
    assert episodes <= 10
