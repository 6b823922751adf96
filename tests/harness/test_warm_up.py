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
from wayproof.harness.config_document import from_document, override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up

robot, world, path, *settings = sys.argv[1:]
config = override(from_document({"world": world, "robot": robot, "seed": 0}), settings)
warm_up(config)
compile = Dispatcher.compile

def noted(kernel, signature):
    print("late:", kernel.py_func.__name__)
    return compile(kernel, signature)

Dispatcher.compile = noted
print(run_episode(build(config), Path(path) / "episode.mcap").outcome)
"""


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robot", "world", "setting"),
    [
        ("drone", "hall", "map.kind=voxel"),  # a window that rolls, and ways beyond it
        ("quadruped", "office", "estimate.kind=lidar"),
        ("quadruped", "crossing", "map.kind=dynamic"),
    ],
)
def test_no_kernel_is_compiled_or_loaded_during_an_episode(robot, world, setting, tmp_path):
    settings = [setting, "episode.time_limit=3"]
    done = subprocess.run(
        [sys.executable, "-c", EPISODE, robot, world, str(tmp_path), *settings],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == ["timeout"]
