"""Running digest of the whole content of a log, stored in its result.

It also covers what neither the chain nor a replay does, such as measured stage latencies and
versions of packages. It has no key, so anybody can compute it: it detects damage and careless
edits, not forgery. A signature detects forgery.
"""

from __future__ import annotations

import hashlib
import struct

from wayproof.harness.log.codec.container import Attachment, Item, Metadata

CONTENT = "content"
"""Field of the result that holds the digest."""

RESULT = "result"
"""Name of the last metadata record of a log."""

SIZE = 16
"""Size of the digest, bytes."""


class ContentDigest:
    """blake2b over attachments, metadata and messages, each kind in its order in the file.

    The digest does not depend on how the kinds interleave, on chunks or on compression. The
    messages of a packed log have other bytes, so its digest differs from that of the same log
    unpacked.
    """

    def __init__(self) -> None:
        """Create the digest of an empty log."""
        self._attachments, self._metadata, self._messages = kinds = [
            hashlib.blake2b(digest_size=SIZE) for _ in range(3)
        ]
        self._kinds = kinds

    def add(self, item: Item) -> None:
        """Append an item: name and bytes, name and fields, or schema, topic, time and bytes.

        The digest's own field in the result is left out.
        """
        if isinstance(item, Attachment):
            _append(self._attachments, item.name.encode(), item.data)
        elif isinstance(item, Metadata):
            fields = dict(item.fields)
            if item.name == RESULT:
                fields.pop(CONTENT, None)
            texts = [text for pair in fields.items() for text in pair]
            _append(self._metadata, item.name.encode(), *(text.encode() for text in texts))
        else:
            time = item.time_ns.to_bytes(8, "little")
            _append(self._messages, item.schema.encode(), item.topic.encode(), time, item.data)

    def text(self) -> str:
        """Return the digest of all items so far, in hexadecimal."""
        parts = b"".join(one.digest() for one in self._kinds)
        return hashlib.blake2b(parts, digest_size=SIZE).hexdigest()


def _append(to: hashlib.blake2b, *parts: bytes) -> None:
    """Append fields with their number and lengths, so that none runs into another."""
    lengths = struct.pack(f"<{len(parts) + 1}Q", len(parts), *map(len, parts))
    to.update(b"".join((lengths, *parts[:-1])))
    to.update(parts[-1])
