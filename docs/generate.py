"""Write `docs/reference/` and the catalogue of `wayproof list` from the code.

Usage: python -m docs.generate
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import pyarrow as pa

from docs.architecture import drawing
from docs.catalogue import catalogue
from docs.docstrings import attributes, summary
from wayproof.harness.cli import COMMANDS
from wayproof.harness.cli.catalogue import FILE as CATALOGUE
from wayproof.harness.cli.catalogue import encode
from wayproof.harness.cli.main import parser_of
from wayproof.harness.config import Config
from wayproof.harness.config_document import RECORDING, section_of
from wayproof.harness.metrics import METRICS
from wayproof.harness.perturbations import NOT_MODES, PERTURBATIONS
from wayproof.harness.recording_config import SET_BY_RUN, RecordingConfig
from wayproof.harness.statistics.support import Support
from wayproof.harness.tables.tables import TABLES

FOLDER = Path(__file__).parent / "reference"

NOTE = "Generated from the code by `python -m docs.generate`; a test compares the two."

EXIT_CODES = [
    "| exit code | meaning |",
    "|---|---|",
    "| 0 | goal reached, replay identical, log verified, no violation, every gate held |",
    "| 1 | not so; `study` of kind `falsify`: a failure was found |",
    "| 2 | bad input, reported in one line on stderr; nothing was run |",
    "| 3 | a study is incomplete, or too small to decide a gate |",
    "| 130 | Ctrl-C; the last line says what is kept |",
    "",
    "`--json` prints one JSON document on stdout and nothing else. `NO_COLOR=1` turns colours off; "
    "a pipe gets none. `python -m wayproof` is the same as `wayproof`. For completion in bash or "
    'zsh: `eval "$(wayproof --completion bash)"`; in fish: `wayproof --completion fish | source`.',
]
"""What holds for all verbs."""


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    return {
        "cli.md": cli(),
        "config.md": config(),
        "data.md": data(),
        "../architecture.svg": drawing(),
    }


def cli() -> str:
    """Each verb with its arguments, and the exit codes."""
    lines = ["# Command line", "", "Every verb of `wayproof` with its arguments and exit codes."]
    lines += ["", NOTE, "", "| verb | does |", "|---|---|"]
    lines += [
        f"| [`{name}`](#{name.replace(' ', '-')}) | {cell(verb.help)} |"
        for name, verb in COMMANDS.items()
    ]
    lines += ["", *EXIT_CODES, "", "## Shared arguments", ""]
    of_verb = {name: list(map(_argument, _arguments(parser_of(name)))) for name in COMMANDS}
    count = Counter(row for rows in of_verb.values() for row in rows)
    shared = [row for row in count if count[row] > 1]
    lines += ["| argument | meaning |", "|---|---|", *shared]
    for name, verb in COMMANDS.items():
        lines += ["", f"## {name}", "", *_typed(verb.example), ""]
        if own := [row for row in of_verb[name] if row not in shared]:
            lines += ["| argument | meaning |", "|---|---|", *own, ""]
        if others := [f"{row.split()[1].rstrip('`')}`" for row in of_verb[name] if row in shared]:
            lines += [f"Shared: {', '.join(others)}."]
    return "\n".join(lines).rstrip() + "\n"


def config() -> str:
    """Each setting with its default, and each perturbation."""
    lines = ["# Settings", "", "Every setting with its default and bounds.", "", NOTE, ""]
    lines += [
        "Set one by `--set NAME=VALUE`, in a study under `[set]` or `[axes]`. `wayproof list NAME` "
        "prints more: reasons and sources. A log holds all settings, resolved."
    ]
    set_two = "--set map.resolution=0.2 --set planner.name=rrtconnect"
    lines += ["", *_typed(f"wayproof run empty --robot drone --seed 1 {set_two}")]
    lines += ["", "## The episode", "", *_settings(Config, ""), *_sections(Config)]
    lines += ["", f"## {RECORDING}", "", "Settings of `wayproof shadow` alone.", ""]
    lines += _settings(RecordingConfig, f"{RECORDING}.", apart=SET_BY_RUN)
    lines += [
        "",
        "## Perturbations",
        "",
        "`--perturb KIND:SEVERITY[:MODE]`, severity 1 to 5, fractions allowed; one per episode. "
        "[Perturbations](../perturbations.md) has the amount of each severity.",
    ]
    lines += ["", "| kind | modes | meaning |", "|---|---|---|"]
    for kind, one in PERTURBATIONS.items():
        fields = [each for each in msgspec.structs.fields(one) if each.name not in NOT_MODES]
        modes = ", ".join(f"`{mode}`" for each in fields for mode in get_args(each.type))
        lines.append(f"| `{kind}` | {cell(modes)} | {cell(summary(one))} |")
    return "\n".join(lines) + "\n"


def data() -> str:
    """Metrics, columns of the tables of a log, and dependencies."""
    lines = ["# Data", "", "Metrics of an episode, columns of its tables, and dependencies.", ""]
    lines += [NOTE, "", "## Metrics", ""]
    lines += ["Each is computed from the log alone; gates of a study name them. The support", ""]
    lines[-2] += " decides the interval of the mean."
    lines += _typed("wayproof explain logs/empty-drone-1.mcap --metrics")
    better = {True: "higher", False: "lower", None: ""}
    lines += ["", "| metric | unit | better | support | meaning |", "|---|---|---|---|---|"]
    for name, metric in METRICS.items():
        meaning = cell(summary(metric.function))
        side, support = better[metric.higher_is_better], _support(metric.support)
        lines.append(f"| `{name}` | {metric.unit} | {side} | {support} | {meaning} |")
    lines += ["", "## Tables", ""]
    lines += _typed("wayproof export logs/empty-drone-1.mcap --parquet decisions.parquet")
    for name, table in TABLES.items():
        lines += ["", f"### {name}", "", "| column | type | meaning |", "|---|---|---|"]
        lines += [
            f"| `{one.name}` | {_arrow(one.type)} | {cell(one.meaning)}"
            f"{f', {one.unit}' if one.unit else ''} |"
            for one in table.columns
        ]
    return "\n".join([*lines, "", *dependencies()]) + "\n"


def dependencies() -> list[str]:
    """Packages of `pyproject.toml`, and what the comment beside each says that it is for."""
    text = (FOLDER.parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    required, optional = text.split("[project.scripts]")[0].split("[project.optional-dependencies]")
    lines = ["## Dependencies", "", "| required | for |", "|---|---|"]
    lines += [
        f"| {name} | {use} |" for name, use in re.findall(r'"([\w-]+)>=.*",\s*# (.*)', required)
    ]
    lines += ["", "| extra | packages | for |", "|---|---|---|"]
    for extra, packages, use in re.findall(r"^(\w+) = \[(.*)\]\s*# (.*)$", optional, re.MULTILINE):
        names = ", ".join(re.findall(r'"([\w-]+)>=', packages))
        lines.append(f"| `{extra}` | {names} | {use} |")
    return lines


def _arrow(kind: pa.DataType) -> str:
    """Return the name of an Arrow type; points are lists of three numbers."""
    return str(kind).replace("element: ", "").replace("item: ", "")


def _support(support: Support) -> str:
    """The kind and bounds of a support, in words."""
    high = "the time limit" if support.timed else f"{support.high:g}"
    ends = f"{support.low:g} to {high}" if support.timed or support.high < math.inf else "0 or more"
    return f"{support.kind}, {ends}"


def _typed(command: str) -> list[str]:
    return ["```console", f"$ {command}", "```"]


def _arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    left_out = {"help", "json"}
    return [action for action in parser._actions if action.dest not in left_out]


def _argument(action: argparse.Action) -> str:
    metavar = action.metavar if isinstance(action.metavar, str) else None
    value = metavar or "|".join(map(str, action.choices or ())) or action.dest.upper()
    takes = "" if action.nargs == 0 else f" {value}"
    name = f"{action.option_strings[-1]}{takes}" if action.option_strings else value
    needed = "; required" if action.option_strings and action.required else ""
    return f"| `{cell(name)}` | {cell(action.help or '')}{needed} |"


def _sections(parent: type, prefix: str = "") -> list[str]:
    """A heading and a table for each section nested in a dataclass."""
    lines = []
    for entry in dataclasses.fields(parent):
        section = entry.default_factory
        if isinstance(section, type) and dataclasses.is_dataclass(section):
            name = f"{prefix}{section_of(entry.name)}"
            lines += ["", f"## {name}", "", summary(section), ""]
            lines += [*_settings(section, f"{name}."), *_sections(section, f"{name}.")]
    return lines


def _settings(section: type, prefix: str, apart: Sequence[str] = (RECORDING,)) -> list[str]:
    """A table of the own settings of a section, without those that stand apart."""
    descriptions, hints = attributes(section), get_type_hints(section, include_extras=True)
    rows = ["| setting | value | meaning |", "|---|---|---|"]
    for entry in dataclasses.fields(section):
        if dataclasses.is_dataclass(entry.default_factory) or entry.name in apart:
            continue  # a section of its own
        value = f"{_default(entry)}{_range(hints[entry.name])}"
        meaning = first_sentence(descriptions[entry.name])
        rows.append(f"| `{prefix}{entry.name}` | {cell(value)} | {cell(meaning)} |")
    return rows


def _range(hint: Any) -> str:
    """The values beside the default: other choices, or bounds with their unit."""
    if get_origin(hint) is Literal:
        return f"; {', '.join(f'`{choice}`' for choice in get_args(hint))}"
    if get_origin(hint) is not Annotated:
        return ""
    bounds = get_args(hint)[1]
    return f"; {bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()


def _default(entry: dataclasses.Field[Any]) -> str:
    if entry.default_factory is not dataclasses.MISSING:
        return f"`{entry.default_factory()}`"
    if entry.default is dataclasses.MISSING:
        return "required"
    return f"`{entry.default}`"


def first_sentence(text: str) -> str:
    """The text up to its first full stop before a capital letter."""
    return re.split(r"(?<=[^.]\.) (?=[A-Z0-9`])", text)[0]


def cell(text: str) -> str:
    """The text, escaped for a cell of a table."""
    return text.replace("|", r"\|")


def main() -> None:
    """Write every page."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    CATALOGUE.write_bytes(encode(catalogue()))


if __name__ == "__main__":
    main()
