"""Reading a log back; every way in which it can be broken is one clear line."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import DecodeError, Message
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader

from harness.config import Config, from_json
from harness.errors import InputError
from harness.inputs import Beams, Inputs, beams_from_info, inputs_from_messages
from harness.log import FORMAT_VERSION, digest_name
from harness.mission import Mission
from harness.schema import wayproof_pb2 as pb

MAGIC = b"\x89MCAP0\r\n"
GREATEST_ATTACHMENT = 64 * 2**20


@dataclass(frozen=True)
class Record:
    """One decision's share of a log: what went in, how long it took, what came out."""

    inputs: Inputs
    latency: pb.Latency
    decision: pb.Decision


@dataclass(frozen=True)
class Log:
    """The head of a log and the way to its records.

    Attributes:
        path: Where it lies.
        config: Resolved config.
        mission: What the stack was told.
        scene: Flattened MJCF; only re-simulation needs it.
        world: Text of the world file, where the world was read from one.
        run: Versions and hashes.
        result: Outcome and figures.
        beams: Sensor geometry by sensor name.
    """

    path: Path
    config: Config
    mission: Mission
    scene: str
    world: str | None
    run: dict[str, str]
    result: dict[str, str]
    beams: dict[str, Beams]

    def records(self) -> Iterator[Record]:
        """Every decision with its inputs, in file order."""
        sweeps: list[pb.Sweep] = []
        pose, latency = pb.Pose(), pb.Latency()
        for message in read_messages(self.path):
            if isinstance(message, pb.Sweep):
                sweeps.append(message)
            elif isinstance(message, pb.Pose):
                pose = message
            elif isinstance(message, pb.Latency):
                latency = message
            elif isinstance(message, pb.Decision):
                yield Record(inputs_from_messages(pose, sweeps), latency, message)
                sweeps = []

    def truth(self) -> Iterator[pb.Truth]:
        """The simulator's truth at each decision, for scoring."""
        for message in read_messages(self.path):
            if isinstance(message, pb.Truth):
                yield message


def open_log(path: Path, allow_plugins: bool = False) -> Log:
    """Read the head of a finished log.

    Args:
        path: Where it lies.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No such file, no MCAP, truncated, of another format, or not ours.
    """
    _check_file(path)
    try:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
            attachments = _read_attachments(path, reader)
            beams = _read_beams(reader)
    except (McapError, DecodeError, ValueError, EOFError, OSError) as error:
        raise _broken(path, error) from None
    if "run" not in metadata or "result" not in metadata:
        raise InputError(f"log '{path}': an MCAP file, but not a finished Wayproof log")
    version = metadata["run"].get("format_version")
    if version != FORMAT_VERSION:
        raise InputError(f"log '{path}': format version {version}, expected {FORMAT_VERSION}")
    for name, data in attachments.items():
        if metadata["run"].get(digest_name(name)) != hashlib.sha256(data).hexdigest():
            raise InputError(f"log '{path}': damaged ({name} does not match its digest)")
    return Log(
        path=path,
        config=from_json(attachments["config.json"], allow_plugins),
        mission=Mission.from_json(attachments["mission.json"]),
        scene=attachments["scene.xml"].decode(),
        world=attachments["world.xml"].decode() if "world.xml" in attachments else None,
        run=metadata["run"],
        result=metadata["result"],
        beams=beams,
    )


def read_messages(path: Path) -> Iterator[Message]:
    """Every message of a log in file order, decoded.

    Raises:
        InputError: The file breaks off or a checksum does not hold.
    """
    try:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            for schema, _, message in reader.iter_messages(log_time_order=False):
                if schema is not None and schema.name in _MESSAGES:
                    yield _MESSAGES[schema.name].FromString(message.data)
    except (McapError, DecodeError, ValueError, EOFError, OSError) as error:
        raise _broken(path, error) from None


_MESSAGES: dict[str, type[Message]] = {
    kind.DESCRIPTOR.full_name: kind
    for kind in (pb.SensorInfo, pb.Sweep, pb.Pose, pb.Latency, pb.Decision, pb.Truth)
}


def _check_file(path: Path) -> None:
    if not path.is_file():
        raise InputError(f"log '{path}': no such file")
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
        raise InputError(f"log '{path}': truncated after {size} bytes")


def _read_attachments(path: Path, reader: McapReader) -> dict[str, bytes]:
    attachments = {}
    for attachment in reader.iter_attachments():
        if len(attachment.data) > GREATEST_ATTACHMENT:
            raise InputError(f"log '{path}': attachment of {len(attachment.data)} bytes")
        attachments[attachment.name] = attachment.data
    missing = {"config.json", "mission.json", "scene.xml"} - attachments.keys()
    if missing:
        raise InputError(f"log '{path}': no {', '.join(sorted(missing))} attached")
    return attachments


def _read_beams(reader: McapReader) -> dict[str, Beams]:
    beams = {}
    for schema, _, message in reader.iter_messages(log_time_order=False):
        if schema is None or schema.name != pb.SensorInfo.DESCRIPTOR.full_name:
            break  # the sensors stand before everything else
        info = pb.SensorInfo.FromString(message.data)
        beams[info.name] = beams_from_info(info)
    return beams


def _broken(path: Path, error: Exception) -> InputError:
    text = " ".join(str(error).split()) or type(error).__name__
    return InputError(f"log '{path}': damaged ({text})")
