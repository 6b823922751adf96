"""A study file of the user's own, and the workflow that runs it in their CI."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from wayproof.harness.errors import InputError
from wayproof.harness.metrics import METRICS
from wayproof.harness.outputs import written_whole
from wayproof.harness.statistics.exact import CONFIDENCE
from wayproof.harness.statistics.intervals import LEAST_CLUSTERS
from wayproof.harness.statistics.support import RATE
from wayproof.harness.study.analysis import Values
from wayproof.harness.study.default_gates import DEFAULT_GATES
from wayproof.harness.study.file import StudyFile, arms_of, gates_of, read_study
from wayproof.harness.study.gate import Gate, read_gate
from wayproof.harness.study.gates import verdict_of
from wayproof.harness.study.plan import plan_episodes

WORKFLOW = Path(".github/workflows/wayproof.yml")
"""The workflow of GitHub, from the root of the repository."""

MOST_SEEDS = 2000
"""Maximum number of seeds that a gate may ask for."""

STEPS = """\
name: wayproof
on:
  pull_request:
  push:
    branches: [main]
jobs:
  wayproof:
    runs-on: ubuntu-latest
    steps:
      - uses: actions/checkout@v4
        with:
          submodules: true
      - uses: actions/setup-python@v5
        with:
          python-version: "3.12"
      - uses: {action}
        with:
          study: {study}
"""


def write_new(name: str, settings: Sequence[str], action: str, root: Path) -> tuple[Path, Path]:
    """Write a study and a workflow for it; nothing is overwritten.

    Unless `settings` names the seeds, there are as many as its gates, and those by which the base
    branch is compared, need to be held by a stack that loses nothing.

    Args:
        name: Study file, or name of a packaged study.
        settings: Fields of the study, as `stacks=my_stack.py:MyStack`.
        action: Where the action is: `./FOLDER` in the repository, or `OWNER/REPOSITORY@TAG`.
        root: Root of the repository.

    Returns:
        The study file and the workflow.

    Raises:
        InputError: A file exists or cannot be written, a field is wrong, or no number of seeds
            shows a gate.
    """
    study = read_study(name, allow_plugins=True, settings=settings)
    if not any(text.startswith("seeds=") for text in settings):
        study = msgspec.structs.replace(study, seeds=seeds_that_decide(study))
    plan_episodes(study)  # names that are unknown
    file, workflow = root / f"{study.name}.toml", root / WORKFLOW
    for path in (file, workflow):
        if path.exists():
            raise InputError(f"'{path}' exists, expected a repository without it")
    workflow.parent.mkdir(parents=True, exist_ok=True)
    steps = STEPS.format(action=action, study=file.relative_to(root))
    for path, text in ((file, study_text(study)), (workflow, steps)):
        with written_whole(path, "file") as partial:
            partial.write_text(text, encoding="utf-8")
    return file, workflow


def seeds_that_decide(study: StudyFile) -> int:
    """Return how many seeds hold every gate on a rate where no episode is lost.

    How far a time or a clearance scatters is not known beforehand, so those gates count only among
    all that hold together.

    Raises:
        InputError: A gate is not held by `MOST_SEEDS` seeds.
    """
    arms = arms_of(study)
    compared = [read_gate(text) for text in DEFAULT_GATES]
    needed = LEAST_CLUSTERS
    for gates in (gates_of(study), compared):
        confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(gates) * arms, 1)
        for gate in gates:
            if gate.figure in ("mean", "share with any"):
                needed = _held_from(gate, confidence, needed)
    return needed


def _held_from(gate: Gate, confidence: float, least: int) -> int:
    """Return the least number of seeds that holds a gate: with more it is held as well."""

    def held(seeds: int) -> bool:
        interval = gate.interval(_best(gate, seeds), confidence)
        return interval is not None and verdict_of(gate, interval) == "held"

    seeds = least + bisect_left(range(least, MOST_SEEDS + 1), True, key=held)
    if seeds > MOST_SEEDS:
        raise InputError(
            f"gate '{gate.text}': {MOST_SEEDS} seeds without a loss do not show it, expected a "
            "wider bound"
        )
    return seeds


def _best(gate: Gate, seeds: int) -> Values:
    """Return the best values that a gate can be given."""
    support = RATE if gate.figure == "share with any" else METRICS[gate.metric].support
    best = [support.low if gate.at_most else support.high] * seeds
    clusters = [("", seed) for seed in range(seeds)]
    return Values(best, best if gate.statistic in ("drop", "rise") else None, clusters, support)


def study_text(study: StudyFile) -> str:
    """Return a study as a TOML file, without the fields that have their default.

    Raises:
        InputError: A setting has no form in TOML.
    """
    document = msgspec.to_builtins(study)
    written = {name: document[name] for name in _other_than_default(study)}
    tables = {name: value for name, value in written.items() if isinstance(value, dict)}
    lines = [f"{name} = {toml_of(written[name])}" for name in written if name not in tables]
    for name, table in tables.items():
        lines += ["", f"[{name}]"]
        lines += [f"{msgspec.json.encode(key).decode()} = {toml_of(table[key])}" for key in table]
    return "\n".join([*lines, ""])


def _other_than_default(study: StudyFile) -> Iterator[str]:
    for field in msgspec.structs.fields(study):
        value = getattr(study, field.name)
        made = field.default_factory is not msgspec.NODEFAULT
        if field.required or value != (field.default_factory() if made else field.default):
            yield field.encode_name


def toml_of(value: Any) -> str:
    """Return a value of JSON as TOML has it inline.

    Raises:
        InputError: It is none.
    """
    if isinstance(value, dict):
        held = {key: one for key, one in value.items() if one is not None}
        return "{" + ", ".join(f"{key} = {toml_of(one)}" for key, one in held.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    if value is None:
        raise InputError("a setting without a value, which no study file can hold")
    return msgspec.json.encode(value).decode()
