"""Provenance of a report: versions, machine, seeds and dates of the logs, and commands."""

from __future__ import annotations

import datetime
import functools
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import setting_names, value_of
from wayproof.harness.log.reader import Log
from wayproof.harness.study.file import PACKAGED, StudyFile
from wayproof.harness.study.plan import CLEAN, Planned
from wayproof.harness.study.store import Store

VERSIONS = ("wayproof", "code", "format_version", "python", "mujoco", "numpy", "numba", "ompl")
"""Entries of a log's `run` that a report shows."""

MACHINE = ("machine", "cpu", "libc")

APART = ("world", "robot", "seed", "perturbation", "stack.name")
"""Settings that a command has as options of their own."""


def of_study(
    study: StudyFile, planned: Sequence[Planned], store: Store, runs: Iterable[Mapping[str, str]]
) -> list[tuple[str, str]]:
    """Return the provenance of a study as names and texts.

    Args:
        study: The study.
        planned: Its episodes.
        store: Folder of the study.
        runs: `run` of each log that was read.
    """
    lines = _versions(list(runs))
    seeds = sorted({one.seed for one in planned})
    shown = f"{seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else str(seeds[0])
    lines.append(("seeds", f"{len(seeds)}: {shown}"))
    if study.settings:
        lines.append(("settings", ", ".join(f"{k}={v}" for k, v in study.settings.items())))
    lines += [
        (f"{name}, drawn for each seed", f"{low} to {high}")
        for name, (low, high) in study.randomise.items()
    ]
    lines += [(f"axis {name}", ", ".join(map(str, some))) for name, some in study.axes.items()]
    written = [path.stat().st_mtime for path in store.logs.glob("*.mcap")]
    if written:
        lines.append(("logs written", _days(min(written), max(written))))
    if (PACKAGED / f"{study.name}.toml").is_file():
        words = ["wayproof", "study", study.name]
        if study.imports is not None:
            words += ["--set", f"import.folder={study.imports.folder}"]
        lines.append(("command of the study", shlex.join(words)))
    lines.append(("command of this report", shlex.join(["wayproof", "report", str(store.folder)])))
    return lines


def of_episode(log: Log) -> list[tuple[str, str]]:
    """Return the provenance of an episode as names and texts."""
    changed = [f"{name}={text}" for name, text in differing_settings(log.config).items()]
    chain = [("chain of the decisions", log.result["chain"])]
    return [*_versions([log.run]), ("settings", ", ".join(changed) or "defaults"), *chain]


def _versions(runs: Sequence[Mapping[str, str]]) -> list[tuple[str, str]]:
    lines = []
    for name in (*VERSIONS, *MACHINE):
        found = sorted({run[name] for run in runs if name in run})
        if found:
            lines.append((name.replace("_", " "), ", ".join(found)))
    return lines


def _days(first: float, last: float) -> str:
    begin, end = (
        datetime.datetime.fromtimestamp(one, datetime.UTC).date().isoformat()
        for one in (first, last)
    )
    return begin if begin == end else f"{begin} to {end}"


@functools.cache
def _defaults() -> Config:
    return Config("", "", 0)


def differing_settings(config: Config) -> dict[str, str]:
    """Return the settings that are not at their defaults, as `--set` takes them."""
    found = {}
    for name in setting_names():
        if name in APART:
            continue
        value, default = value_of(config, name), value_of(_defaults(), name)
        if value != default:
            text = value if isinstance(value, str) else msgspec.json.encode(value).decode()
            found[name] = text
    return found


def run_command(planned: Planned) -> str:
    """Return the command that runs an episode alone."""
    config = planned.config
    words = ["wayproof", "run", config.world, "--robot", config.robot, "--seed", str(config.seed)]
    if config.stack.name != _defaults().stack.name:
        words += ["--stack", config.stack.name]
    arm = planned.arm
    if arm.perturbation != CLEAN:
        kind, *mode = arm.perturbation.split(":")
        words += ["--perturb", ":".join([kind, f"{arm.severity:g}", *mode])]
    elif config.perturbation is not None:
        document = msgspec.json.encode(config.perturbation).decode()
        words += ["--set", f"perturbation={document}"]
    for name, text in differing_settings(config).items():
        words += ["--set", f"{name}={text}"]
    return shlex.join(words)


def log_commands(log: Path, planned: Planned, failed: bool, chance: int | None) -> list[str]:
    """Return commands on the log of an episode, as they are typed where the report is written."""
    path = shlex.quote(str(log))
    lines = [f"wayproof explain {path}"]
    if chance is not None:
        lines.append(f"wayproof explain {path} {chance} --png decision.png")
    if failed:
        lines.append(f"wayproof explain {path} --check")
    lines += [f"wayproof view {path}", f"wayproof replay {path}"]
    return [*lines, run_command(planned)]
