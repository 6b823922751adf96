"""Tests against rclpy, which `make test-ros2` installs in an environment of its own."""

import contextlib
import os
import subprocess
from pathlib import Path

import pytest

from wayproof import Config, build, override, run_episode

PYTHON = os.environ.get("ROS2_PYTHON", "")
"""Python with rclpy; without it nothing here is collected."""

DOMAIN = 1 + os.getpid() % 90
HERE, EXAMPLES = Path(__file__).parent, Path(__file__).parents[2] / "examples/ros2"

if not PYTHON:
    collect_ignore_glob = ["test_*.py"]


@contextlib.contextmanager
def started(*words):
    """A process of the environment with rclpy, which ends with the block."""
    child = subprocess.Popen(
        [os.path.abspath(PYTHON), *map(str, words)],
        env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)},
    )
    try:
        yield child
    finally:
        child.kill()
        child.wait()


@pytest.fixture
def trial(tmp_path):
    """Run an episode against the nodes that have been started."""

    def run(options, *settings, world="empty", seed=1, name="a"):
        stack = f"stack.name=ros2:domain={DOMAIN},{options}"
        config = override(Config(world, "quadruped", seed), ["plugins.wall_s=60", *settings, stack])
        return run_episode(build(config), tmp_path / f"{name}.mcap")

    return run
