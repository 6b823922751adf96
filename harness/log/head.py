"""Head of a log: its messages before the first decision, and all its metadata."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import zstandard

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json
from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Beams
from wayproof.harness.log.codec.container import (
    GREATEST_RECORD,
    MAGIC,
    Attachment,
    Metadata,
    Packet,
)
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.log.writer import FORMAT_VERSION, PACKED_SCENE, digest_name
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb

ATTACHMENTS = ("config.json", "mission.json", "scene.xml")

DOCUMENTS = ("config", "mission")
"""Fields of the metadata of a fork that are JSON."""


@dataclass(frozen=True)
class Head:
    """Content of a log before its first decision, and all its metadata.

    Attributes:
        config: Resolved config.
        mission: Mission of the stack.
        scene: Flattened MJCF.
        run: Versions and hashes.
        metadata: All metadata by name, `run` and `result` among them.
        attachments: Files in the file by name, the texts of the first three among them.
        beams: Beam geometry by sensor name.
        tables: Message of each sensor, with its topic.
        before: Beam geometry before each fork, by the prefix of its topics.
    """

    config: Config
    mission: Mission
    scene: str
    run: dict[str, str]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    beams: dict[str, Beams]
    tables: tuple[tuple[str, pb.SensorInfo], ...]
    before: dict[str, dict[str, Beams]]


def read_head(
    items: Iterator[Attachment | Metadata | Packet], path: Path, allow_plugins: bool
) -> Head:
    """Parse and check the head.

    Args:
        items: Items of the file in file order; read to their end.
        path: Path for error messages.
        allow_plugins: Whether code that the config names may be imported.

    Raises:
        InputError: Something is missing, damaged, of another format, or not ours.
    """
    found = _sorted_items(items, path)
    run = _checked_run(found.metadata, path)
    _unpack_scene(found.attachments, path)
    _check_attachments(found.attachments, run, path)
    try:
        scene = found.attachments["scene.xml"].decode()
    except UnicodeDecodeError:
        raise InputError(f"log '{path}': scene.xml is no UTF-8 text") from None
    beams: dict[str, Beams] = {}
    before: dict[str, dict[str, Beams]] = {}
    for topic, info in found.tables:
        group = topic[: topic.find("/", 1) + 1]
        table = beams if group == "/sensor/" else before.setdefault(group, {})
        table[info.name] = beams_from_info(info)
    return Head(
        config=from_json(found.attachments["config.json"], allow_plugins),
        mission=Mission.from_json(found.attachments["mission.json"]),
        scene=scene,
        run=run,
        metadata=found.metadata,
        attachments=found.attachments,
        beams=beams,
        tables=tuple(found.tables),
        before=before,
    )


class _Items(NamedTuple):
    """Metadata and attachments by name, and each sensor's message with its topic."""

    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    tables: list[tuple[str, pb.SensorInfo]]


def _sorted_items(items: Iterator[Attachment | Metadata | Packet], path: Path) -> _Items:
    """Sort the items before the first decision by kind."""
    found = _Items({}, {}, [])
    for item in items:
        if isinstance(item, Metadata):
            texts = [text for name, text in item.fields.items() if name not in DOCUMENTS]
            if not all(text.isprintable() for text in texts):
                raise InputError(f"log '{path}': damaged (a text in its metadata is not printable)")
            found.metadata[item.name] = item.fields
        elif isinstance(item, Attachment):
            found.attachments[item.name] = item.data
        elif item.schema == pb.SensorInfo.DESCRIPTOR.full_name:
            info = decode(item, path)
            assert isinstance(info, pb.SensorInfo)
            found.tables.append((item.topic, info))
    return found


def _checked_run(metadata: dict[str, dict[str, str]], path: Path) -> dict[str, str]:
    """Return versions and hashes of a log in a format that is read here."""
    if "run" not in metadata:
        raise InputError(f"log '{path}': an MCAP file, but not a Wayproof log")
    version = metadata["run"].get("format_version")
    if version != FORMAT_VERSION:
        raise InputError(f"log '{path}': format version {version}, expected {FORMAT_VERSION}")
    return metadata["run"]


def _check_attachments(attachments: dict[str, bytes], run: dict[str, str], path: Path) -> None:
    """Check that every attachment of a head is there and matches its digest."""
    missing = [name for name in ATTACHMENTS if name not in attachments]
    if missing:
        raise InputError(f"log '{path}': no {', '.join(missing)} attached")
    for name in ATTACHMENTS:
        if run.get(digest_name(name)) != hashlib.sha256(attachments[name]).hexdigest():
            raise InputError(f"log '{path}': damaged ({name} does not match its digest)")


def _unpack_scene(attachments: dict[str, bytes], path: Path) -> None:
    """Decompress the scene of a packed log in place."""
    packed = attachments.pop(PACKED_SCENE, None)
    if packed is None:
        return
    try:
        size = zstandard.get_frame_parameters(packed).content_size
        if not 0 < size <= GREATEST_RECORD:
            raise InputError(f"log '{path}': damaged ({PACKED_SCENE} unpacks to {size} bytes)")
        attachments["scene.xml"] = zstandard.decompress(packed, size)
    except zstandard.ZstdError as error:
        raise InputError(f"log '{path}': damaged ({PACKED_SCENE}: {error})") from None


def check_readable(path: Path) -> None:
    """Check that a log is a file which this process may read.

    Raises:
        InputError: It is none.
    """
    try:
        if not path.is_file():
            raise InputError(f"log '{path}': no such file")
        with path.open("rb"):
            pass
    except OSError as error:
        raise InputError(f"log '{path}': {error.strerror}") from None


def check_file(path: Path) -> None:
    """Check that a file begins and ends as an MCAP file does.

    Raises:
        InputError: There is none, it may not be read, it is another file, or it breaks off.
    """
    check_readable(path)
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"log '{path}': empty, expected an MCAP file")
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
        file.seek(max(size - len(MAGIC), 0))
        tail = file.read()
    if head != MAGIC:
        raise InputError(f"log '{path}': not an MCAP file")
    if tail != MAGIC:
        raise InputError(
            f"log '{path}': truncated after {size} bytes; 'wayproof export --log' saves what it can"
        )
