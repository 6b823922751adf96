"""OpenGL driver for pictures, with or without a screen."""

from __future__ import annotations

import os
import sys

from wayproof.harness.errors import InputError


def choose_driver() -> None:
    """Choose a driver that needs no screen if there is none; call before importing MuJoCo."""
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")


def check_driver() -> None:
    """Raise an InputError if nothing can be drawn on this machine."""
    import mujoco

    try:
        mujoco.GLContext(8, 8).free()
    except Exception as error:  # each driver raises its own
        raise InputError(
            f"no picture here: {error}; MUJOCO_GL=egl or osmesa draws without a screen"
        ) from None
