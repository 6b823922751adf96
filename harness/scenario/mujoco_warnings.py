"""MuJoCo's warnings, told as ours: by default it appends them to a file in the working folder."""

from __future__ import annotations

import sys

import mujoco


def tell_warnings() -> None:
    """Send what MuJoCo warns of to standard error, and no file; called before anything compiles."""
    mujoco.set_mju_user_warning(_tell)


def _tell(text: str) -> None:
    line = " ".join(str(text).split())
    print(f"wayproof: warning: MuJoCo: {line}", file=sys.stderr)
