"""Check that a log is that of a planned episode, by its content and not its name.

A log holds the settings that its scenario resolved also as they were asked for. With these its
config, the hashes of the files of world, robot, planner, predictor and stack, and the digest of
Wayproof must give the key of the episode.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import as_asked
from wayproof.harness.errors import InputError
from wayproof.harness.log.machine import CODE
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.study.contents import class_identity
from wayproof.harness.study.job import key_of
from wayproof.harness.study.plan import Planned
from wayproof.models.robots.custom import parse_spec


class ForeignLog(InputError):
    """Error of a log in the place of another episode's log."""


def open_planned(path: Path, planned: Planned, allow_plugins: bool = False) -> Log:
    """Open the log of an episode.

    Args:
        path: Path of the log.
        planned: The episode.
        allow_plugins: Import code that its config names.

    Raises:
        ForeignLog: The log is of another episode, or forked.
        InputError: The log is damaged or unfinished.
    """
    log = open_log(path, allow_plugins)
    differing = mismatch(log, planned)
    if differing:
        raise ForeignLog(
            f"log '{path}': not the episode that was planned ({differing}); "
            "move it away to run the episode"
        )
    return log


def mismatch(log: Log, planned: Planned) -> str:
    """Return how a log differs from that of an episode; empty if it does not.

    Raises:
        InputError: What was asked for is damaged.
    """
    if log.forks:
        return f"forked at decision {log.forks[0].at}, expected an episode of one config"
    asked = log.config
    if log.asked:
        asked = as_asked(replace(log.config, robot_file="", prior_map=b""), log.asked)
    if _key_of(asked, log) == planned.key:
        return ""
    return _difference(log, asked, planned.config)


def _key_of(config: Config, log: Log) -> str:
    """Return the key, with the hashes of classes that the log holds beside its config."""
    robot = config.robot
    names = config.planner.name, config.prediction.source, config.stack.name
    planner, predictor, stack = (_identity(name, log) for name in names)
    if log.config.robot_file:
        controller = parse_spec(log.config.robot_file).controller
        if controller in log.plugins:
            robot = f"{robot} {class_identity(controller, log.plugins[controller])}"
    named = replace(config, robot=robot, stack=replace(config.stack, name=stack))
    return key_of(named, planner, predictor, log.run.get(CODE, ""))


def _identity(name: str, log: Log) -> str:
    """Return the name of a user's code, with the hash of its files if the log has one."""
    return class_identity(name, log.plugins[name]) if name in log.plugins else name


def _difference(log: Log, got: Config, expected: Config) -> str:
    """Return the first setting that differs; names of files last, as their hashes may agree."""
    one, other = settings_in(got), settings_in(expected)
    names = sorted(other, key=lambda name: (name in ("world", "robot"), name != "seed"))
    for name in names:
        if one.get(name) != other[name]:
            return f"{name}: got {str(one.get(name))[:60]}, expected {str(other[name])[:60]}"
    program = f"by Wayproof {log.run.get('wayproof', '')[:20]}, code {log.run.get(CODE, '')[:16]}"
    files = ", ".join(log.plugins)[:80]
    return f"{program}, or with another file of {files}" if files else program


def settings_in(config: Config) -> dict[str, Any]:
    """Return every setting of a config by its dotted name."""
    return dict(_settings(msgspec.to_builtins(config)))


def _settings(document: dict[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in document.items():
        if isinstance(value, dict):
            yield from _settings(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value
