"""XML from untrusted files: no document types or entities, bounded depth and size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from wayproof.models.world_files.reading import WorldFileError, read_text

MOST_BYTES = 64 * 2**20
MOST_ELEMENTS = 1_000_000
MOST_ATTRIBUTES = 4_000_000
MOST_DEPTH = 100


@dataclass(slots=True)
class Element:
    """One element.

    Attributes:
        tag: Name of the element.
        attributes: Attributes by name.
        line: Line at which it begins.
        text: Text between its tags and its children's.
        children: Children in order.
        file: Its file, where that is another one than its parent's.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)
    file: Path | None = None

    def all(self, tag: str) -> Iterator[Element]:
        """Yield children of that name."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """Return the first child of that name."""
        return next(self.all(tag), None)

    def text_of(self, *tags: str) -> str:
        """Return the text of the element that tags lead to, stripped; empty without it."""
        found: Element | None = self
        for tag in tags:
            found = None if found is None else found.first(tag)
        return "" if found is None else found.text.strip()


def read_xml(path: Path) -> Element:
    """Parse a file.

    Raises:
        WorldFileError: Naming the line: no XML, a document type, or more elements than allowed.
    """
    return parse_xml(path, read_text(path, MOST_BYTES))


def parse_xml(path: Path, text: str) -> Element:
    """Parse the text of a file; errors as of `read_xml`."""
    text = _without_late_declaration(text)
    if text.count("=") > MOST_ATTRIBUTES:
        raise WorldFileError(path, f"{text.count('=')} '=', expected at most {MOST_ATTRIBUTES}")
    try:
        return _parsed(path, text)
    except expat.ExpatError as error:
        plain = _without_comments(text)  # Gazebo's parser takes two hyphens in a comment
        failed = error
    try:
        return _parsed(path, plain)
    except expat.ExpatError:
        what = f"no XML ({expat.ErrorString(failed.code)})"
        raise WorldFileError(path, what, failed.lineno) from None


def _parsed(path: Path, text: str) -> Element:
    builder = _Builder(path)
    builder.parser.Parse(text, True)
    return builder.root.children[0]


def _without_comments(text: str) -> str:
    """Return text without its comments; their line breaks stay, so that lines keep their number."""
    kept, at = [], 0
    while (start := text.find("<!--", at)) >= 0 and (end := text.find("-->", start + 4)) >= 0:
        kept += [text[at:start], "\n" * text.count("\n", start, end)]
        at = end + 3
    return "".join([*kept, text[at:]])


def _without_late_declaration(text: str) -> str:
    """Return text without a declaration behind blanks or comments: strict parsers refuse one."""
    begin = text.find("<?xml")
    end = text.find("?>", begin)
    if begin <= 0 or end < 0 or _without_comments(text[:begin]).strip():
        return text
    return text[:begin] + text[end + 2 :]


class _Builder:
    """Collector of the elements that expat reports."""

    def __init__(self, path: Path) -> None:
        self.root = Element("", {}, 0)
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._refuse
        self._path = path
        self._open = [self.root]
        self._count = 0

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self._count += 1
        if self._count > MOST_ELEMENTS or len(self._open) > MOST_DEPTH:
            what = f"more than {MOST_ELEMENTS} elements or {MOST_DEPTH} levels"
            raise WorldFileError(self._path, what, line)
        element = Element(tag, attributes, line)
        self._open[-1].children.append(element)
        self._open.append(element)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _text(self, text: str) -> None:
        self._open[-1].text += text

    def _refuse(self, name: str, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        raise WorldFileError(self._path, f"document type '{name}', expected none", line)
