"""Pictures drawn by whichever driver this machine has."""

import functools
import os
import subprocess
import sys

import pytest


def drawn(arguments):
    """Draw in a process of its own, which chooses the driver; skip where nothing can be drawn."""
    command = [sys.executable, "-m", "wayproof", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True)
    if "no picture here" in ended.stderr and not driver_found():
        pytest.skip(ended.stderr)
    return ended.returncode, ended.stderr


@functools.cache
def driver_found():
    """Whether MuJoCo finds a driver that draws without a screen."""
    code = "import mujoco; mujoco.GLContext(8, 8).free()"
    without = {**os.environ, "MUJOCO_GL": "egl"}
    return (
        subprocess.run([sys.executable, "-c", code], env=without, capture_output=True).returncode
        == 0
    )
