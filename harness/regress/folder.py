"""A test folder: a world file, a study that runs it, and what it is for in a page of ten lines."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import msgspec

from wayproof.harness.config import BUILTIN
from wayproof.harness.config_document import value_of
from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole
from wayproof.harness.regress.reductions import changed_settings
from wayproof.harness.regress.scene import Case
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.new import study_text

WORLD, TEST, PAGE = "world.xml", "test.toml", "README.md"

GATES = ("success.every >= 1", "collisions.every <= 0")
"""What every episode of a test must keep."""


def write_test(
    case: Case, folder: Path, name: str, seeds: Sequence[int], what: Sequence[str]
) -> Path:
    """Write the test of a scenario.

    Args:
        case: The scenario.
        folder: Folder of the test; files of these names in it are replaced.
        name: Name of the study.
        seeds: Seeds of its episodes: the noise, as the world is a file.
        what: Lines that say what went wrong, for the page.

    Returns:
        The study file.

    Raises:
        InputError: A setting has no form in TOML, or the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out '{folder}': {error.strerror}") from None
    config, stack = case.config, case.config.stack.name
    given = ["start", "goal", "waypoints", "perturbation"]
    names = [*changed_settings(config), *(one for one in given if getattr(config, one))]
    study = StudyFile(
        name=name,
        worlds=[WORLD],
        robots=[config.robot],
        stacks=[] if stack == BUILTIN else [stack],
        seeds=list(seeds),
        settings={one: msgspec.to_builtins(value_of(config, one)) for one in names},
        gates=list(GATES),
    )
    run = f"wayproof study {TEST} --set stacks=YOUR_STACK"
    page = [
        f"# {name}", "", *what, "",
        "Every episode must reach the goal and touch nothing. Run it in this folder:", "",
        f"    {run}" if stack == BUILTIN else f"    wayproof study {TEST}",
        "    pytest --wayproof .", "",
        f"`{WORLD}` is the scene, a MuJoCo file; `wayproof view` shows the logs of the episodes.",
    ]  # fmt: skip
    for file, text in (
        (WORLD, case.text()),
        (TEST, study_text(study)),
        (PAGE, "\n".join([*page, ""])),
    ):
        with written_whole(folder / file, "--out") as partial:
            partial.write_text(text, encoding="utf-8")
    return folder / TEST


def command_of(test: Path) -> str:
    """Return the command that runs a test."""
    return shlex.join(["wayproof", "study", str(test)])
