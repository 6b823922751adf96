"""Recordings as the inputs of a study's episodes: their selection and settings."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from wayproof.harness.recordings.poses import mount_of
from wayproof.harness.recordings.recording import RecordingOptions


class ReadOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Selection of each recording of a study, as by the options of `wayproof shadow`.

    Attributes:
        format: Name of the format; None finds it.
        sensors: Topics of the sensors; empty takes the only one.
        pose: Topic or frame of the poses; None takes the only one.
        body: Frame of the body; None takes the one that the poses are of.
        begin: First second read, s.
        end: Last second read, s; None reads to the end.
        range_max: Longest range that counts, m; None takes the recording's.
        no_return_is_free: Whether a beam without return was free up to the longest range; None
            takes the format's convention.
        max_gap: Longest time between two poses between which one is interpolated, s.
        mount: Sensor in the body's frame, x, y, z, yaw, pitch, roll, m and degrees; the angles may
            be left out.
        intrinsics: fx, fy, cx, cy of depth images, pixels.
        depth_scale: Units of a depth image in a metre.
        pixel_stride: Step between the rows and columns of depth images that are read.
    """

    format: str | None = None
    sensors: tuple[str, ...] = ()
    pose: str | None = None
    body: str | None = None
    begin: float = 0.0
    end: float | None = None
    range_max: float | None = None
    no_return_is_free: bool | None = None
    max_gap: float = 1.0
    mount: tuple[float, ...] = ()
    intrinsics: tuple[float, float, float, float] | None = None
    depth_scale: float | None = None
    pixel_stride: int = 4

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
            max_gap_s=self.max_gap,
            mount=mount_of(self.mount) if self.mount else None,
            intrinsics=self.intrinsics,
            depth_scale=self.depth_scale,
            pixel_stride=self.pixel_stride,
        )


@dataclass(frozen=True)
class Source:
    """Recording that the inputs of an episode come from.

    Attributes:
        recording: Its path.
        robot: Body: a spec file, or a robot's name.
        settings: `section.field=value` of the episode.
        stack: Stack in place of the built-in one; empty for that.
        read: Selection of the recording.
    """

    recording: str
    robot: str
    settings: tuple[str, ...]
    stack: str
    read: ReadOptions
