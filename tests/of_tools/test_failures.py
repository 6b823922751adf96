"""Failures caused by one broken assumption."""

from dataclasses import fields

import numpy as np

from tests.tools.faults.breaks import KINDS, Broken
from tests.tools.faults.failures import attempts
from wayproof.harness.attribution import CAUSES
from wayproof.harness.config import Config
from wayproof.harness.scenario.scenario import build


def test_attempts_take_both_halves_in_turn():
    for kind in KINDS:
        tried = list(attempts(kind))
        assert [seed % 2 for _, _, seed in tried] == [0, 1] * (len(tried) // 2)
        assert len(set(tried)) == len(tried)


TOGETHER = {
    "retentive": ["settings", "world"],
    "dropout": ["settings", "perturbation"],
    "noise": ["settings", "perturbation"],
    "calibration": ["settings", "perturbation"],
}
"""Fields of kinds whose one broken assumption takes two."""


def test_every_kind_breaks_one_thing():
    sound = build(Config("corridor", "drone", 3))
    rng = np.random.default_rng(0)
    for name, kind in KINDS.items():
        assert kind.cause in CAUSES
        broken = kind.breaks(sound, rng)
        whole = Broken()
        differing = [
            one.name
            for one in fields(Broken)
            if getattr(broken, one.name) != getattr(whole, one.name)
        ]
        assert len(differing) == 1 or differing == TOGETHER[name]
    closed = KINDS["closed"].breaks(sound, rng).scenario(sound)
    assert len(closed.world.solids) == len(sound.world.solids) + 1
