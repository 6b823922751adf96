import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.tools.small_log import COMMITTED
from tests.tools.soak.cases import MOST_MEMORY_MIB
from tests.tools.soak.fuzz import KINDS, run_case
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log


def test_mutated_input_in_a_watched_process():
    # A process of its own: the bound on memory is that of a process which does nothing besides,
    # and what a fork of this one holds depends on the tests before it.
    module = "tests.tools.soak"
    command = [sys.executable, "-m", module, "fuzz", "--count", "24", "--seed", "3"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    found = json.loads(ended.stdout.splitlines()[-1])
    assert (ended.returncode, found["failures"]) == (0, [])
    assert sum(found["refused"].values()) + sum(found["read"].values()) == 24
    assert 0 < found["peak_mib"] <= MOST_MEMORY_MIB


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "source.mcap"
    path.write_bytes(COMMITTED.read_bytes())
    return path


@given(st.sampled_from(KINDS), st.integers(0, 2**32))
@example("forged", 2_195_821_628)  # a true place at 1e214 m, whose square is no number
@example("forged", 2198)  # cosine and sine of a beam that are as large
@example("forged", 3792)  # an estimated orientation
@example("forged", 989)  # a true one
@example("forged", 501_296)  # a delay of no number of steps
@example("forged", 503_856)  # a truth without a place
@example("forged", 504_432)  # a body of the scene beyond all numbers
@example("forged", 504_740)  # a true orientation of five numbers
@example("forged", 16568)  # a scene with masses that MuJoCo warns of
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_mutated_input_is_refused_in_a_line_or_read(copy, kind, seed):
    said = ""
    try:
        run_case(kind, copy, open_log(copy), np.random.default_rng(seed))
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert [one.name for one in copy.parent.iterdir()] == ["source.mcap"]
