"""Settings as a document: read, write, override by name; see `config`."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from wayproof.harness.config import PLUGIN, Config
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.filters import NAMES as FILTER_NAMES
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.prediction_config import PredictionConfig
from wayproof.harness.prior_config import NO_PRIOR, PriorConfig
from wayproof.harness.recording_config import SET_BY_RUN, RecordingConfig
from wayproof.maps import MAPS
from wayproof.models.sensors.devices import DEVICES, OWN
from wayproof.planners import PLANNERS

NAMED: dict[str, Iterable[str]] = {
    "map.kind": MAPS,
    "map.filters": FILTER_NAMES,
    "planner.name": PLANNERS,
    "sensors.lidar": (OWN, *DEVICES),
    "sensors.depth": (OWN, *DEVICES),
}
"""Settings whose values are names in a registry, or lists of such names."""

LEFT_OPEN = ("start", "goal", "waypoints", "sensors", "motion.limits")
"""Settings that a scenario resolves from its world and robot."""

RECORDING = "recording"
"""Section of the settings that only a recording has."""

FILLED_IN = ("prior_map", "robot_file", RECORDING)
"""Fields that only a run sets."""

NUMBERS = ("int", "float")
"""Types of settings that are numbers; a bool is none."""

FOR_STACKS = (
    "sensors", "estimate", "map", "costmap", "planner", "prior", "prior_map", "prediction",
    "motion", "behaviour", "latency", "episode", "recording",
)  # fmt: skip
"""Settings that a stack on trial is sent: none tells the world, its seed or what is off in it."""


def override(config: Config, settings: Iterable[str]) -> Config:
    """Apply `section.field=value` settings, each checked for its name and its type.

    Raises:
        InputError: A setting has no '=', an unknown name, a wrong type or a refused value.
    """
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise InputError(f"--set {setting}: expected section.field=value")
        document = msgspec.to_builtins(config)
        section, name = _locate(document, key)
        before = value_of(config, key)
        section[name] = value = _parse(text)
        if isinstance(value, str) and type(before).__name__ in NUMBERS:
            number = "a whole number" if isinstance(before, int) else "a finite number"
            raise InputError(f"--set {setting}: expected {number}, such as {before}")
        if key == "map.filters" and isinstance(value, str):
            section[name] = value = value.split(",")
        _check_names(key, value)
        try:
            config = from_document(document)
        except InputError as error:
            raise InputError(f"--set {setting}: {error}") from None
    return config


def with_perturbation(config: Config, perturbation: AnyPerturbation | None) -> Config:
    """Return a config with a perturbation in place of its own.

    Raises:
        InputError: It acts on what the config does not have.
    """
    try:
        return dataclasses.replace(config, perturbation=perturbation)
    except ValueError as error:
        kind = "none" if perturbation is None else perturbation.kind
        raise InputError(f"perturbation '{kind}': {error}") from None


def left_open(config: Config) -> dict[str, str]:
    """Return the settings that a scenario resolves as they were asked for, name -> JSON."""
    return {name: msgspec.json.encode(value_of(config, name)).decode() for name in LEFT_OPEN}


def as_asked(config: Config, asked: Mapping[str, str]) -> Config:
    """Return a resolved config with what `left_open` returned of the one that was asked for.

    Raises:
        InputError: It is no such thing.
    """
    document = msgspec.to_builtins(config)
    for name in LEFT_OPEN:
        section, _, field = name.rpartition(".")
        try:
            (document[section] if section else document)[field] = msgspec.json.decode(
                asked.get(name, "")
            )
        except msgspec.DecodeError as error:
            raise InputError(f"{name} as it was asked for: {error}") from None
    return from_document(document)


def value_of(config: Config, key: str) -> Any:
    """Return the value of a `section.field`."""
    return functools.reduce(getattr, _fields_of(key), config)


def section_of(field_name: str) -> str:
    """Return the settings in a field of the config: of `world` those of the world by its name.

    Args:
        field_name: Name of a field of `Config`.
    """
    return "world" if field_name == "world_parameters" else field_name


def _fields_of(key: str) -> list[str]:
    """Return names of the fields of a setting, from `Config` down."""
    section, *names = key.split(".")
    return ["world_parameters" if section == "world" and names else section, *names]


def from_document(document: Any) -> Config:
    """Build the config from plain JSON values.

    Raises:
        InputError: Naming the field, what was got and what was expected.
    """
    try:
        return msgspec.convert(document, Config)
    except msgspec.ValidationError as error:
        raise InputError(_one_line(error)) from None


def _section(document: Any, name: str) -> dict[str, Any]:
    """Return a section of settings; an empty one of its own if the document has none."""
    section = document.get(name) if isinstance(document, dict) else None
    return section if isinstance(section, dict) else {}


def document_of(config: Config) -> dict[str, Any]:
    """Return the resolved config as plain JSON values.

    Waypoints, a prior map and predictions are left out where there are none.
    """
    document: dict[str, Any] = msgspec.to_builtins(config)
    left_out = {
        "waypoints": not config.waypoints,
        "prior": config.prior == PriorConfig(),
        "prior_map": not config.prior_map,
        "prediction": config.prediction == PredictionConfig(),
    }
    return {name: value for name, value in document.items() if not left_out.get(name, False)}


def to_json(config: Config) -> bytes:
    """Return the resolved config as JSON, fields in their declared order; see `document_of`."""
    document = document_of(config)
    return msgspec.json.format(msgspec.json.encode(document), indent=1)


def settings_for_stacks(config: Config) -> str:
    """Return the settings of `FOR_STACKS` as JSON, without the names of files behind them."""
    if config.prior.source != NO_PRIOR:
        config = dataclasses.replace(config, prior=dataclasses.replace(config.prior, source="sent"))
    if config.recording is not None:
        unnamed = dataclasses.replace(config.recording, format="", sha256="", options=())
        config = dataclasses.replace(config, recording=unnamed)
    document = document_of(config)
    sent = {name: document[name] for name in FOR_STACKS if name in document}
    return msgspec.json.encode(sent).decode()


def from_json(data: bytes, allow_plugins: bool = False) -> Config:
    """Read back what `to_json` wrote; floats come back bit by bit.

    Args:
        data: The text.
        allow_plugins: Whether a planner or a robot's controller named `module:Class` may be
            imported: whoever wrote the text then chooses code that is run here.

    Raises:
        InputError: The text is no JSON or no config, or names a plugin that is not allowed.
    """
    try:
        document = msgspec.json.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"config: {error}") from None
    name = _section(document, "planner").get("name")
    if not allow_plugins and isinstance(name, str) and PLUGIN in name:
        raise InputError(
            f"config names the planner '{name}', which is code outside Wayproof; "
            "expected --allow-plugins to load it"
        )
    config = from_document(document)
    _check_controller(config, allow_plugins)
    _check_registered(config)
    return config


def _check_registered(config: Config) -> None:
    """Raise an InputError unless every name of `NAMED` is in its registry."""
    for key in NAMED:
        _check_names(key, value_of(config, key))


def _check_names(key: str, value: Any) -> None:
    """Raise an InputError if a setting of `NAMED` names what its registry does not have."""
    names = value if isinstance(value, list | tuple) else () if value is None else (str(value),)
    for name in names:
        plugin = key == "planner.name" and PLUGIN in str(name)
        if key in NAMED and name not in NAMED[key] and not plugin:
            raise unknown_name(key, str(name), NAMED[key])


def _check_controller(config: Config, allow_plugins: bool) -> None:
    """Raise an InputError if the robot's file names a controller that may not be imported."""
    if not config.robot_file:
        return
    from wayproof.models.robots.custom import RobotSpecError, parse_spec  # it loads the simulator

    try:
        name = parse_spec(config.robot_file).controller
    except RobotSpecError as error:
        raise InputError(f"config: robot_file: {error}") from None
    if PLUGIN in name and not allow_plugins:
        raise InputError(
            f"config names the controller '{name}', which is code outside Wayproof; "
            "expected --allow-plugins to load it"
        )


def setting_names() -> list[str]:
    """Return every `section.field` that `--set` accepts of a simulated episode."""
    return [name for name in _names_in(Config) if name not in FILLED_IN]


def recording_setting_names() -> list[str]:
    """Return every `recording.field` that `--set` accepts of a recording."""
    names = _names_in(RecordingConfig, f"{RECORDING}.")
    return [name for name in names if name.partition(".")[2] not in SET_BY_RUN]


def _names_in(section: Any, prefix: str = "") -> list[str]:
    """Return the dotted names of a dataclass's fields, those of nested sections with them."""
    names = []
    for entry in dataclasses.fields(section):
        inner = entry.default_factory
        if dataclasses.is_dataclass(inner):
            names += _names_in(inner, f"{prefix}{section_of(entry.name)}.")
        else:
            names.append(prefix + entry.name)
    return names


def _locate(document: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """Return the section of a document that holds a setting, and the setting's name in it."""
    names = setting_names()
    if document.get(RECORDING) is not None:
        names += recording_setting_names()
    elif key in recording_setting_names():
        raise InputError(f"setting {key}: of a recording, as 'wayproof shadow' takes it")
    if key not in names:
        siblings: list[str] = []
        section = key
        while "." in section and not siblings:
            section = section.rpartition(".")[0]
            siblings = [name for name in names if name.startswith(f"{section}.")]
        raise unknown_name("setting", key, siblings or names)
    *path, name = _fields_of(key)
    for part in path:
        document = document[part]
    return document, name


def _parse(text: str) -> Any:
    """Parse a text as JSON; return the text itself where it is none."""
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        return text


def _refuse_constant(name: str) -> Any:
    raise ValueError(name)  # NaN and infinities stay text, which no number field takes


def _one_line(error: msgspec.ValidationError) -> str:
    """Turn msgspec's `Expected ... - at `$.a.b`` around: the field comes first."""
    message, _, place = str(error).partition(" - at `$")
    field_name = place.rstrip("`").lstrip(".").replace("world_parameters.", "world.")
    if not field_name or message.startswith(field_name):
        return message
    text = message[0].lower() + message[1:]
    return text if field_name in text else f"{field_name}: {text}"
