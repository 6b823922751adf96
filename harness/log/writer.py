"""Writing of a log: head, then inputs and decisions in order.

A log grows under the name `<name>.mcap.partial`, which one writer at a time holds. When it is
complete it gets its own name by an atomic rename. `log_time` is simulated time; `sequence` counts
through the file.

Topics: `/sensor/<name>/info`, `/sensor/<name>`, `/pose` and `/latency` are inputs, and `/goal` of a
recording or of a mission with several goals, and `/prediction` of a predictor from outside; a
replay compares `/decision`; `/truth`, or `/recorded` of a recording, is for scoring, `/state` for
forks, and `/keyframe` to replay from there.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import zstandard
from google.protobuf.descriptor import Descriptor, FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import is_log
from wayproof.harness.log.codec.mcap_file import McapFile
from wayproof.harness.log.codec.packed import pack
from wayproof.harness.log.machine import installed_version, this_machine
from wayproof.harness.outputs import Draft, check_target

FORMAT_VERSION = "7"
"""Format of the logs written and read; raised when messages are recorded differently."""

LEAST_FREE_BYTES = 64 * 2**20
"""Minimum free disk space to start an episode, bytes; a minute of a 20,000-ray lidar takes less."""

FLUSH_PERIOD_NS = 1_000_000_000
"""Maximum simulated time that is lost when the process is killed, ns."""

CHUNK, PACKED_CHUNK = 2**20, 2**24
"""Size of a chunk, bytes; a reader that seeks decompresses a whole one."""

PACKED_SCENE = "scene.xml.zst"
"""Attachment with the scene of a packed log; its digest is that of the text."""

PLUGINS = "plugins"
"""Name of the metadata with the SHA-256 of the file of each of the user's classes in use."""

ASKED = "asked"
"""Name of the metadata with the settings that the scenario resolved, as they were asked for."""

STDERR = "stack.stderr.txt"
"""Attachment: the end of the standard error of a stack in another process."""

PREDICTOR_STDERR = "predictor.stderr.txt"
"""Attachment: the end of the standard error of a predictor in another process."""

TRACEBACK = "error.txt"
"""Attachment with the traceback of an episode that ended as `error`."""


class LogWriter:
    """Log of one episode being written, a context manager; partial without `finish`.

    Attributes:
        path: Final name of the log.
        partial_path: Name until it is finished.
        record: Extent of the log, see `Config.record`.
        finished: Whether it has its result.
    """

    def __init__(
        self,
        path: Path | Draft,
        config: bytes,
        mission: bytes,
        scene: str,
        run: Mapping[str, str] | None = None,
        flush_period_ns: int = FLUSH_PERIOD_NS,
        packed: bool = False,
    ) -> None:
        """Open the partial file and write the head.

        Args:
            path: Final name of the log, or a draft that holds the name and whose owner publishes
                it.
            config: Resolved config, JSON.
            mission: Mission of the stack, JSON.
            scene: Flattened MJCF.
            run: Versions and digests, for a copy of another log; by default those of this
                machine.
            flush_period_ns: Simulated time between flushes, ns.
            packed: Whether to write a small file: compressed scene, packed fields, large chunks.

        Raises:
            InputError: The folder cannot be written to or is full, the name is unfit for a log, or
                another run is writing it.
        """
        self._owned = not isinstance(path, Draft)
        self._draft = draft = path if isinstance(path, Draft) else hold_log(path)
        self.path = draft.path
        self.partial_path = draft.partial
        self.record = "full"
        self.finished = self._closed = False
        library = f"wayproof {installed_version('wayproof')}"
        self._writer = McapFile(draft.file, library, PACKED_CHUNK if packed else CHUNK)
        self._packed = packed
        self._channels: dict[str, int] = {}
        self._count = 0
        self._now_ns = 0  # time of the last message
        self._safe_ns = 0  # end of the current flush period
        self._flush_period_ns = flush_period_ns
        attachments = {"config.json": config, "mission.json": mission, "scene.xml": scene.encode()}
        run = dict(run or _run_metadata(attachments))
        self._writer.add_metadata("run", run)
        if packed:
            attachments[PACKED_SCENE] = zstandard.compress(attachments.pop("scene.xml"), 19)
        for name, data in attachments.items():
            self._writer.add_attachment(name, f"application/{name.split('.')[-1]}", data)

    def note(self, name: str, fields: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._writer.add_metadata(name, dict(fields))

    def attach(self, name: str, text: str) -> None:
        """Add a text as an attachment."""
        self._writer.add_attachment(name, "text/plain", text.encode())

    def flush(self) -> None:
        """Pass everything written to the operating system, so that it survives a kill."""
        self._writer.hand_on()
        self._writer.settle()

    def size(self) -> int:
        """Pass everything written to the operating system and return the log's size, bytes."""
        return self._writer.size()

    def keeps(self, topic: str) -> bool:
        """Return whether messages of a topic are kept; `decisions` excludes sweeps and states."""
        return self.record != "decisions" or not is_regenerated(topic)

    def write(self, topic: str, message: Message, time_ns: int, data: bytes | None = None) -> None:
        """Append one message if it is kept.

        Everything older than a second of simulated time is flushed, so a kill loses no more.

        Args:
            topic: Topic of the message.
            message: The message.
            time_ns: Simulated time, ns.
            data: Its bytes, if they are known already.

        Raises:
            OSError: This message or an earlier one could not be written.
        """
        if not self.keeps(topic):
            return
        if time_ns > self._now_ns:
            self._flush_in_time(time_ns)
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic, type(message))
        if self._packed:
            data = pack(message).SerializeToString(deterministic=True)
        elif data is None:
            data = message.SerializeToString(deterministic=True)
        self._writer.add_message(channel, time_ns, data, self._count)
        self._count += 1

    def finish(self, result: Mapping[str, str]) -> None:
        """Write the result, and rename the log unless the owner of a draft does."""
        kept = "decisions" if self.record == "decisions" else "full"
        self._writer.add_result({**result, "record": kept})
        self._writer.finish()
        self.finished = True
        if self._owned:
            self._draft.publish()

    def close(self) -> None:
        """Leave the partial log readable up to here; no effect once finished."""
        if not self.finished and not self._closed:
            self._closed = True
            with contextlib.suppress(OSError):  # the cause may be a full disk
                self._writer.hand_on()
                self._writer.settle()
            self._writer.close()
        if self._owned:
            self._draft.release()

    def __enter__(self) -> LogWriter:
        """Return this writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def _flush_in_time(self, time_ns: int) -> None:
        """Flush before a decision at `time_ns` if the period would end before the next one.

        The thread has until then to write, so waiting for it is rare.
        """
        self._writer.settle()
        before_ns, self._now_ns = self._now_ns, time_ns
        if 2 * time_ns - before_ns - self._safe_ns <= self._flush_period_ns:
            return
        self._writer.hand_on()
        if time_ns - self._safe_ns > self._flush_period_ns:
            self._writer.settle()
        self._safe_ns = before_ns

    def _register(self, topic: str, kind: type[Message]) -> int:
        descriptor: Descriptor = kind.DESCRIPTOR  # type: ignore[assignment]
        return self._writer.add_channel(
            topic, descriptor.full_name, file_descriptor_set(descriptor)
        )


def is_regenerated(topic: str) -> bool:
    """Return whether the seed reproduces the messages of a topic: sweeps, states and keyframes.

    Poses are kept, because decisions refer to them and they are small.
    """
    return topic in ("/state", "/keyframe") or (
        topic.startswith("/sensor/") and not topic.endswith("/info")
    )


def check_folder(folder: Path) -> None:
    """Check that a log can be written to a folder, before anything is written.

    Raises:
        InputError: It is no folder, is not writable, or has too little space left.
    """
    existing = folder
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"log folder '{folder}': '{existing}' is a file, expected a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(f"log folder '{folder}': no permission to write to '{existing}'")
    free = shutil.disk_usage(existing).free
    if free < LEAST_FREE_BYTES:
        raise InputError(
            f"log folder '{folder}': {free / 2**20:.1f} MiB free, "
            f"expected at least {LEAST_FREE_BYTES / 2**20:.0f} MiB"
        ) from OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def hold_log(path: Path) -> Draft:
    """Reserve the name of a log while it is being written.

    Raises:
        InputError: The folder cannot be written to or is full; the name is that of a folder, a
            device or a file that is no log of ours; or another run is writing it.
    """
    check_target(path, "log")
    check_folder(path.parent)
    draft = Draft(path)
    if path.is_file() and path.stat().st_size and not is_log(path):
        draft.release()
        raise InputError(f"log '{path}': a file that is no log, expected another name")
    return draft


def refuse_inputs(path: Path, inputs: Iterable[str | Path]) -> None:
    """Refuse a log's name that is the name of a file which is read for it.

    Args:
        path: Name of the log.
        inputs: Names of files; what is no file is passed over.

    Raises:
        InputError: One of them would be overwritten.
    """
    for one in inputs:
        if os.path.isfile(path) and os.path.isfile(one) and os.path.samefile(path, one):
            raise InputError(f"log '{path}': is read for this log, expected another name")


def digest_name(attachment: str) -> str:
    """Return the key of an attachment's digest in the metadata `run`; MCAP readers check none."""
    return f"sha256 {attachment}"


def _run_metadata(attachments: Mapping[str, bytes]) -> dict[str, str]:
    digests = {
        digest_name(name): hashlib.sha256(data).hexdigest() for name, data in attachments.items()
    }
    return {"format_version": FORMAT_VERSION, **digests, **this_machine()}


@functools.cache
def file_descriptor_set(descriptor: Descriptor) -> bytes:
    """Return the descriptors of a message and all that it imports, dependencies first.

    They hold only the messages that this one is made of, because a log stores its schemas twice,
    the second time uncompressed.
    """
    files = FileDescriptorSet()
    needed = _parts(descriptor)
    for file in _with_dependencies(descriptor.file):
        copy = files.file.add()
        file.CopyToProto(copy)
        copy.ClearField("options")  # of code generators
        kept = [one for one in copy.message_type if _full_name(file, one.name) in needed]
        del copy.message_type[:]
        copy.message_type.extend(kept)
    return files.SerializeToString(deterministic=True)


def _with_dependencies(file: FileDescriptor) -> list[FileDescriptor]:
    """Return a file and all that it imports, each once, after what it imports."""
    below = (one for dependency in file.dependencies for one in _with_dependencies(dependency))
    return list({one.name: one for one in (*below, file)}.values())


def _parts(descriptor: Descriptor) -> set[str]:
    """Return the full names of the top-level messages that a message is made of, and its own."""
    names: set[str] = set()
    ahead = [descriptor]
    while ahead:
        one = ahead.pop()
        while one.containing_type is not None:
            one = one.containing_type
        if one.full_name in names:
            continue
        names.add(one.full_name)
        inner = [one]
        while inner:
            message = inner.pop()
            inner.extend(message.nested_types)
            ahead.extend(f.message_type for f in message.fields if f.message_type is not None)
    return names


def _full_name(file: FileDescriptor, name: str) -> str:
    return f"{file.package}.{name}" if file.package else name
