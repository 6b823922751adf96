"""Episodes over recordings: the config of each arm, and the run of one episode.

A recording stands in the place of a world. Each arm steps a stack through it with at most one
assumption off, and is paired with the unperturbed arm of its recording, robot and seed.
"""

from __future__ import annotations

import functools
from pathlib import Path

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.config_document import from_json
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared, prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.job import Job, Source, episode_key


def recorded_config(
    study: StudyFile,
    name: str,
    robot: str,
    stack: str,
    settings: tuple[str, ...],
    perturbation: AnyPerturbation | None,
) -> tuple[Config, Source]:
    """Return the config of an arm over a recording with seed 0, and the source of its inputs.

    Raises:
        InputError: The recording cannot be read, a setting is refused or has a field of its own in
            such a study, or the perturbation is one of the world.
    """
    for field, instead in (("stack.name", "stacks"), ("perturbation", "perturbations")):
        if field in study.settings or field in study.axes:
            raise InputError(f"study '{study.name}': {field} with recordings, expected `{instead}`")
    source = Source(
        Path(name), robot, settings, None if stack in ("", BUILTIN) else stack, study.read
    )
    prepared = _prepared(_opened(source.recording, study.read), source, perturbation)
    RecordedPerturbation(prepared.config, prepared.infos)
    return prepared.config, source


@functools.lru_cache(1)
def _opened(path: Path, read: RecordingOptions) -> Recording:
    """Open a recording, once for all its arms."""
    return open_recording(path, options=read)


def _prepared(
    recording: Recording, source: Source, perturbation: AnyPerturbation | None, seed: int = 0
) -> Prepared:
    return prepare(
        recording,
        find_body(source.robot),
        source.settings,
        seed=seed,
        stack=source.stack,
        perturbation=perturbation,
    )


def run_recorded(job: Job, source: Source) -> None:
    """Run one episode over a recording.

    Raises:
        InputError: A file was changed since the plan, or the episode cannot run.
    """
    config = from_json(job.config, allow_plugins=True)
    recording = open_recording(source.recording, options=source.read)
    prepared = _prepared(recording, source, config.perturbation, config.seed)
    contents = contents_of(named_by(prepared.config))
    if episode_key(prepared.config, contents) != job.key:
        raise InputError("Wayproof or a file that it names was changed since the plan")
    run_recording(recording, prepared, job.log)
