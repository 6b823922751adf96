"""Limits of how many messages a log may hold: a small file no more than an episode makes."""

from __future__ import annotations

from wayproof.harness.log.codec.fields import Broken

MOST_DECISIONS = 200_000
"""Maximum number of decisions in a file; an hour at 10 Hz makes 36,000."""

MOST_MESSAGES = 1_000_000
"""Maximum number of messages in a file."""

LEAST_MESSAGES = 20_000
"""Number of messages allowed in any file; beyond it one for every `LEAST_BYTES` of the file."""

LEAST_BYTES = 16
"""Minimum file size per message, bytes; messages of an episode take 800 and more."""

LEAST_DATA = 2**20
GREATEST_DATA_RATIO = 32
"""Maximum ratio of message data but sweeps, beyond `LEAST_DATA` bytes, to the file size; an episode
reaches 1.3. A message takes many times its bytes in memory: two bytes make a point of a path."""

MOST_DECLARED = 10_000
"""Maximum number of records in chunks that are no messages: schemas, channels, unknown ones."""

ONCE = frozenset(
    f"wayproof.{name}"
    for name in (
        "Pose",
        "Goal",
        "Latency",
        "State",
        "Truth",
        "RecordedMotion",
        "Streams",
        "Keyframe",
    )
)
"""Schemas with one message per decision."""

DECISION, SWEEP, TABLE = "wayproof.Decision", "wayproof.Sweep", "wayproof.SensorInfo"

MOST_SWEEPS = 256
"""Maximum number of sweeps between two decisions."""

MOST_TABLES = 1000
"""Maximum number of beam tables in a file, those before its forks among them."""


class Census:
    """Counts of the messages of a file, each held against its limit."""

    def __init__(self, file_size: int) -> None:
        """Start with none, of a file of so many bytes."""
        self._most = min(MOST_MESSAGES, LEAST_MESSAGES + file_size // LEAST_BYTES)
        self._most_data = LEAST_DATA + GREATEST_DATA_RATIO * file_size
        self._all = self._decisions = self._tables = self._data = self._declared = 0
        self._since: dict[str, int] = {}  # schema -> messages since the last decision

    def count_declared(self) -> None:
        """Count a record in a chunk that is no message.

        Raises:
            Broken: There are too many.
        """
        self._declared += 1
        self._hold(self._declared, MOST_DECLARED, "records in chunks that are no messages")

    def count(self, schema: str, topic: str, size: int) -> None:
        """Count a message.

        Args:
            schema: Name of its schema.
            topic: Its topic.
            size: Its size, bytes.

        Raises:
            Broken: There are too many of its schema, of all, or of their bytes.
        """
        self._all += 1
        self._hold(self._all, self._most, "messages")
        if schema not in (SWEEP, TABLE):
            self._data += size
            self._hold(self._data, self._most_data, "bytes of messages other than sweeps")
        if schema == DECISION:
            self._decisions += 1
            self._hold(self._decisions, MOST_DECISIONS, "decisions")
            self._since.clear()
        elif schema == TABLE:
            self._tables += 1
            self._hold(self._tables, MOST_TABLES, "sensors' tables")
        elif schema == SWEEP or schema in ONCE:
            self._since[schema] = count = self._since.get(schema, 0) + 1
            most = MOST_SWEEPS if schema == SWEEP else 1
            self._hold(count, most, f"messages of {topic[:40]!r} for decision {self._decisions}")

    def _hold(self, count: int, most: int, what: str) -> None:
        if count > most:
            raise Broken(f"{count} {what}, expected at most {most}")
