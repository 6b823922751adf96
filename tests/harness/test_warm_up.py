"""What an episode runs is compiled before it begins."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

EPISODE = """
import sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from wayproof.harness.config_document import from_document
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up

config = from_document({"world": "warehouse", "robot": sys.argv[1], "seed": 0})
warm_up(config)
compile = Dispatcher.compile

def noted(kernel, signature):
    print("late:", kernel.py_func.__name__)
    return compile(kernel, signature)

Dispatcher.compile = noted
print(run_episode(build(config), Path(sys.argv[2]) / "episode.mcap").outcome)
"""


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_no_kernel_is_compiled_or_loaded_during_an_episode(robot, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", EPISODE, robot, str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == ["success"]
