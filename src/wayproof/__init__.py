"""Was the space that the robot entered proven safe, and if not, why did it go?

Names are loaded when they are first used, so that `import wayproof` takes milliseconds:

    import wayproof

    episode = wayproof.run("warehouse", robot="drone", seed=4)
    frame = episode.decisions().to_pandas()

`run`, `open` and `study` and what they return are stable: a name or a column of theirs is removed
only with a new major version, after a release that warns. The other names serve stacks and tools.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

from wayproof.kernel_cache import use_kernel_cache

if TYPE_CHECKING:
    from wayproof.harness.api.episode import MapArrays, RecordedEpisode, open, run
    from wayproof.harness.api.study import RecordedStudy, study
    from wayproof.harness.config import Config
    from wayproof.harness.config_document import override
    from wayproof.harness.errors import InputError
    from wayproof.harness.interface.types import (
        Command,
        Observation,
        Samples,
        Stack,
        Task,
        Velocity,
        Waypoints,
    )
    from wayproof.harness.log.reader import Log, open_log
    from wayproof.harness.result import Result
    from wayproof.harness.runner import run_episode
    from wayproof.harness.scenario.scenario import Scenario, build
    from wayproof.harness.stack.build import build_navigator
    from wayproof.harness.stack.pipeline import Navigator

# Small products on two BLAS threads are slower than on one, and their order of summation varies.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
use_kernel_cache()

WHERE = {
    "run": "wayproof.harness.api.episode",
    "open": "wayproof.harness.api.episode",
    "study": "wayproof.harness.api.study",
    "RecordedEpisode": "wayproof.harness.api.episode",
    "RecordedStudy": "wayproof.harness.api.study",
    "MapArrays": "wayproof.harness.api.episode",
    "Config": "wayproof.harness.config",
    "override": "wayproof.harness.config_document",
    "InputError": "wayproof.harness.errors",
    "Command": "wayproof.harness.interface.types",
    "Observation": "wayproof.harness.interface.types",
    "Samples": "wayproof.harness.interface.types",
    "Stack": "wayproof.harness.interface.types",
    "Task": "wayproof.harness.interface.types",
    "Velocity": "wayproof.harness.interface.types",
    "Waypoints": "wayproof.harness.interface.types",
    "Log": "wayproof.harness.log.reader",
    "open_log": "wayproof.harness.log.reader",
    "Result": "wayproof.harness.result",
    "run_episode": "wayproof.harness.runner",
    "Scenario": "wayproof.harness.scenario.scenario",
    "build": "wayproof.harness.scenario.scenario",
    "Navigator": "wayproof.harness.stack.pipeline",
    "build_navigator": "wayproof.harness.stack.build",
}
"""Public name -> the module that holds it."""

__all__ = [
    "Command",
    "Config",
    "InputError",
    "Log",
    "MapArrays",
    "Navigator",
    "Observation",
    "RecordedEpisode",
    "RecordedStudy",
    "Result",
    "Samples",
    "Scenario",
    "Stack",
    "Task",
    "Velocity",
    "Waypoints",
    "build",
    "build_navigator",
    "open",
    "open_log",
    "override",
    "run",
    "run_episode",
    "study",
]


def __getattr__(name: str) -> Any:
    """Load a public name.

    Raises:
        AttributeError: There is no such name.
    """
    if name not in WHERE:
        raise AttributeError(f"module 'wayproof' has no attribute '{name}'")
    return getattr(importlib.import_module(WHERE[name]), name)


def __dir__() -> list[str]:
    """Public names."""
    return __all__
