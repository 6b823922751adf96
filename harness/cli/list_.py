"""`wayproof list`: list all names, or explain one."""

from __future__ import annotations

import argparse
import re

from rich.console import Console
from rich.table import Table
from rich.text import Text

from wayproof.harness.cli.catalogue import (
    Catalogue,
    Entry,
    document_of,
    matching,
    read_catalogue,
)
from wayproof.harness.cli.verb import Document, Verb, arg
from wayproof.harness.errors import InputError, near_name


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Print the names of each kind, or the entries of one name."""
    catalogue = read_catalogue()
    if options.name is None:
        for kind, entries in catalogue.items():
            console.print(Text.assemble((kind, "bold"), f": {', '.join(entries)}"))
        console.print("'wayproof list NAME' says what a name means, 'list map' a whole section.")
        return 0, document_of(catalogue)
    found = matching(catalogue, options.name)
    if not found:
        names = {name for entries in catalogue.values() for name in entries}
        near = near_name(options.name, {*catalogue, *names})
        hint = f"; did you mean '{near}'?" if near else ""
        raise InputError(f"unknown name '{options.name}'{hint} ('wayproof list' shows all names)")
    shown = [entry for entries in found.values() for entry in entries.values()]
    if len(shown) == 1:
        _print_entry(console, found)
    else:
        for kind, entries in found.items():
            console.print(_table(kind, entries))
    return 0, document_of(found)


def _print_entry(console: Console, found: Catalogue) -> None:
    for kind, entries in found.items():
        for name, entry in entries.items():
            console.print(Text.assemble((name, "bold"), f" ({kind})"))
            for label, text in _facts(entry).items():
                console.print(Text(f"  {label + ':':9}{text}"))


def _facts(entry: Entry) -> dict[str, str]:
    """Describe an entry in words, by label."""
    bounds = f"{entry.bounds[0]:g} to {entry.bounds[1]:g}" if entry.bounds else ""
    amounts = ", ".join(f"{one:g}" for one in entry.amounts)
    facts = {
        "meaning": entry.meaning,
        "type": entry.type,
        "default": entry.default,
        "unit": entry.unit,
        "bounds": bounds,
        "choices": ", ".join(entry.choices),
        "amounts": f"{amounts} at severities 1 to 5" if amounts else "",
        "source": entry.source,
    }
    return {label: text for label, text in facts.items() if text}


def _table(kind: str, entries: dict[str, Entry]) -> Table:
    """Return one row for each entry, with the first sentence of its meaning."""
    table = Table(title=kind, title_justify="left")
    settings = kind == "settings"
    for label in ("name", "default", "values") if settings else ("name",):
        table.add_column(label, overflow="fold")
    table.add_column("meaning", ratio=1)
    for name, entry in entries.items():
        about = (Text(entry.default), Text(values_of(entry))) if settings else ()
        table.add_row(name, *about, Text(_first_sentence(entry.meaning)))
    return table


def values_of(entry: Entry) -> str:
    """Say which values a setting takes: its choices, its bounds and unit, or its type."""
    if entry.choices:
        return ", ".join(entry.choices)
    if entry.bounds:
        return f"{entry.bounds[0]:g} to {entry.bounds[1]:g} {entry.unit}".rstrip()
    return entry.type


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=\.) (?=[A-Z`])", text, maxsplit=1)[0]


VERB = Verb(
    help="list worlds, robots, settings, metrics, studies and all else by name, with its meaning",
    add_arguments=arg(
        "NAME",
        "name, kind such as worlds, or section of settings such as map (default: all names)",
        nargs="?",
    ),
    run=run,
    example="wayproof list map.resolution",
)
