"""Fields of MCAP records, read without going beyond the end of any."""

from __future__ import annotations

import zstandard


class Broken(Exception):
    """A fault of the current record; the walk over the file adds its place."""


class Cursor:
    """Reader of the fields of one record.

    Each of its methods raises `Broken` where a field is longer than what is left.
    """

    def __init__(self, data: bytes, begin: int = 0, end: int | None = None) -> None:
        """Start at the begin of a stretch of data; by default of all of it."""
        self._data = data
        self._place = begin
        self._end = len(data) if end is None else end

    @property
    def left(self) -> int:
        """Number of bytes left."""
        return self._end - self._place

    def skip(self, count: int) -> int:
        """Pass over some bytes, and return where they begin."""
        begin = self._place
        if begin + count > self._end:
            raise Broken(f"a field of {count} bytes in a record with {self.left} left")
        self._place = begin + count
        return begin

    def take(self, count: int) -> bytes:
        """Read some bytes."""
        begin = self.skip(count)
        return self._data[begin : begin + count]

    def part(self, count: int) -> Cursor:
        """Return a reader of the next bytes, which are not copied: a sweep takes many."""
        begin = self.skip(count)
        return Cursor(self._data, begin, begin + count)

    def number(self, size: int) -> int:
        """Read an unsigned integer of so many bytes."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """Read a text behind its length."""
        try:
            return str(self.take(self.number(4)), "utf-8")
        except UnicodeDecodeError:
            raise Broken("text that is no UTF-8") from None

    def pairs(self) -> dict[str, str]:
        """Read pairs of texts behind their length."""
        inner = self.part(self.number(4))
        fields = {}
        while inner.left:
            key = inner.text()
            fields[key] = inner.text()
        return fields


def decompress(compression: str, packed: bytes, size: int) -> bytes:
    """Decompress a chunk whose size was checked.

    Raises:
        Broken: It is of another size, of an unknown compression, or damaged.
    """
    if compression == "":
        data = packed
    elif compression == "zstd":
        try:
            declared = zstandard.get_frame_parameters(packed).content_size
            if declared not in (zstandard.CONTENTSIZE_UNKNOWN, size):
                raise Broken(f"unpacks to {declared} bytes, expected {size}")
            data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        except zstandard.ZstdError as error:
            raise Broken(f"cannot be unpacked: {error}") from None
    else:
        raise Broken(f"compression {compression[:20]!r}, expected 'zstd' or none")
    if len(data) != size:
        raise Broken(f"unpacks to {len(data)} bytes, expected {size}")
    return data
