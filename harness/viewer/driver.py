"""What pictures are drawn with, screen or none."""

from __future__ import annotations

import os
import sys

from wayproof.harness.errors import InputError


def choose_driver() -> None:
    """Draw without a screen where there is none; called before MuJoCo is imported."""
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")


def check_driver() -> None:
    """Raise if nothing can be drawn here.

    Raises:
        InputError: It cannot.
    """
    import mujoco

    try:
        mujoco.GLContext(8, 8).free()
    except Exception as error:  # each driver raises its own
        raise InputError(
            f"no picture here: {error}; MUJOCO_GL=egl or osmesa draws without a screen"
        ) from None
