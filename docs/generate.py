"""Write `docs/reference/` from the code: verbs and their options, settings, metrics.

Usage: python -m docs.generate
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from wayproof.harness.cli import VERBS
from wayproof.harness.cli.main import verb_parsers
from wayproof.harness.config import Config
from wayproof.harness.metrics import METRICS
from wayproof.harness.perturbations import PERTURBATIONS, WITHIN
from wayproof.harness.study.statistics.support import Support

FOLDER = Path(__file__).parent / "reference"

MACHINE = {"jobs"}
"""Options whose defaults follow from the machine."""

NOTE = "Written from the code by `python -m docs.generate`; a test holds it against the code."


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    return {"cli.md": cli(), "config.md": config(), "metrics.md": metrics()}


def cli() -> str:
    """Each verb with its arguments."""
    lines = ["# The command line", "", NOTE, "", "Every verb takes `--json`: one JSON document on "]
    lines[-1] += "stdout and nothing else. Exit codes: 0 as hoped, 1 not so, 2 bad input, told in "
    lines[-1] += "one line on stderr, 3 for a study that is incomplete or decides no gate. "
    lines[-1] += "`NO_COLOR=1` turns colours off; a pipe gets none."
    lines += ["", "| verb | does |", "|---|---|"]
    lines += [f"| [`{name}`](#{name}) | {cell(verb.help)} |" for name, verb in VERBS.items()]
    for name, parser in verb_parsers().items():
        lines += ["", f"## {name}", "", sentence(VERBS[name].help), ""]
        lines += [*_typed(VERBS[name].example), ""]
        lines += ["| argument | default | is |", "|---|---|---|"]
        lines += [_argument(action) for action in _arguments(parser)]
        if lines[-1].startswith("|---"):
            lines[-2:] = ["It takes no arguments."]
    return "\n".join(lines) + "\n"


def config() -> str:
    """Each setting with its default, and each perturbation."""
    lines = [
        "# Settings",
        "",
        NOTE,
        "",
        "Any of them by `--set NAME=VALUE`, in a study's `[axes]` ",
    ]
    lines[-1] += "and in the `config.json` of a log, which holds all of them, resolved."
    set_two = "--set map.resolution=0.2 --set planner.name=rrtconnect"
    lines += ["", *_typed(f"wayproof run empty --robot drone --seed 1 {set_two}")]
    lines += ["", "## The episode", "", *_settings(Config, ""), *_sections(Config)]
    lines += [
        "",
        "## Perturbations",
        "",
        "By `--perturb KIND:SEVERITY[:MODE]`, severity 1 to 5 or between; ",
    ]
    lines[-1] += "an episode has one or none. What each severity is stands in "
    lines[-1] += "[perturbations](../perturbations.md)."
    lines += ["", "| kind | modes | is |", "|---|---|---|"]
    for kind, one in PERTURBATIONS.items():
        fields = [each for each in msgspec.structs.fields(one) if each.name not in WITHIN]
        modes = ", ".join(f"`{mode}`" for each in fields for mode in get_args(each.type))
        lines.append(f"| `{kind}` | {cell(modes)} | {cell(summary(one))} |")
    return "\n".join(lines) + "\n"


def metrics() -> str:
    """Each metric of an episode with its unit."""
    better = {True: "higher", False: "lower", None: ""}
    lines = [
        "# Metrics",
        "",
        NOTE,
        "",
        "`wayproof score LOG` works them out from the log alone; a ",
    ]
    lines[-1] += "study's gates name them."
    lines += ["", *_typed("wayproof score logs/empty-drone-1.mcap")]
    lines += ["", "The support is that of the [intervals](../statistics.md) of its mean."]
    lines += ["", "| metric | unit | better | support | is |", "|---|---|---|---|---|"]
    for name, metric in METRICS.items():
        told = cell(summary(metric.function))
        side = better[metric.higher_is_better]
        lines.append(f"| `{name}` | {metric.unit} | {side} | {_support(metric.support)} | {told} |")
    return "\n".join(lines) + "\n"


def _support(support: Support) -> str:
    """Kind and ends, in words."""
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
    shown = action.default
    if action.dest in MACHINE or shown in (None, False) or shown == []:
        shown = "required" if action.option_strings and action.required else ""
    return f"| `{cell(name)}` | {shown} | {cell(action.help or '')} |"


def _sections(parent: type, prefix: str = "") -> list[str]:
    """A heading and a table for each section nested in a dataclass."""
    lines = []
    for entry in dataclasses.fields(parent):
        section = entry.default_factory
        if isinstance(section, type) and dataclasses.is_dataclass(section):
            name = f"{prefix}{entry.name}"
            lines += ["", f"## {name}", "", summary(section), ""]
            lines += [*_settings(section, f"{name}."), *_sections(section, f"{name}.")]
    return lines


def _settings(section: type, prefix: str) -> list[str]:
    descriptions, hints = attributes(section), get_type_hints(section, include_extras=True)
    rows = ["| setting | type | default | is |", "|---|---|---|---|"]
    for entry in dataclasses.fields(section):
        if dataclasses.is_dataclass(entry.default_factory):
            continue  # a section of its own
        kind, described = cell(_type_name(hints[entry.name])), cell(descriptions[entry.name])
        rows.append(f"| `{prefix}{entry.name}` | {kind} | {_default(entry)} | {described} |")
    return rows


def _type_name(hint: Any) -> str:
    """A field's type: its choices, or its name with the bounds of its values."""
    if get_origin(hint) is Literal:
        return ", ".join(f"`{choice}`" for choice in get_args(hint))
    if get_origin(hint) is not Annotated:
        return f"`{hint.__name__ if isinstance(hint, type) and not get_args(hint) else hint}`"
    kind, bounds = get_args(hint)
    return f"`{kind.__name__}`, {bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()


def _default(entry: dataclasses.Field[Any]) -> str:
    if entry.default_factory is not dataclasses.MISSING:
        return f"`{entry.default_factory()}`"
    if entry.default is dataclasses.MISSING:
        return "required"
    return f"`{entry.default}`"


def attributes(section: type) -> dict[str, str]:
    """What a class's docstring says of each attribute, each as one line."""
    _, _, block = inspect.cleandoc(section.__doc__ or "").partition("Attributes:\n")
    found: dict[str, str] = {}
    name = ""
    for line in block.splitlines():
        opened = re.match(r" {4}(\w+): (.*)", line)
        if opened:
            name = opened[1]
            found[name] = opened[2]
        elif line.startswith(" " * 8):
            found[name] += f" {line.strip()}"
        elif line.strip():
            break  # the next section
    return {name: re.sub(r"``(.+?)``", r"`\1`", text) for name, text in found.items()}


def summary(thing: object) -> str:
    """The first paragraph of a docstring, as one line."""
    return " ".join(inspect.cleandoc(thing.__doc__ or "").split("\n\n")[0].split())


def sentence(text: str) -> str:
    """With a capital and a full stop."""
    return f"{text[0].upper()}{text[1:]}."


def cell(text: str) -> str:
    """Fit for a table."""
    return text.replace("|", r"\|")


def main() -> None:
    """Write every page."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
