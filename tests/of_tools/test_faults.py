"""Planted faults: changes that break an episode, and broken stacks on trial."""

import os
import subprocess
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tools.faults import faulty_stacks, on_trial
from tests.tools.faults.__main__ import table
from tests.tools.faults.breaks import KINDS, Broken
from tests.tools.faults.failures import attempts
from tests.tools.faults.garbage_stack import framed, garbage
from tests.tools.faults.judged import Judged
from tests.tools.faults.on_trial import MARK, marked, run_planted
from wayproof.harness.attribution import CAUSES
from wayproof.harness.config import Config
from wayproof.harness.interface.connection import FileDescriptors
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.remote import RemoteStack
from wayproof.harness.interface.types import Observation, Reference
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import stack_pb2 as sb


def test_a_table_by_hand():
    right = Judged("tracking", ("tracking",), "tracking", 1, "collision", "late")
    wrong = right._replace(found="timeout", seed=2, troubles=("replay: exit code 1",))
    assert (right.right, wrong.right) == (True, False)
    assert not right._replace(troubles=("audit: nothing there",)).right
    assert wrong.line() == "* tracking 2: collision, timeout: late\n    replay: exit code 1"
    lines = table([right, right, wrong])
    assert [column.header for column in lines.columns] == ["planted", "tracking", "timeout"]
    assert [list(column.cells) for column in lines.columns] == [["tracking"], ["2"], ["1"]]


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


def test_every_kind_has_a_stack_and_causes():
    assert len(on_trial.KINDS) == 10
    for kind in on_trial.KINDS.values():
        assert set(kind.causes) <= set(CAUSES)
        assert not kind.stack or callable(getattr(faulty_stacks, kind.stack).step)


@pytest.mark.large
def test_one_fault_from_the_run_to_its_explanation(tmp_path):
    drawn = run_planted("starts_elsewhere", 2, tmp_path)
    assert (drawn.outcome, drawn.found, drawn.troubles) == ("error", "plugin_failed", ())
    assert drawn.right
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_outlives_its_episode_is_found():
    child = subprocess.Popen(["sleep", "60"], env={**os.environ, MARK: "left"})
    try:
        assert marked("left") == [child.pid]
        assert marked("other") == []
    finally:
        child.kill()
        child.wait()


STILL = np.zeros(3)
OBSERVATION = Observation(
    time_ns=4 * 10**8, sequence=4, position=STILL, quaternion=np.eye(4)[0], position_sigma=0.0,
    heading_sigma=0.0, velocity=STILL, yaw_rate=0.0, sweeps=(), effect_ns=45 * 10**7,
    reference=Reference(STILL, STILL, 0.0, 0.0, at_rest=True), goal=STILL,
)  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_garbage_is_no_answer(seed):
    """Whatever the seed, the harness refuses it."""
    read, theirs = os.pipe()
    sink = os.open(os.devnull, os.O_WRONLY)
    hello = sb.FromStack(hello=sb.Hello(version=1, name="garbage"))
    os.write(theirs, framed(hello.SerializeToString()) + garbage(seed, 4))
    stack = RemoteStack(FileDescriptors(read, sink), "stack 'garbage'", 5.0)
    stack._task = SimpleNamespace(sensors={})
    with pytest.raises(StackError):
        stack.query(OBSERVATION)
    os.close(theirs)
