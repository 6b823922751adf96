from __future__ import annotations

from wayproof.harness.study.falsify.space import Space

JUMPS = Space("pose_jump", latest=4.0, length=1.0)


def test_points_are_perturbations_within_the_bounds() -> None:
    one = JUMPS.perturbation([4.0004, 5.004, -180.004])
    assert (one.window, one.severity, one.direction) == ((4.0, 5.0), 5, -180.0)  # type: ignore[union-attr]
    assert list(Space("rate", 4.0, 1.0).parameters) == ["begin", "severity"]
