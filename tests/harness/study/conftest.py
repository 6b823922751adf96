"""The verb `study` without worker processes, as each would load everything first."""

from contextlib import nullcontext

import pytest

from tests.harness.study.here import run_here


@pytest.fixture(scope="module")
def in_this_process():
    """Let the verb run its episodes in this process; test_looks.py and others test its own."""
    with pytest.MonkeyPatch.context() as patch:
        engine = "wayproof.harness.cli.study.open_engine"
        patch.setattr(engine, lambda *options: nullcontext(run_here))
        yield
