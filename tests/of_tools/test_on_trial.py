"""Planted faults of stacks on trial."""

import os
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tools.faults import faulty_stacks
from tests.tools.faults.garbage_stack import framed, garbage
from tests.tools.soak.on_trial import (
    KINDS,
    MARK,
    marked,
    run_planted,
)
from wayproof.harness.attribution import CAUSES
from wayproof.harness.interface.connection import FileDescriptors
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.remote import RemoteStack
from wayproof.harness.interface.types import Observation, Reference
from wayproof.harness.schema import stack_pb2 as sb


def test_every_kind_has_a_stack_and_causes():
    assert len(KINDS) == 10
    for kind in KINDS.values():
        assert set(kind.causes) <= set(CAUSES)
        assert not kind.stack or callable(getattr(faulty_stacks, kind.stack).step)


def test_one_fault_from_the_run_to_its_explanation(tmp_path):
    drawn = run_planted("starts_elsewhere", 2, tmp_path)
    assert (drawn.outcome, drawn.cause, drawn.failures) == ("error", "plugin_failed", ())
    assert drawn.right
    assert list(tmp_path.iterdir()) == []
    assert not replace(drawn, cause="tracking").right


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
