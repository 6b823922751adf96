"""Refusals of forks that could not go on from what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.errors import InputError
from wayproof.harness.goals import goals_claimed
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.types import Task
from wayproof.harness.log.reader import Log
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.replay.answers import sensors_of
from wayproof.harness.scenario.scenario import Scenario, sensor_info


def refuse_stack(log: Log, config: Config, goes_on: bool) -> None:
    """Raise an InputError if no stack can go on at a fork, or another kind than the recorded one.

    Args:
        log: The log.
        config: Config of the fork.
        goes_on: Whether there is a stack on trial, or answers of one, for the fork.
    """
    on_trial = log.config.stack.name != BUILTIN
    if on_trial and not goes_on:
        raise InputError(
            f"log '{log.path}': stack '{log.config.stack.name}' was on trial, and a log cannot say "
            "how it continues; expected --stack STACK, which is run"
        )
    if on_trial != (config.stack.name != BUILTIN):
        raise InputError(
            f"--set stack.name={config.stack.name}: continues '{log.config.stack.name}'; "
            "expected --stack STACK after a stack on trial, and no other after the built-in one"
        )


def refuse_unnamed_predictor(before: Config, config: Config, settings: Sequence[str]) -> None:
    """Raise an InputError if a fork would run a predictor that a log names, and no setting does."""
    named = any(one.startswith("prediction.source=") for one in settings)
    if config.runs_predictor and not named:
        source = before.prediction.source
        raise InputError(
            f"predictor '{source}': a fork runs it, and only the log names it; expected "
            f"--set prediction.source={source}, or prediction.policy=ignore"
        )


def refuse_predictor(old: Config, new: Config) -> None:
    """Raise an InputError if a fork begins or ends to have predictions as inputs."""
    before, after = old.prediction.source, new.prediction.source
    if is_outside(before) != is_outside(after):
        raise InputError(
            f"--set prediction.source={after}: continues '{before}'; expected a predictor from "
            "outside after one, and none but then; prediction.policy=ignore switches one off"
        )


def refuse_goals(log: Log, scenario: Scenario, at: int) -> None:
    """Raise an InputError if the mission of a fork cannot go on from that of the log.

    Either both have one goal, or both several, as only these have goals as inputs; and one has to
    be left after those reached.
    """
    goals, old = scenario.mission.goals, log.mission.goals
    if goals == old:
        return
    if (len(goals) > 1) != (len(old) > 1):
        raise InputError(
            f"--set waypoints: got a mission of {len(goals)} goals, expected "
            f"{'several' if len(old) > 1 else 'one'}, as the episode began with {len(old)}"
        )
    reached = goals_claimed(one for one in log.decisions() if one.sequence < at)
    if reached >= len(goals):
        raise InputError(
            f"--set waypoints: got a mission of {len(goals)} goals, of which {reached} are reached "
            f"at decision {at}; expected at least {reached + 1}"
        )


def refuse_other_task(log: Log, scenario: Scenario) -> None:
    """Raise an InputError if the settings of a fork change the task that a stack began with.

    Its `settings` may differ: those of the referee are none of the stack's. A prior map cannot.
    """
    infos = {caster.mount.name: sensor_info(caster) for caster in scenario.scene.casters}
    old = task_of(log.config, log.mission, sensors_of(log))
    new = task_of(scenario.config, scenario.mission, infos)
    for field in fields(Task):
        if field.name in ("settings", "seed", "prior"):
            continue
        if getattr(old, field.name) != getattr(new, field.name):
            raise InputError(
                f"--set: changes the {field.name} of the task, which the stack got at its start; "
                "expected settings of the referee or of the simulation"
            )
