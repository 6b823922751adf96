"""Config of a recording: defaults that follow from it, and the user's settings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set
from dataclasses import replace

from wayproof.harness.config import HASH_SEPARATOR, Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.mission import Mission
from wayproof.harness.recording_config import RecordingConfig
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.shadow.body import Body

FAR = 5e3
"""Coordinate beyond which the first pose becomes the origin of the log's frame, m."""

SCANS = {
    "spacing": 0.05,
    "sweep_noise_share": 0.12,
    "map_error_share": 0.05,
    "motion_share": 0.1,
    "turn_share": 0.2,
    "turn_walk": 0.1,
}
"""Defaults of `estimate` for recordings of planar lasers alone. They see few points; one
for each beam is taken, and some 70 lie on lines: the error of a mean is that of one by the root of
their number. The error that a registration leaves is that of a sweep by the root of 20, as a scan
has a twentieth of its points. Wheels predict, which are off as GMapping takes them to be by its
defaults (Grisetti, Stachniss and Burgard 2007, T-RO 23)."""

REMOTE = ("exec", "unix", "tcp")
"""Kinds of stacks in another process."""

NAME = 60
"""Longest part of a recording's name in the name of the world."""


def is_planar(recording: Recording, level: Set[str], body: Body) -> bool:
    """Return whether all sensors are level planar lasers of a robot on the ground.

    Args:
        recording: Open.
        level: Names of its planar lasers that are level.
        body: Body of its robot.
    """
    return _are_all(recording, level) and body.motion == "ground"


def _are_all(recording: Recording, names: Set[str]) -> bool:
    return all(sensor.name in names for sensor in recording.sensors)


def settings_of(
    recording: Recording, level: Set[str], body: Body, settings: Sequence[str], seed: int
) -> Config:
    """Return the config of a recording: the user's settings over defaults that follow from it.

    Level planar lasers have, with an estimator, the errors of `SCANS`, and on the ground a flat
    grid.

    Args:
        recording: Open.
        level: Names of its planar lasers that are level.
        body: Body of its robot.
        settings: `section.field=value` of the user.
        seed: Seed of the stack's searches and of a perturbation.

    Raises:
        InputError: A setting is refused.
    """
    name = "".join(c if c.isprintable() else "?" for c in recording.name)[:NAME]
    config = Config(
        world=f"{name}{HASH_SEPARATOR}{recording.sha256[:16]}",
        robot=body.identity,
        seed=seed,
        recording=RecordingConfig(
            format=recording.format,
            sha256=recording.sha256,
            options=recording.options.texts(),
        ),
    )
    defaults = ["motion.limits=cautious"]  # `find_body` knows no others
    if is_planar(recording, level, body):
        defaults.append("map.kind=grid2d")
    if recording.mission is not None:  # the episode's own map had only its start declared free
        defaults.append("recording.footprint_clearing=false")
    if _are_all(recording, level) and override(config, settings).estimate.kind == "lidar":
        defaults.extend(f"estimate.{name}={value}" for name, value in SCANS.items())
    if recording.body_height is not None:
        defaults.append(f"recording.body_height={recording.body_height!r}")
    config = override(config, [*defaults, *settings])
    if config.estimate.kind == "truth":
        raise InputError(
            "--set estimate.kind=truth: of a simulated episode; expected 'model', which here is "
            "the recorded pose, or 'lidar'"
        )
    return config if recording.mission is not None else _with_origin(config, recording)


def _with_origin(config: Config, recording: Recording) -> Config:
    """Return the config with the origin of the log's frame: at the first pose if that is far."""
    assert config.recording is not None
    x, y, z = recording.track.positions[0].tolist()
    if max(abs(x), abs(y)) <= FAR:
        x = y = 0.0
    origin = (float(round(x)), float(round(y)), z - config.recording.body_height)
    return replace(config, recording=replace(config.recording, origin=origin))


def with_stack(config: Config, stack: str | None) -> Config:
    """Return the config with a stack on trial, which gets one goal: the end of the recording.

    Args:
        config: Config of a recording.
        stack: Name of the stack; None for the built-in one.

    Raises:
        InputError: The stack runs in another process, to which sweeps of lists cannot be sent.
    """
    if stack is None:
        return config
    if stack.partition(":")[0] in REMOTE:
        raise InputError(
            f"--stack {stack}: the interface to other processes has no sweeps that list their "
            "beams, expected a name of 'wayproof list', module:Class or file.py:Class"
        )
    assert config.recording is not None
    recorded = replace(config.recording, goal="end")
    return replace(config, stack=replace(config.stack, name=stack), recording=recorded)


def within_altitudes(config: Config, mission: Mission, settings: Iterable[str]) -> Config:
    """Return the config with the altitudes of the operating area, unless the user gave some."""
    named = {setting.partition("=")[0] for setting in settings}
    own = {"motion.altitude_low": mission.low[2], "motion.altitude_high": mission.high[2]}
    given = [f"{name}={value!r}" for name, value in own.items() if name not in named]
    given.sort(reverse=own["motion.altitude_low"] < config.motion.altitude_high)
    return override(config, given)
