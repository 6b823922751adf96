"""Table of all field numbers that the schema of logs ever had.

`python -m tests.tools.field_numbers` adds new ones.

A number keeps its name and type for good: readers of logs rely on it. A field that is no longer
written stays in the table, so that its number is not reused.
"""

from __future__ import annotations

import json
from pathlib import Path

from google.protobuf.descriptor import Descriptor, FieldDescriptor

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb

TABLE = Path(__file__).resolve().parents[2] / "harness" / "schema" / "field_numbers.json"

Numbers = dict[str, dict[str, str]]
"""Message -> number -> name and type."""


def current() -> Numbers:
    """Return the numbers in the schema."""
    messages: dict[str, Descriptor] = dict(pb.DESCRIPTOR.message_types_by_name)
    return {
        name: {str(field.number): _text(field) for field in message.fields}
        for name, message in sorted(messages.items())
    }


def committed() -> Numbers:
    """Return the numbers in the table."""
    table: Numbers = json.loads(TABLE.read_text())
    return table


def changed(table: Numbers, now: Numbers) -> list[str]:
    """Return descriptions of the numbers whose meaning differs from the table."""
    found = []
    for message, fields in table.items():
        for number, meaning in fields.items():
            new = now.get(message, {}).get(number, meaning)
            if new != meaning:
                found.append(f"{message} {number}: was '{meaning}', is '{new}'")
    return found


def added(table: Numbers, now: Numbers) -> list[str]:
    """Return descriptions of the numbers that the table lacks."""
    return [
        f"{message} {number}: {meaning}"
        for message, fields in now.items()
        for number, meaning in fields.items()
        if number not in table.get(message, {})
    ]


def add() -> list[str]:
    """Add new numbers to the table."""
    table = committed() if TABLE.exists() else {}
    now = current()
    if wrong := changed(table, now):
        raise InputError(f"field numbers: {'; '.join(wrong)}")
    new = added(table, now)
    for message, fields in now.items():
        merged = {**table.get(message, {}), **fields}
        table[message] = dict(sorted(merged.items(), key=lambda one: int(one[0])))
    TABLE.write_text(json.dumps(dict(sorted(table.items())), indent=1) + "\n")
    return new


def _text(field: FieldDescriptor) -> str:
    kind = field.message_type.full_name if field.message_type else TYPES[field.type]
    return f"{'repeated ' if field.is_repeated else ''}{kind} {field.name}"


TYPES = {
    getattr(FieldDescriptor, name): name.removeprefix("TYPE_").lower()
    for name in dir(FieldDescriptor)
    if name.startswith("TYPE_")
}


if __name__ == "__main__":
    print("\n".join(add()) or "nothing new")
