"""Check that a log is that of a planned episode, by its content and not its name.

A run fills in what its config leaves open: start, goal and sensors. These are derived again from
the world and the robot. The rest of the config, the hashes of the files of world, robot, planner
and stack, and the version of Wayproof must give the key of the episode.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeGuard

import msgspec
import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.scenario.places import Given, goals_of
from wayproof.harness.scenario.robots import limits_of_auto
from wayproof.harness.scenario.worlds import generate
from wayproof.harness.study.contents import class_identity
from wayproof.harness.study.job import key_of
from wayproof.harness.study.plan import Planned
from wayproof.models.robots import ROBOTS
from wayproof.models.robots.custom import parse_spec
from wayproof.models.scene import resolve
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds import WORLDS

CLOSE = 1e-6
"""Tolerance of start and goal, m: the last bits of a world depend on the machine."""

Goal = Given | str
"""A goal as a config has it: a point, or the name of a place."""


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
    """Return how a log differs from that of an episode; empty if it does not."""
    if log.forks:
        return f"forked at decision {log.forks[0].at}, expected an episode of one config"
    expected = planned.config
    if planned.source is not None:
        key = _key_of(log.config, log)
        return "" if key == planned.key else _difference(log, log.config, expected)
    limits = log.config.motion.limits  # that the robot had in its world
    if expected.motion.limits == "auto":
        limits = "auto"
    open_again = replace(
        log.config,
        motion=replace(log.config.motion, limits=limits),
        start=expected.start,
        goal=expected.goal,
        waypoints=expected.waypoints,
        sensors=expected.sensors,
        robot_file="",
        prior_map=b"",
    )
    if _key_of(open_again, log) != planned.key:
        return _difference(log, open_again, expected)
    if limits == "auto" and log.config.motion.limits not in (possible := _limits(expected)):
        return f"motion.limits: got {log.config.motion.limits}, expected {' or '.join(possible)}"
    if log.config.sensors not in (expected.sensors, _sensors(log, expected)):
        return "sensors: others than the robot's with the settings planned"
    start, goals = _points(log, expected)
    pairs: list[tuple[str, Goal | None, Given | None]] = [("start", log.config.start, start)]
    if goals is not None:
        got = (*log.config.waypoints, log.config.goal)
        if len(got) != len(goals):
            return f"waypoints: got {len(got) - 1}, expected {len(goals) - 1}"
        names = (*["waypoints"] * (len(goals) - 1), "goal")
        pairs += zip(names, got, goals, strict=True)
    for name, placed, own in pairs:
        if placed is not None and own is not None and not _alike(placed, own):
            return f"{name}: got {_point(placed)}, expected {_point(own)}"
    return ""


def _key_of(config: Config, log: Log) -> str:
    """Return the key, with the hashes of classes that the log holds beside its config."""
    robot = config.robot
    planner, stack = (_identity(name, log) for name in (config.planner.name, config.stack.name))
    if log.config.robot_file:
        controller = parse_spec(log.config.robot_file).controller
        if controller in log.plugins:
            robot = f"{robot} {class_identity(controller, log.plugins[controller])}"
    named = replace(config, robot=robot, stack=replace(config.stack, name=stack))
    return key_of(named, planner, log.run.get("wayproof", ""))


def _identity(name: str, log: Log) -> str:
    """Return the name of a planner or a stack, with the hash of its file if the log has one."""
    return class_identity(name, log.plugins[name]) if name in log.plugins else name


def _limits(expected: Config) -> list[str]:
    """Return what `motion.limits=auto` may stand for: two where only a file says what moves."""
    if expected.world not in WORLDS:
        return sorted({limits_of_auto(expected, moves) for moves in (False, True)})
    moves = _moves(expected.world, expected.seed, expected.difficulty, expected.world_parameters)
    return [limits_of_auto(expected, moves)]


@functools.lru_cache(256)
def _moves(world: str, seed: int, difficulty: float, parameters: WorldParameters) -> bool:
    """Return whether things move in a generated world, which the arms of a study share."""
    config = Config(world, "", seed, difficulty=difficulty, world_parameters=parameters)
    return bool(generate(config).movers)


def _sensors(log: Log, expected: Config) -> object:
    """Return the sensors that a run resolves from the robot's own and the settings."""
    if expected.robot in ROBOTS:
        mounts = ROBOTS[expected.robot].spec.mounts
    else:
        mounts = parse_spec(log.config.robot_file).mounts()
    try:
        return resolve(mounts, expected.sensors)
    except ValueError:
        return None  # which no episode was run with


def _points(log: Log, expected: Config) -> tuple[Given | None, tuple[Given, ...] | None]:
    """Return start and goals as given or of the world; None if only a file defines them."""
    goals = (*expected.waypoints, expected.goal)
    if expected.world in WORLDS and (expected.start is None or not all(map(_is_point, goals))):
        return _world_points(
            expected.world,
            expected.seed,
            expected.difficulty,
            expected.world_parameters,
            given=(expected.start, expected.waypoints, expected.goal),
        )
    given = tuple(one for one in goals if _is_point(one))
    return expected.start, given if len(given) == len(goals) else None


def _is_point(goal: Goal | None) -> TypeGuard[Given]:
    return goal is not None and not isinstance(goal, str)


@functools.lru_cache(256)
def _world_points(
    world: str,
    seed: int,
    difficulty: float,
    parameters: WorldParameters,
    given: tuple[Given | None, tuple[Goal, ...], Goal | None],
) -> tuple[Given, tuple[Given, ...]]:
    """Return start and goals in a generated world, which the arms of a study share."""
    start, waypoints, goal = given
    config = Config(world, "", seed, difficulty=difficulty, world_parameters=parameters)
    config = replace(config, start=start, waypoints=waypoints, goal=goal)
    made = generate(config)
    return made.start[:2] if start is None else start, goals_of(config, made)


def _alike(got: Given | str, own: Given) -> bool:
    """Return whether points agree; the run fills in the height."""
    return _is_point(got) and bool(np.allclose(got[: len(own)], own, rtol=0.0, atol=CLOSE))


def _point(values: Given | str) -> str:
    if isinstance(values, str):
        return values
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def _difference(log: Log, got: Config, expected: Config) -> str:
    """Return the first setting that differs; names of files last, as their hashes may agree."""
    one, other = (dict(_settings(msgspec.to_builtins(config))) for config in (got, expected))
    names = sorted(other, key=lambda name: (name in ("world", "robot"), name != "seed"))
    for name in names:
        if one.get(name) != other[name]:
            return f"{name}: got {str(one.get(name))[:60]}, expected {str(other[name])[:60]}"
    version = f"by Wayproof {log.run.get('wayproof', 'of no version')[:20]}"
    files = ", ".join(log.plugins)[:80]
    return f"{version}, or with another file of {files}" if files else version


def _settings(document: dict[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in document.items():
        if isinstance(value, dict):
            yield from _settings(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value
