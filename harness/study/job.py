"""Job of a worker: one episode of a study."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import document_of, from_json
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.study.contents import PROGRAM, contents_of, named_by


@dataclass(frozen=True)
class Source:
    """Recording that the inputs of an episode come from.

    Attributes:
        recording: Its path.
        robot: Body: a spec file, or a robot's name.
        settings: `section.field=value` of the episode.
        stack: Stack in place of the built-in one; None for that.
        read: Selection of the recording.
    """

    recording: Path
    robot: str
    settings: tuple[str, ...]
    stack: str | None
    read: RecordingOptions


@dataclass(frozen=True)
class Job:
    """An episode to run.

    Attributes:
        key: Hash of the resolved config and of the digest of Wayproof.
        config: Config as JSON.
        log: Path of its log.
        source: Recording of its inputs; None for a simulated episode.
    """

    key: str
    config: bytes
    log: Path
    source: Source | None = None


LACKS = frozenset(
    {
        *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS),
        *(errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EAGAIN),
    }
)
"""Errors of a machine that lacks disk, memory, files or processes."""


@dataclass(frozen=True)
class Done:
    """Outcome of a job: its log is written, or there is an error.

    Attributes:
        key: Key of the episode.
        error: Error; empty with a log.
        of_machine: Whether it is the machine's (disk, memory, a killed process) and not the
            episode's: it is tried again, by this run and by the next one.
    """

    key: str
    error: str = ""
    of_machine: bool = False


def episode_key(config: Config, contents: Mapping[str, str]) -> str:
    """Return the content address of an episode, the same on any machine.

    Args:
        config: Resolved config.
        contents: Identities of Wayproof and of the files that it names (`contents_of`), which are
            used instead of paths.
    """
    world, robot, planner, stack, *predictor = (
        contents.get(name, name) for name in named_by(config)
    )
    named = replace(config, world=world, robot=robot, stack=replace(config.stack, name=stack))
    source = predictor[0] if predictor else config.prediction.source
    return key_of(named, planner, source, contents.get(PROGRAM, ""))


def key_of(config: Config, planner: str, predictor: str, program: str) -> str:
    """Return the content address of an episode.

    Args:
        config: Resolved config, with name and hash of a world, robot or stack that is a file.
        planner: Name of the planner, with the hash of its file if it has one.
        predictor: Source of predictions, likewise.
        program: Digest of Wayproof.
    """
    document = document_of(config)
    if planner != config.planner.name:  # no config takes a name with a hash
        document["planner"]["name"] = planner
    if predictor != config.prediction.source:
        document["prediction"]["source"] = predictor
    text = msgspec.json.format(msgspec.json.encode(document), indent=1)  # as `to_json`
    return hashlib.sha256(program.encode() + b"\n" + text).hexdigest()[:24]


def run_job(job: Job) -> Done:
    """Run one episode; an exception becomes its error text."""
    from wayproof.harness.interface.connect import isolating

    try:
        with isolating():
            if job.source is not None:
                from wayproof.harness.study.recorded import run_recorded

                run_recorded(job, job.source)
            else:
                _run_simulated(job)
    except InputError as error:
        return Done(job.key, str(error), _is_of_machine(error))
    except MemoryError:
        text = "took more memory than bounds.memory_mib or the machine allows"
        return Done(job.key, text, of_machine=True)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = " ".join(str(error).split())
        name = f"{Path(place.filename).name}:{place.lineno}"
        return Done(job.key, f"{type(error).__name__} at {name}: {text}", _is_of_machine(error))
    return Done(job.key)


def _is_of_machine(error: BaseException | None) -> bool:
    """Return whether an error, or one that led to it, says that the machine lacks something."""
    while error is not None:
        lacking = isinstance(error, OSError) and error.errno in LACKS
        if lacking or isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _run_simulated(job: Job) -> None:
    from wayproof.harness.interface.connect import FailedInStart
    from wayproof.harness.interface.errors import NotStarted
    from wayproof.harness.runner import run_episode
    from wayproof.harness.scenario.scenario import build

    config = from_json(job.config, allow_plugins=True)
    if episode_key(config, contents_of(named_by(config))) != job.key:
        raise InputError("Wayproof or a file that its config names was changed since the plan")
    scenario = build(config)
    try:
        run_episode(scenario, job.log)
    except NotStarted as error:  # of a stack that failed, not of an episode that cannot be run
        run_episode(scenario, job.log, session=FailedInStart(error.failure))


def warm_up_job(config: bytes) -> None:
    """Compile the kernels of this config into the cache; its episodes report what fails here."""
    from wayproof.harness.warm_up import warm_up

    with contextlib.suppress(Exception):
        warm_up(from_json(config, allow_plugins=True))
