"""The blocks of a page: what a reader types, and what the page says that comes of it.

| block | is |
|---|---|
| `sh`, `sh exit=1` | commands, typed whole; the last one ends with that exit code |
| `console` | commands after a `$`; the tests type them on a small scale |
| `text` | lines that the commands before it print |
| `python` | run; the blocks of a page share their names |
| `toml`, `json`, `xml`, `yaml` | a file, by `file=NAME` one that later commands of the page read |
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
    """One block.

    Attributes:
        kind: One of `KINDS`.
        options: What its first line says besides, `exit=1` as `{"exit": "1"}`.
        text: What it holds.
    """

    kind: str
    options: dict[str, str]
    text: str


def blocks(page: str) -> list[Block]:
    """All blocks of a page, in order.

    Raises:
        ValueError: One is of no known kind, or set off by an indent alone.
    """
    prose = FENCED.sub("\n", page)
    if stray := STRAY.search(prose):
        line = prose[stray.start() :].strip().splitlines()[0]
        raise ValueError(f"'{line}': expected blocks between ``` at the line's begin")
    return [_block(info, text) for info, text in FENCED.findall(page)]


def _block(info: str, text: str) -> Block:
    kind, *options = info.split() or [""]
    if kind not in KINDS:
        raise ValueError(f"a block of kind '{kind}', expected one of {', '.join(KINDS)}: {text}")
    return Block(kind, dict(option.split("=", 1) for option in options), text)


def commands(block: Block) -> list[str]:
    """What a block types, command by command; a file that is typed (`cat > ...`) is one."""
    text = block.text
    if block.kind == "console":
        text = re.sub(r"^\$ ", "", text, flags=re.MULTILINE)
    typed = []
    for part in HERE.split(text):
        typed += [part] if HERE.match(part) else part.replace("\\\n", " ").splitlines()
    return [command for command in typed if command.strip()]
