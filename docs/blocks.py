"""The fenced blocks of a page: commands, their output, code and files.

| block | content |
|---|---|
| `sh`, `sh exit=1` | commands, run in full; the last one exits with that code |
| `console` | commands after a `$`; the tests run them on a small scale |
| `text` | lines printed by the commands before it |
| `python` | code; the blocks of a page share a namespace |
| `toml`, `json`, `xml`, `yaml` | a file; with `file=NAME`, one for later commands of the page |
"""

from __future__ import annotations

import re
from dataclasses import dataclass

KINDS = ("sh", "console", "text", "python", "toml", "json", "xml", "yaml")

FENCED = re.compile(r"^```([^\n]*)\n(.*?)^```[ \t]*$\n?", re.MULTILINE | re.DOTALL)
HERE = re.compile(r"^(cat > \S+ <<'END'\n.*?^END\n)", re.MULTILINE | re.DOTALL)
STRAY = re.compile(r"^ +```|(?<=\n\n) {4,}\S", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        kind: One of `KINDS`.
        options: Options on its first line, `exit=1` as `{"exit": "1"}`.
        text: Lines between the fences.
    """

    kind: str
    options: dict[str, str]
    text: str


def blocks(page: str) -> list[Block]:
    """All blocks of a page, in order.

    Raises:
        ValueError: A block has an unknown kind, or is only indented.
    """
    prose = FENCED.sub("\n", page)
    if stray := STRAY.search(prose):
        line = prose[stray.start() :].strip().splitlines()[0]
        raise ValueError(f"'{line}': expected blocks between ``` at the start of a line")
    return [_block(info, text) for info, text in FENCED.findall(page)]


def _block(info: str, text: str) -> Block:
    kind, *options = info.split() or [""]
    if kind not in KINDS:
        raise ValueError(f"a block of kind '{kind}', expected one of {', '.join(KINDS)}: {text}")
    return Block(kind, dict(option.split("=", 1) for option in options), text)


def commands(block: Block) -> list[str]:
    """The commands of a block; a file written by `cat > ...` is one command."""
    text = block.text
    if block.kind == "console":
        text = re.sub(r"^\$ ", "", text, flags=re.MULTILINE)
    typed = []
    for part in HERE.split(text):
        typed += [part] if HERE.match(part) else part.replace("\\\n", " ").splitlines()
    return [command for command in typed if command.strip()]
