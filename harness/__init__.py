"""Scenario, episode loop, decision, log, replay and command line."""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

# Small products on two BLAS threads are slower than on one, and their order of summation varies.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


class _OwnPackages:
    """Finds our packages beside this one, whatever else has their names.

    They are common names: a `models.py` in the current folder, or a `planners` on `PYTHONPATH`,
    comes before ours on Python's path.
    """

    NAMES = ("maps", "models", "planners")
    FOLDER = str(Path(__file__).resolve().parents[1])

    @classmethod
    def find_spec(
        cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where a top-level package of ours lies; of others nothing."""
        if path is None and name in cls.NAMES:
            return PathFinder.find_spec(name, [cls.FOLDER], target)
        return None


sys.meta_path.insert(0, _OwnPackages)
