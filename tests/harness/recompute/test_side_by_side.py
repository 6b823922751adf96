"""Failures while a log is recomputed: bad input, or a fault of Wayproof."""

import subprocess
import sys

import pytest

from tests.tools.small_log import COMMITTED
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.recompute.side_by_side import as_input_error
from wayproof.harness.stack.pipeline import Navigator
from wayproof.plugin import UserCodeError

SMALL_LOG = str(COMMITTED)


def raising(error):
    def make():
        raise error

    return make


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (UserCodeError("planner 'a.py:B'", "raised ValueError"), r"planner 'a\.py:B' raised Value"),
        (MemoryError(), "out of memory, expected smaller maps"),
    ],
)
def test_what_is_no_fault_of_the_stack_is_bad_input(error, said):
    with pytest.raises(InputError, match=f"decision 4: {said}"):
        as_input_error("decision 4", raising(error))


def test_an_input_error_stays_as_it_is():
    error = InputError("sweep of 3 beams, expected 4")
    with pytest.raises(InputError) as caught:
        as_input_error("decision 4", raising(error))
    assert caught.value is error
    assert not hasattr(error, "__notes__")


@pytest.mark.parametrize("kind", [KeyError, ValueError])
def test_a_fault_of_the_stack_is_no_bad_input(monkeypatch, kind):
    step = Navigator.step

    def fails_at_the_third(navigator, inputs, **settings):
        if inputs.sequence == 2:
            raise kind("planted")
        return step(navigator, inputs, **settings)

    monkeypatch.setattr(Navigator, "step", fails_at_the_third)
    with pytest.raises(kind, match="planted") as caught:
        main(["replay", SMALL_LOG])
    assert caught.value.__notes__ == ["raised by Wayproof's own code at decision 2"]


def test_a_fault_of_the_stack_ends_the_command_with_a_traceback_and_code_1():
    code = (
        "import sys\n"
        "from wayproof.harness.cli.main import main\n"
        "from wayproof.harness.stack.pipeline import Navigator\n"
        "def step(*_, **__): raise TypeError('planted')\n"
        "Navigator.step = step\n"
        f"sys.exit(main(['replay', {SMALL_LOG!r}]))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 1
    assert ended.stderr.startswith("Traceback")
    assert "TypeError: planted\nraised by Wayproof's own code at decision 0" in ended.stderr
