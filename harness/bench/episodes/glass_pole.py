"""Planted weakness for falsification: a short thin glass pole beside the path of a drone.

No beam hits it, so the stack cannot know of it. The drone passes well clear of it; only a jump of
the pose estimate of the right size and direction, at the right time, leads there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build, make_transparent
from wayproof.harness.study.falsify.search import Trial
from wayproof.harness.study.falsify.space import Space
from wayproof.models.worlds import Cylinder, World
from wayproof.models.worlds.layout import room_walls

LOW, HIGH = (0.0, 0.0, -0.5), (9.0, 6.0, 3.0)
GLASS = "glass"
POLE = Cylinder((4.5, 3.85, 0.9), (4.5, 3.85, 1.3), 0.015, GLASS)
"""The pole: 3 cm thick, at the height of flight only, 0.85 m beside the straight path."""

SETTINGS = (
    "episode.time_limit=8",
    "map.resolution=0.2",
    "motion.limits=cautious",
    "record=decisions",
)
SPACE = Space("pose_jump", latest=4.0, length=1.0, greatest=3.6)
"""Jumps of up to 0.6 m: after a longer one the stack detects that it is lost."""


def pole_room(perturbation: AnyPerturbation | None) -> Scenario:
    """Return the room with the pole, and a drone that has to cross it."""
    world = World(
        name="pole",
        seed=0,
        low=LOW,
        high=HIGH,
        solids=(*room_walls(LOW, HIGH), POLE),
        start=(1.5, 3.0, 0.0),
        start_heading=0.0,
        goal=(7.5, 3.0, 0.0),
    )
    config = override(Config(world.name, "drone", 0), SETTINGS)
    scenario = build(replace(config, perturbation=perturbation), world)
    return make_transparent(scenario, lambda name: name.startswith(GLASS))


def cross_pole_room(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
    """Cross the room with each perturbation, lazily; only a collision is a failure."""
    with tempfile.TemporaryDirectory() as folder:
        for one in perturbations:
            result = run_episode(pole_room(one), Path(folder) / "crossing.mcap")
            yield Trial(one, result.outcome == "collision", result.min_clearance_m)
