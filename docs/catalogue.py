"""Catalogue of all that has a name, for `wayproof list` and for completion, read from the code."""

from __future__ import annotations

import dataclasses
import inspect
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from docs.docstrings import attributes, description, summary
from wayproof.harness.bench import BENCHES
from wayproof.harness.cli.catalogue import Catalogue, Entry
from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.config_document import FILLED_IN, NAMED, RECORDING, section_of
from wayproof.harness.filters import FILTERS
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.metrics import METRICS
from wayproof.harness.perturbations import NOT_MODES, PERTURBATIONS, AnyPerturbation, Perturbation
from wayproof.harness.recording_config import SET_BY_RUN, RecordingConfig
from wayproof.harness.scenario.robots import EXAMPLES
from wayproof.harness.study.file import PACKAGED
from wayproof.maps import MAPS
from wayproof.models.robots import ROBOTS
from wayproof.models.sensors.devices import DEVICES, Device
from wayproof.models.world_parameters import PLACES
from wayproof.models.worlds import WORLDS
from wayproof.planners import STATE_SPACES
from wayproof.planners.registry import PLANNERS

ROOT = Path(__file__).resolve().parents[1]

NAMES: dict[str, Iterable[str]] = {
    **NAMED,
    "stack.name": [BUILTIN, *STACKS],
    "planner.state_space": ["auto", *STATE_SPACES],
}
"""Names that a setting takes."""

BUILTIN_STACK = "The built-in stack: map, costmap, planner and trajectory."


def catalogue() -> Catalogue:
    """Every entry by kind and name; settings in their order, all else by name."""
    builtin = Entry(BUILTIN_STACK, source="harness/stack/pipeline.py")
    by_name = {
        "worlds": {name: Entry(description(make), _file(make)) for name, make in WORLDS.items()},
        "places": {
            name: Entry(meaning, "models/world_parameters.py") for name, meaning in PLACES.items()
        },
        "robots": {name: _documented(_package_of(one)) for name, one in ROBOTS.items()},
        "robot examples": {path.stem: _commented(path) for path in EXAMPLES.glob("*.toml")},
        "sensors": {name: _device(device) for name, device in DEVICES.items()},
        "maps": {name: _documented(one) for name, one in MAPS.items()},
        "filters": {name: _documented(one) for name, one in FILTERS},
        "planners": {
            name: Entry(one.source, "planners/registry.py") for name, one in PLANNERS.items()
        },
        "stacks": {BUILTIN: builtin} | {name: _documented(one) for name, one in STACKS.items()},
        "perturbations": {name: _perturbation(one) for name, one in PERTURBATIONS.items()},
        "metrics": {
            name: Entry(summary(one.function), _file(one.function), unit=one.unit)
            for name, one in METRICS.items()
        },
        "studies": {path.stem: _commented(path) for path in PACKAGED.glob("*.toml")},
        "benches": {name: _documented(one.measure) for name, one in BENCHES.items()},
    }
    ordered = {kind: dict(sorted(entries.items())) for kind, entries in by_name.items()}
    return {**ordered, "settings": dict(_settings(Config, ""))}


def _documented(thing: Any) -> Entry:
    return Entry(summary(thing), _file(thing))


def _package_of(thing: object) -> object:
    return sys.modules[type(thing).__module__.rpartition(".")[0]]


def _commented(path: Path) -> Entry:
    """A file whose first line is a comment."""
    first = path.read_text().splitlines()[0]
    return Entry(first.removeprefix("# "), str(path.resolve().relative_to(ROOT)))


def _file(thing: Any) -> str:
    return str(Path(inspect.getfile(thing)).resolve().relative_to(ROOT))


def _device(device: Device) -> Entry:
    beams = device.beam_table().beams
    figures = f"{device.kind}, {device.minimum_range:g} to {device.range:g} m, {device.rate:g} Hz"
    return Entry(f"{figures}, {beams} beams.", device.source)


def _perturbation(one: type[Perturbation]) -> Entry:
    fields = [each for each in msgspec.structs.fields(one) if each.name not in NOT_MODES]
    modes = tuple(mode for each in fields for mode in get_args(each.type))
    units = [
        msgspec.convert({"kind": one.__struct_config__.tag, "mode": mode}, one).unit
        for mode in modes
    ]
    unit = ", ".join(dict.fromkeys(units)) or one.measured_in
    return Entry(summary(one), _file(one), unit=unit, choices=modes, amounts=one.values)


def _settings(section: type, prefix: str) -> Iterator[tuple[str, Entry]]:
    """Settings of a section and of the sections in it, the own ones first."""
    hints, meanings = get_type_hints(section, include_extras=True), attributes(section)
    inner = []
    for entry in dataclasses.fields(section):
        name = prefix + entry.name
        if name == RECORDING:
            inner.append((RecordingConfig, f"{name}."))
        elif name.partition(".")[0] == RECORDING and entry.name in SET_BY_RUN:
            continue
        elif name in FILLED_IN:
            continue
        elif isinstance(entry.default_factory, type) and dataclasses.is_dataclass(
            entry.default_factory
        ):
            inner.append((entry.default_factory, f"{prefix}{section_of(entry.name)}."))
        else:
            hint = hints[entry.name]
            yield name, _setting(name, hint, _default(entry), meanings[entry.name], _file(section))
    for part, its_prefix in inner:
        yield from _settings(part, its_prefix)


def _setting(name: str, hint: Any, default: str, meaning: str, source: str) -> Entry:
    if hint == AnyPerturbation | None:
        return Entry(meaning, source, type="perturbation")
    if get_origin(hint) is Literal:
        return Entry(meaning, source, type="str", default=default, choices=get_args(hint))
    choices = tuple(sorted(NAMES.get(name, ())))
    if get_origin(hint) is Annotated:
        kind, bounds = get_args(hint)
        between = (float(bounds.low), float(bounds.high))
        type_name = kind.__name__ if isinstance(kind, type) else str(kind)
        return Entry(meaning, source, type_name, default, bounds.unit, between, choices)
    if hint is bool:
        choices = ("true", "false")
    kind = hint.__name__ if isinstance(hint, type) and not get_args(hint) else str(hint)
    return Entry(meaning, source, type=kind, default=default, choices=choices)


def _default(entry: dataclasses.Field[Any]) -> str:
    """The default as `--set` takes it."""
    if entry.default_factory is not dataclasses.MISSING:
        return json.dumps(entry.default_factory())
    if entry.default is dataclasses.MISSING:
        return ""
    return entry.default if isinstance(entry.default, str) else json.dumps(entry.default)
