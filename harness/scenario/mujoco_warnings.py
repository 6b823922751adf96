"""MuJoCo's warnings on standard error, not in a file of the working folder as by default."""

from __future__ import annotations

import sys

import mujoco


def redirect_mujoco_warnings() -> None:
    """Redirect MuJoCo's warnings to standard error; called before anything compiles."""
    mujoco.set_mju_user_warning(_print_warning)


def _print_warning(text: str) -> None:
    line = " ".join(str(text).split())
    print(f"wayproof: warning: MuJoCo: {line}", file=sys.stderr)
