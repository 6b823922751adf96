"""Recordings as the inputs of a study's episodes: what is read, and how."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import msgspec

from wayproof.harness.recordings.recording import RecordingOptions


class ReadOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What to read of each recording of a study, as the options of `wayproof shadow`.

    Attributes:
        format: Name of the format; None finds it.
        sensors: Topics of the sensors; empty takes the only one.
        pose: Topic or frame of the poses; None takes the only one.
        body: Frame of the body; None takes the one that the poses are of.
        begin: First second read, s.
        end: Last second read, s; None reads to the end.
        range_max: Longest range that counts, m; None takes the recording's.
        no_return_is_free: Whether a beam without return was free up to the longest range; None
            takes what the format says.
    """

    format: str | None = None
    sensors: tuple[str, ...] = ()
    pose: str | None = None
    body: str | None = None
    begin: float = 0.0
    end: float | None = None
    range_max: float | None = None
    no_return_is_free: bool | None = None

    @property
    def options(self) -> RecordingOptions:
        """The options of the readers."""
        return RecordingOptions(
            format=self.format,
            sensors=self.sensors,
            pose=self.pose,
            body=self.body,
            start_s=self.begin,
            end_s=self.end,
            range_max=self.range_max,
            missing_returns_free=self.no_return_is_free,
        )


@dataclass(frozen=True)
class Source:
    """Recording that the inputs of an episode come from.

    Attributes:
        recording: Its path.
        robot: Body: a spec file, or a robot's name.
        settings: `section.field=value` of the episode.
        stack: Stack in place of the built-in one; empty for that.
        read: What to read of the recording.
    """

    recording: str
    robot: str
    settings: tuple[str, ...]
    stack: str
    read: ReadOptions

    def key(self, key: str) -> str:
        """Return the content address of an episode, given that of its config.

        The config holds the hash of the recording, but not what is read of it.
        """
        if self.read == ReadOptions():
            return key
        read = msgspec.json.encode(self.read)
        return hashlib.sha256(key.encode() + b"\n" + read).hexdigest()[:24]
