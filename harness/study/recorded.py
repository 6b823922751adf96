"""Episodes over recordings: the plan of a study, one episode, and the judgement of its way.

A recording stands in the place of a world. Each arm steps a stack through it with at most one
assumption off, and is paired with the unperturbed arm of its recording, robot and seed.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from wayproof.harness.config import BUILTIN, HASH_SEPARATOR, Config
from wayproof.harness.config_document import from_json
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import Body, find_body
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared, prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.shadow.summary import Verdict, summarize
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.file import StudyFile, seeds_of, stacks_of
from wayproof.harness.study.job import Job, episode_key
from wayproof.harness.study.plan import (
    Arm,
    Planned,
    perturbation_at,
    perturbed_arms,
    settings_of,
    variants_of,
)
from wayproof.harness.study.source import Source


def plan_recorded(study: StudyFile, contents: Mapping[str, str]) -> list[Planned]:
    """Return every episode of a study over recordings, seed by seed.

    Args:
        study: The study.
        contents: Identities of the files of code that it names.

    Raises:
        InputError: A recording cannot be read, a setting is refused, or a perturbation is one of
            the world.
    """
    _refuse_settings(study)
    bodies = {robot: find_body(robot) for robot in study.robots}
    planned: list[Planned] = []
    for name in dict.fromkeys(study.recordings):
        recording = open_recording(Path(name), options=study.read.options)
        for robot, body in bodies.items():
            for arm, source, config in _arms(study, name, recording, robot, body):
                for seed in seeds_of(study):
                    own = replace(config, seed=seed)
                    key = episode_key(own, contents)
                    planned.append(Planned(arm, seed, config=own, key=key, source=source))
    places = {seed: place for place, seed in enumerate(seeds_of(study))}
    return sorted(planned, key=lambda one: places[one.seed])


def _refuse_settings(study: StudyFile) -> None:
    """Refuse settings that have a field of their own in a study over recordings."""
    for name, instead in (("stack.name", "stacks"), ("perturbation", "perturbations")):
        if name in study.settings or name in study.axes:
            raise InputError(f"study '{study.name}': {name} with recordings, expected `{instead}`")


def _arms(
    study: StudyFile, name: str, recording: Recording, robot: str, body: Body
) -> Iterator[tuple[Arm, Source, Config]]:
    """Yield each arm of one recording and one robot, with the config of seed 0."""
    arms = itertools.product(stacks_of(study), variants_of(study), perturbed_arms(study))
    for stack, variant, (perturbation, severity) in arms:
        source = Source(
            recording=name,
            robot=robot,
            settings=(*settings_of(study), *variant),
            stack="" if stack == BUILTIN else stack,
            read=study.read,
        )
        config = from_prepared(recording, body, source, perturbation, severity).config
        arm = Arm(
            config.world,
            robot,
            variant=" ".join(variant),
            perturbation=perturbation,
            severity=severity,
            stack=stack,
        )
        yield arm, source, config


def from_prepared(
    recording: Recording, body: Body, source: Source, perturbation: str, severity: float
) -> Prepared:
    """Resolve the settings of an arm.

    Raises:
        InputError: As of `prepare`; or its perturbation changes the world.
    """
    prepared = prepare(
        recording,
        body,
        source.settings,
        stack=source.stack or None,
        perturbation=perturbation_at(perturbation, severity),
    )
    RecordedPerturbation(prepared.config, prepared.infos)
    return prepared


def run_recorded(job: Job) -> None:
    """Run one episode over a recording.

    Raises:
        InputError: A file was changed since the plan, or the episode cannot run.
    """
    source = job.source
    assert source is not None
    config = from_json(job.config, allow_plugins=True)
    recording = open_recording(Path(source.recording), options=source.read.options)
    prepared = prepare(
        recording,
        find_body(source.robot),
        source.settings,
        seed=config.seed,
        stack=source.stack or None,
        perturbation=config.perturbation,
    )
    contents = contents_of(named_by(prepared.config))
    if episode_key(prepared.config, contents) != job.key:
        raise InputError("a file that it names was changed since the plan")
    run_recording(recording, prepared, job.log)


@dataclass(frozen=True)
class Judged:
    """Judgement of a way, for the table of a study.

    Attributes:
        verdict: `admitted`, `not admitted` or `nothing shown`.
        admitted_share: Share of the way that was admitted when it was entered; None without a way.
        driven_m: Length of the way, m.
        refused_m: Length that was not admitted by reason, m.
    """

    verdict: Verdict
    admitted_share: float | None
    driven_m: float
    refused_m: dict[str, float]


@cache
def judge_way(log: Path, digest: str, allow_plugins: bool) -> Judged:
    """Judge the way of a log, once for each content of it.

    Args:
        log: The log.
        digest: Digest of its content.
        allow_plugins: Import code that the log names.

    Raises:
        InputError: The log is damaged.
    """
    summary = summarize(assess(log, allow_plugins))
    return Judged(summary.verdict, summary.admitted_share, summary.driven_m, summary.refused_m)


def short_name(world: str) -> str:
    """Return a recording's name without its hash."""
    return world.partition(HASH_SEPARATOR)[0]
