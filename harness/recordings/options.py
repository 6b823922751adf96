"""How a recording is read: the options that select its parts, and the faults that are counted."""

from __future__ import annotations

from collections import Counter

import msgspec

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.transform import Transform, mount_of

Faults = Counter[str]
"""Kind of fault -> how many were met."""

UNREADABLE = "message: cannot be read"

Intrinsics = tuple[float, float, float, float]
"""fx, fy, cx, cy, pixels."""


class Broken(Exception):
    """A message, or a file of a sweep, cannot be read."""


def unreadable(faults: Faults, error: Broken) -> str:
    """Return the kind of fault of messages that cannot be read, with the text of the first one."""
    first = next((kind for kind in faults if kind.startswith(UNREADABLE)), None)
    return first or f"{UNREADABLE}, the first: {error}"


class RecordingOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Selection of a recording, and settings to read it. Times are counted from its first pose.

    Attributes:
        format: Name of the format; None finds it.
        sensors: Topics of the sensors; empty takes the only one.
        pose: Topic of the poses, or the fixed frame of the transforms; None takes the only one.
        body: Frame of the body; None takes the one that the poses are of.
        begin: First second read, s.
        end: Last second read, s; None reads to the end.
        range_max: Longest range that counts, m, where the recording lacks it, or a shorter one.
        no_return_is_free: Whether a beam without return was free up to the longest range; None
            takes the format's convention.
        max_gap: Longest time between two poses between which one is interpolated, s.
        mount: Sensor in the body's frame as it stands on the body, x ahead and z up also of a
            camera, where the recording lacks it: x, y, z, yaw, pitch, roll, m and degrees; the
            angles may be left out. A folder's poses are then the sensor's.
        intrinsics: fx, fy, cx, cy of depth images, pixels, where the recording lacks them.
        depth_scale: Units of an integer depth image in a metre; None takes the format's.
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
    intrinsics: Intrinsics | None = None
    depth_scale: float | None = None
    pixel_stride: int = 4

    @property
    def T_body_sensor(self) -> Transform | None:
        """The mount; None where none is given.

        Raises:
            InputError: It is not three to six finite numbers.
        """
        return mount_of(self.mount) if self.mount else None

    def changed(self) -> dict[str, object]:
        """Return the options that are not the default, by name."""
        usual = RecordingOptions()
        names = (name for name in self.__struct_fields__)
        values = {name: getattr(self, name) for name in names}
        return {name: one for name, one in values.items() if one != getattr(usual, name)}

    def texts(self) -> tuple[str, ...]:
        """Return `name=value` of the options that are not the default, numbers bit by bit."""
        return tuple(
            f"{name}={','.join(map(str, one)) if isinstance(one, tuple) else one}"
            for name, one in self.changed().items()
        )

    def check(self) -> None:
        """Refuse options that no recording can be read with.

        Raises:
            InputError: Naming the option.
        """
        _ = self.T_body_sensor
        if self.intrinsics is not None and not usable(self.intrinsics):
            got = ",".join(f"{value:g}" for value in self.intrinsics)
            raise InputError(f"intrinsics {got}: expected fx,fy,cx,cy in pixels, fx and fy above 0")
        for name, value, least in (
            ("range_max", self.range_max, 1e-3),
            ("depth_scale", self.depth_scale, 1e-6),
            ("pixel_stride", self.pixel_stride, 1),
            ("max_gap", self.max_gap, 0.0),
            ("begin", self.begin, -1e9),
            ("end", self.end, -1e9),
        ):
            if value is not None and not least <= value <= 1e9:
                raise InputError(f"{name} {value:g}: expected {least:g} to 1e9")


def usable(intrinsics: Intrinsics) -> bool:
    """Return whether intrinsics may be those of a camera: finite, and of a focal length."""
    fx, fy, cx, cy = intrinsics
    return all(0.1 <= focal <= 1e6 for focal in (fx, fy)) and abs(cx) <= 1e6 and abs(cy) <= 1e6
