"""Plan of a study: every episode with its resolved settings, in arms that differ by seed."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from wayproof.harness.config import BUILTIN, HASH_SEPARATOR, PLUGIN, Config
from wayproof.harness.config_document import from_document, override, with_perturbation
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.interface.connect import is_ros2, is_users
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.perturbations import AnyPerturbation, perturbation_from
from wayproof.harness.prior_config import MADE_OF_WORLD
from wayproof.harness.scenario.robots import ENDING as ROBOT_FILE
from wayproof.harness.scenario.worlds import ENDING as WORLD_FILE
from wayproof.harness.study.contents import Contents, contents_of
from wayproof.harness.study.file import (
    StudyFile,
    check_study,
    files_of,
    gates_of,
    levels_of,
    seeds_of,
    settings_and_values,
    stacks_of,
)
from wayproof.harness.study.job import Source, episode_key
from wayproof.harness.study.randomise import drawn
from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import WORLDS

CLEAN = "none"
"""Name of no perturbation."""


@dataclass(frozen=True)
class Arm:
    """Group of episodes that differ only in their seed.

    Attributes:
        world: Name of the world; of a recording, with its hash.
        robot: Name of the robot.
        variant: Settings of the axes, `a=1 b=2`; empty without axes.
        perturbation: Name of the perturbation, or `none`.
        severity: Severity, up to 5; 0 unperturbed.
        stack: Name of the stack; empty in a study without `stacks`.
    """

    world: str
    robot: str
    variant: str
    perturbation: str
    severity: float
    stack: str = ""


def name_of(arm: Arm) -> str:
    """Return an arm in words."""
    perturbed = "" if arm.perturbation == CLEAN else arm.perturbation
    if arm.severity:
        perturbed += f":{arm.severity:g}"
    world = arm.world.partition(HASH_SEPARATOR)[0]  # of a recording
    parts = (world, arm.robot, arm.stack, arm.variant, perturbed)
    return " ".join(part for part in parts if part)


@dataclass(frozen=True)
class Planned:
    """Episode of a study.

    Attributes:
        arm: Its arm.
        seed: Its seed.
        config: Its resolved settings.
        key: Content address.
        reference: Arm that it is compared with, seed by seed; None of one that others refer to.
        source: Recording of its inputs; None of a simulated episode.
    """

    arm: Arm
    seed: int
    config: Config
    key: str
    reference: Arm | None = None
    source: Source | None = None


def reference_of(arm: Arm, first_variant: str, first_stack: str = "") -> Arm | None:
    """Return the reference of an arm: unperturbed, of the first stack, or of the first variant.

    It is None for the arm that is the reference of the others. An episode and its twin share world,
    robot and seed.
    """
    if arm.perturbation != CLEAN:
        return replace(arm, perturbation=CLEAN, severity=0)
    if arm.stack != first_stack:
        return replace(arm, stack=first_stack)
    if arm.variant != first_variant:
        return replace(arm, variant=first_variant)
    return None


def plan_episodes(study: StudyFile, contents: Contents | None = None) -> list[Planned]:
    """Return every episode with its resolved settings, seed by seed, so that pairs end together.

    Args:
        study: The study.
        contents: Identities of the files that it names; None to read the files.

    Raises:
        InputError: A world, robot or setting that does not exist, a file that cannot be read, a
            gate on a difference where nothing is paired, or too many episodes.
    """
    check_study(study)
    _check_names(study)
    if contents is None:
        contents = contents_of(files_of(study))
    stacks, variants = stacks_of(study), variants_of(study)
    perturbed = perturbed_arms(study)
    if len(stacks) * len(variants) * len(perturbed) == 1:
        _refuse_differences(study)
    places = dict.fromkeys(study.recordings or study.worlds)
    made = []
    for place, robot, stack, variant, (perturbation, severity) in itertools.product(
        places, dict.fromkeys(study.robots), stacks, variants, perturbed
    ):
        settings = (*settings_of(study), *variant)
        broken = perturbation_at(perturbation, severity)
        config, source = _config_of(study, place, robot, stack, settings, broken)
        arm = Arm(config.world, robot, " ".join(variant), perturbation, severity, stack)
        made.append((arm, config, source))
    first = made[0][0]
    return [
        planned_for(
            arm,
            replace(override(config, own), seed=seed, **ends),
            contents,
            reference=reference_of(arm, first.variant, first.stack),
            source=source,
        )
        for seed, own in [(seed, drawn(study.randomise, seed)) for seed in seeds_of(study)]
        for arm, config, source in made
        for ends in [_ends_of(study, arm.world, seed)]
    ]


def _config_of(
    study: StudyFile,
    place: str,
    robot: str,
    stack: str,
    settings: tuple[str, ...],
    perturbation: AnyPerturbation | None,
) -> tuple[Config, Source | None]:
    """Return the config of an arm with seed 0, and the recording of its inputs if it has one."""
    if study.recordings:
        from wayproof.harness.study.recorded import recorded_config  # slow to load

        return recorded_config(study, place, robot, stack, settings, perturbation)
    own = [f"stack.name={stack}"] if stack else []
    asked = from_document({"world": place, "robot": robot, "seed": 0})
    config = override(asked, [*own, *settings])
    if perturbation is not None:
        config = with_perturbation(config, perturbation)
    _refuse_prior_file(study, config)
    return config, None


def _ends_of(study: StudyFile, world: str, seed: int) -> dict[str, Any]:
    """Return the start and goal of a seed where a world has one for each; else nothing."""
    if study.imports is None or world not in study.imports.ends:
        return {}
    start, goal = study.imports.ends[world][seed]
    return {"start": start, "goal": goal}


def _refuse_prior_file(study: StudyFile, config: Config) -> None:
    """Refuse a prior map that is a file, whose content is not part of the key of an episode."""
    if config.prior.source not in MADE_OF_WORLD:
        raise InputError(
            f"study '{study.name}': prior.source '{config.prior.source}', expected "
            f"{', '.join(MADE_OF_WORLD)}: a map that is made of the world of each episode"
        )


def _check_names(study: StudyFile) -> None:
    """Check names of worlds and robots; files are checked when their contents are read."""
    robots = () if study.recordings else study.robots  # bodies, which the plan reads
    for kind, names, ending, registry in (
        ("world", study.worlds, WORLD_FILE, WORLDS),
        ("robot", robots, ROBOT_FILE, ROBOTS),
    ):
        for name in names:
            if not name.endswith(ending) and name not in registry:
                raise unknown_name(f"{kind} of study '{study.name}'", name, registry)
    named = [str(value) for key, value in settings_and_values(study) if key == "stack.name"]
    for name in named:
        if is_users(name) and PLUGIN not in name and not is_ros2(name):
            raise unknown_name(f"stack of study '{study.name}'", name, [BUILTIN, *STACKS])
    if study.stacks and len(named) > len(study.stacks):
        raise InputError(f"study '{study.name}': stacks and stack.name, expected one of the two")


def _refuse_differences(study: StudyFile) -> None:
    for gate in gates_of(study):
        if gate.statistic in ("drop", "rise"):
            raise InputError(
                f"gate '{gate.text}': a difference needs pairs, and study '{study.name}' has none: "
                "expected [perturbations], two stacks, an axis of at least two values, or "
                "METRIC.mean or METRIC.every"
            )


def planned_for(
    arm: Arm,
    config: Config,
    contents: Contents,
    reference: Arm | None = None,
    source: Source | None = None,
) -> Planned:
    """Return one episode of an arm."""
    key = episode_key(config, contents)
    return Planned(arm, config.seed, config, key, reference, source)


def perturbed_arms(study: StudyFile) -> list[tuple[str, float]]:
    """Return names and severities of the perturbations, without perturbation first."""
    return [(CLEAN, 0), *_severities(study)]


def variants_of(study: StudyFile) -> list[tuple[str, ...]]:
    """Return the settings of each combination of the axes; one empty combination without axes."""
    for name, values in study.axes.items():
        if not values:
            raise InputError(f"axis '{name}' is empty, expected at least one value")
    columns = [_settings_of(name, values) for name, values in study.axes.items()]
    return list(itertools.product(*columns))


def _settings_of(name: str, values: Sequence[Any]) -> list[str]:
    return [_setting(name, value) for value in values]


def settings_of(study: StudyFile) -> list[str]:
    """Return the settings of every episode, `section.field=value`."""
    return [_setting(name, value) for name, value in study.settings.items()]


def _setting(name: str, value: Any) -> str:
    return f"{name}={value if isinstance(value, str) else json.dumps(value)}"


def _severities(study: StudyFile) -> list[tuple[str, float]]:
    levels = [(name, level) for name, some in levels_of(study).items() for level in some]
    for name, level in levels:
        if level <= 0.0:
            raise InputError(f"perturbation '{name}': severity {level:g}, expected more than 0")
    return levels


def perturbation_at(name: str, severity: float) -> AnyPerturbation | None:
    """Return the perturbation of `KIND` or `KIND:MODE` with a severity; None at 0.

    Raises:
        InputError: There is no such perturbation.
    """
    if name == CLEAN or severity == 0.0:
        return None
    kind, *mode = name.split(":")
    return perturbation_from(":".join([kind, repr(severity), *mode]))
