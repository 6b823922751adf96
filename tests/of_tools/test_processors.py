"""Logs replay to the same bits in processes that compute as other processors do."""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.tools.soak.kinds import FLAT, KINDS, MOUNTED
from tests.tools.soak.processors import (
    Emulated,
    Emulation,
    emulations,
    replay_all,
)
from tests.tools.soak.replays import arithmetic
from wayproof.maps import MAPS
from wayproof.models.robots import ROBOTS
from wayproof.planners import PLANNERS

ALL = {one.name: one for one in emulations(Path(os.devnull), compiled=False)}
OLD = ("C library without FMA and AVX", "numpy at its baseline", "OpenBLAS Prescott")


def together(*names):
    """One child that is several emulations at once: each must show in it."""
    parts = [ALL[name] for name in names]
    return Emulation(
        ", ".join(names),
        {name: value for part in parts for name, value in part.environment.items()},
        lambda child, own: all(part.shows(child, own) for part in parts),
        refused=" ".join(part.refused for part in parts).strip(),
    )


HERE = [
    together(*OLD),
    *(together(f"OpenBLAS {core}") for core in ("Haswell", "SkylakeX")),  # Zen has Haswell's
]

EPISODES = (
    (
        *("office", "quadruped", 5, "episode.time_limit=1", "planner.name=rrtconnect"),
        *("planner.state_space=reeds_shepp", "planner.iterations=100", "planner.restarts=1"),
    ),
)


@pytest.fixture(scope="module")
def logs(recorded):
    return [Path(recorded(*episode).log) for episode in EPISODES]


@pytest.mark.parametrize(
    "emulation",
    [
        pytest.param(one, id=one.name, marks=[] if number == 0 else pytest.mark.large)
        for number, one in enumerate(HERE)  # the oldest differs most
    ],
)
def test_logs_replay_to_the_same_bits(logs, emulation):
    if emulation.refused:
        pytest.skip(emulation.refused)
    result = Emulated()
    assert replay_all(emulation, logs, arithmetic(), result) == []
    assert (result.replays, result.identical) == (len(logs), len(logs))
    assert result.decisions >= 8


BENDS = """
import hashlib, types
import numpy as np
from wayproof.harness.stack.gaits import Flight
from wayproof.harness.stack.gaits import TurnThenGo
from wayproof.harness.stack.manoeuvres.stopping import _bends
from wayproof.planners import MotionLimits

limits = MotionLimits(2.0, 2.5, 12.0, 2.5, 1.5)
rng, digest = np.random.default_rng(3), hashlib.sha256()
for ground in [False, True] * 1000:
    towards = rng.integers(-1000, 1001, 3) * [1.0, 1.0, not ground]
    towards /= np.sqrt(np.square(towards).sum())
    speed, reach = rng.uniform(0.3, 2.0), rng.uniform(0.3, 1.5)
    position, acceleration = rng.uniform(0.0, 20.0, 3), rng.uniform(-2.5, 2.5)
    now = types.SimpleNamespace(speed=speed, acceleration=acceleration, position=position)
    view = types.SimpleNamespace(gait=(TurnThenGo if ground else Flight)(limits, ()))
    for bend in _bends(view, now, towards, reach):
        digest.update(bend.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.large
def test_stops_turn_away_on_the_same_bits():
    found = set()
    for emulation in (ALL["as it is"], together(*OLD)):
        environment = {**os.environ, **emulation.environment}
        command = [sys.executable, "-c", BENDS]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        found.add(ended.stdout)
    assert len(found) == 1


def test_what_does_not_take_effect_or_differs_is_a_failure(tmp_path):
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no log")
    without_effect = Emulation("nothing", {}, lambda child, own: child.library != own.library)
    result = Emulated()
    effect, differs = replay_all(without_effect, [broken], arithmetic(), result)
    assert effect.startswith("nothing: not in effect: Arithmetic(")
    assert str(broken) in differs
    assert (result.replays, result.identical) == (1, 0)


def test_kinds_take_everything_in_turn_with_both_robots():
    rng = np.random.default_rng(0)
    planned = [KINDS["planner"](turn, rng) for turn in range(2 * len(PLANNERS))]
    assert {(one.planner.name, one.robot) for one in planned} == set(product(PLANNERS, ROBOTS))
    mapped = [KINDS["map"](turn, rng) for turn in range(2 * len(MAPS))]
    everywhere = {*product(MAPS, ROBOTS)} - {*product(FLAT, {*ROBOTS} - {"quadruped"})}
    assert {(one.map.kind, one.robot) for one in mapped} == everywhere
    sensed = [KINDS["device"](turn, rng) for turn in range(2 * len(MOUNTED))]
    assert {(one.sensors.lidar, one.robot) for one in sensed} == set(product(MOUNTED, ROBOTS))
