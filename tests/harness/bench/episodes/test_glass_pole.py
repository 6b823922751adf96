from __future__ import annotations

from wayproof.harness.bench.episodes.glass_pole import SPACE, cross_pole_room


def test_the_pole_is_hit_by_the_jump_that_leads_there_alone() -> None:
    """Off to its side when it passes; off to the other side, or later, it is safe."""
    there, other, late = (
        SPACE.perturbation(point)
        for point in [(1.5, 3.5, -90.0), (1.5, 3.5, 90.0), (3.5, 3.5, -90.0)]
    )
    hit, *safe = cross_pole_room([there, other, late])
    assert hit.failed
    assert [one.failed for one in safe] == [False, False]
