"""Forged logs: edited by somebody who knows the format and recomputes all checksums and hashes.

Two edits leave the digest of the content as it was. What follows from the inputs cannot be forged
without the program's own computations, so every edit must be detected by recomputing, except claims
that cannot be checked.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from google.protobuf.message import Message
from mcap.opcode import Opcode

from wayproof.harness.decision import chain_hash
from wayproof.harness.ending import goal_distance
from wayproof.harness.log.codec.container import MAGIC, walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.head import Head, read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import digest_name
from wayproof.harness.mission import Mission
from wayproof.harness.replay.content import read_content
from wayproof.harness.result import figures_of
from wayproof.harness.schema import wayproof_pb2 as pb

Kind = TypeVar("Kind", bound=Message)

DATA_END = struct.Struct("<BQI")
"""Record at the end of the data: opcode, length, checksum of everything before."""

FOOTER = struct.Struct("<QQI")
"""Footer: place of the index and of its groups, checksum."""

KEPT_SHARE = 0.6
"""Share of the decisions that remain when a tail is cut off."""


class Forgery:
    """Editable content of a log, written back with valid hashes."""

    def __init__(self, source: Path) -> None:
        """Read all of a log."""
        self._source = source
        self._head = read_head(walk(source, head_only=True), source, allow_plugins=False)
        self.result = dict(open_log(source).result)
        self.run = dict(self._head.run)
        self.tables = [(topic, _copy(info)) for topic, info in self._head.tables]
        self.messages = [one for one in read_messages(source) if not isinstance(one, pb.SensorInfo)]
        self._attachments = dict(self._head.attachments)
        self.sealed = self.digested = True

    def each(self, kind: type[Kind]) -> list[Kind]:
        """Return all messages of a kind, to be edited in place."""
        return [one for one in self.messages if isinstance(one, kind)]

    def middle(self, kind: type[Kind]) -> Kind:
        """Return the message in the middle of its kind."""
        found = self.each(kind)
        return found[len(found) // 2]

    @contextmanager
    def document(self, name: str) -> Iterator[dict[str, Any]]:
        """Yield an attached JSON document, to be edited in place."""
        document = json.loads(self._attachments[name])
        yield document
        self._attachments[name] = json.dumps(document, indent=1).encode()

    @property
    def scene(self) -> str:
        """The attached scene."""
        return self._attachments["scene.xml"].decode()

    @scene.setter
    def scene(self, text: str) -> None:
        self._attachments["scene.xml"] = text.encode()

    @property
    def mission(self) -> Mission:
        """The attached mission."""
        return Mission.from_json(self._attachments["mission.json"])

    def refigure(self) -> None:
        """Make the result's figures anew from truth and decisions, as a careful person would."""
        decisions, truths = self.each(pb.Decision), self.each(pb.Truth)
        figures = {
            "decisions": len(decisions),
            "goal_distance_m": goal_distance(self.mission, np.array(truths[-1].position)),
            **figures_of(decisions, truths),
        }
        self.result.update({name: str(value) for name, value in figures.items()})

    def write(self, target: Path) -> Path:
        """Write the log, with the hashes and digests that were made anew; return its path."""
        if self.sealed:
            self.result["chain"] = self._seal()
        for name, data in self._attachments.items():
            self.run[digest_name(name)] = hashlib.sha256(data).hexdigest()
        head: Head = replace(
            self._head,
            run=self.run,
            attachments=self._attachments,
            scene=self.scene,
            tables=tuple(self.tables),
        )
        write_copy(target, head, self.messages, self.result)
        if not self.digested:
            _put_back(target, self.result[CONTENT])
        return target

    def rehash(self) -> None:
        """Make input digests and stream hashes anew from the edited inputs."""
        with tempfile.TemporaryDirectory() as folder:
            path = self.write(Path(folder) / "draft.mcap")
            had = read_content(open_log(path)).inputs
        for decision, streams, one in zip(
            self.each(pb.Decision), self.each(pb.Streams), had, strict=True
        ):
            decision.input_digest = one.digest
            for stream in streams.streams:
                stream.hash = one.hashes.get(stream.name, stream.hash)

    def _seal(self) -> str:
        chain = ""
        chains: dict[int, str] = {}
        for decision in self.each(pb.Decision):
            chain = decision.chain = chains[decision.sequence] = chain_hash(decision, chain)
        for keyframe in self.each(pb.Keyframe):
            keyframe.chain = chains.get(keyframe.sequence, keyframe.chain)
        return chain


def _put_back(path: Path, digest: str) -> None:
    """Give a log another digest of its content; the checksum of the file's data is made anew."""
    data = path.read_bytes().replace(open_log(path).result[CONTENT].encode(), digest.encode())
    footer = len(data) - len(MAGIC) - FOOTER.size
    index, _, _ = FOOTER.unpack_from(data, footer)
    end = index - DATA_END.size
    checksum = DATA_END.pack(Opcode.DATA_END, 4, zlib.crc32(data[:end]))
    path.write_bytes(data[:end] + checksum + data[index:])


def _copy(info: pb.SensorInfo) -> pb.SensorInfo:
    copied = pb.SensorInfo()
    copied.CopyFrom(info)
    return copied


Edit = Callable[[Forgery], None]


def forge(source: Path, name: str, target: Path) -> Path:
    """Write a forged log."""
    forgery = Forgery(source)
    EDITS[name](forgery)
    return forgery.write(target)


def _then(*edits: Edit) -> Edit:
    """Return edits one after the other."""

    def edit(forgery: Forgery) -> None:
        for one in edits:
            one(forgery)

    return edit


def _each(kind: type[Message], **fields: Any) -> Edit:
    """Return an edit of all messages of a kind."""

    def edit(forgery: Forgery) -> None:
        for one in forgery.each(kind):
            for name, value in fields.items():
                setattr(one, name, value)

    return edit


def _middle(kind: type[Message], change: Callable[[Any], None]) -> Edit:
    """Return an edit of the message in the middle of its kind."""
    return lambda forgery: change(forgery.middle(kind))


def _document(name: str, change: Callable[[dict[str, Any]], None]) -> Edit:
    """Return an edit of an attached document."""

    def edit(forgery: Forgery) -> None:
        with forgery.document(name) as document:
            change(document)

    return edit


def _config(change: Callable[[dict[str, Any]], None]) -> Edit:
    return _document("config.json", change)


def _result(**fields: str) -> Edit:
    return lambda forgery: forgery.result.update(fields)


def _run(**fields: str) -> Edit:
    return lambda forgery: forgery.run.update(fields)


def _undigested(forgery: Forgery) -> None:
    forgery.digested = False


def _action(one: pb.Decision) -> None:
    one.action = "explore" if one.action == "stop_and_wait" else "stop_and_wait"


def _path(one: pb.Decision) -> None:
    path = one.trajectory.path
    path[len(path) // 2].x += 0.003


def _stages(one: pb.Decision) -> None:
    one.stages.plan_ms = 0.001


def _cut(forgery: Forgery) -> None:
    kept = round(len(forgery.each(pb.Decision)) * KEPT_SHARE)
    forgery.messages = [one for one in forgery.messages if one.sequence < kept]  # type: ignore[attr-defined]
    last = forgery.each(pb.Decision)[-1]
    forgery.result["decisions"] = str(kept)
    forgery.result["sim_time_s"] = str(last.timestamp.ToNanoseconds() * 1e-9)


def _tail(forgery: Forgery) -> None:
    before = dict(forgery.result)
    _cut(forgery)
    forgery.result = before


UNHARMED = {"collisions": "0", "struck": "0", "contact": ""}

SUCCESS = _result(
    outcome="success", reason="at rest 0.02 m from the goal", goal_distance_m="0.02",
    cause="", cause_evidence="", cause_decision="-1", **UNHARMED,
)  # fmt: skip

FALL = _result(outcome="fall", reason="tilted beyond 1.2 rad at (1.00, 1.00, 0.30)", **UNHARMED)


def _hole(forgery: Forgery) -> None:
    gone = forgery.middle(pb.Decision).sequence
    forgery.messages = [one for one in forgery.messages if one.sequence != gone]  # type: ignore[attr-defined]


def _taken_out(forgery: Forgery) -> None:
    gone = forgery.middle(pb.Decision).sequence
    _hole(forgery)
    for one in forgery.messages:
        one.sequence -= one.sequence > gone  # type: ignore[attr-defined]
    forgery.refigure()


def _swapped(forgery: Forgery) -> None:
    places = [k for k, one in enumerate(forgery.messages) if isinstance(one, pb.Decision)]
    first, second = places[len(places) // 2 : len(places) // 2 + 2]
    messages = forgery.messages
    messages[first], messages[second] = messages[second], messages[first]


def _twice(forgery: Forgery) -> None:
    one = forgery.middle(pb.Decision)
    again = pb.Decision()
    again.CopyFrom(one)
    place = next(k for k, other in enumerate(forgery.messages) if other is one)
    forgery.messages.insert(place, again)


def _sweep(sweep: pb.Sweep) -> None:
    data = bytearray(sweep.ranges)
    data[len(data) // 3] ^= 1
    sweep.ranges = bytes(data)


def _pose(one: pb.Pose) -> None:
    one.position[0] += 1e-9


def _delay(one: pb.Latency) -> None:
    one.delay_s += 0.05


def _seed(config: dict[str, Any]) -> None:
    config["seed"] += 1000


def _limit(config: dict[str, Any]) -> None:
    config["episode"]["time_limit"] *= 2.0


def _inflation(config: dict[str, Any]) -> None:
    config["costmap"]["localization_margin"] += 0.1


def _goal(mission: dict[str, Any]) -> None:
    mission["goal"][0] -= 0.5


def _unrecorded(forgery: Forgery) -> None:
    forgery.messages = [one for one in forgery.messages if not isinstance(one, pb.Perturbation)]


def _unsealed(forgery: Forgery) -> None:
    forgery.sealed = False


def _clearance(forgery: Forgery) -> None:
    for one in forgery.each(pb.Truth):
        one.clearance_m += 0.5


def _truth_from_estimate(forgery: Forgery) -> None:
    poses = {one.sequence: one for one in forgery.each(pb.Pose)}
    for one in forgery.each(pb.Truth):
        one.position[:] = poses[one.sequence].position


def _streams(message: pb.Streams, name: str = "") -> None:
    """Set the hash of one stream to zero, or of all."""
    for one in message.streams:
        if name in ("", one.name):
            one.hash = "00" * 8


def _all_streams(forgery: Forgery) -> None:
    for message in forgery.each(pb.Streams):
        _streams(message)


def _state(one: pb.State) -> None:
    array = next(one for one in one.arrays if one.data)
    array.data = bytes([array.data[0] ^ 1]) + array.data[1:]


def _scene(forgery: Forgery) -> None:
    geoms = re.findall(r'<geom name="[a-z]+_\d+"[^>]*/>', forgery.scene)
    forgery.scene = forgery.scene.replace(geoms[len(geoms) // 2], "", 1)


def _source(forgery: Forgery) -> None:
    for _, info in forgery.tables:
        info.source = "somebody"


UNPERTURBED = _config(lambda config: config.update(perturbation=None))

EDITS: dict[str, Edit] = {
    "an action": _middle(pb.Decision, _action),
    "a reason": _middle(pb.Decision, lambda one: setattr(one, "reason", "clear ahead")),
    "a path, by 3 mm": _middle(pb.Decision, _path),
    "a map version": _middle(pb.Decision, lambda one: setattr(one, "map_version", "0" * 32)),
    "the margin of every decision": _each(pb.Decision, localization_margin_m=0.0),
    "every decision past its deadline": _then(
        _each(pb.Decision, deadline_missed=True), Forgery.refigure
    ),
    "every action to `recover`": _each(pb.Decision, action="recover"),
    "the latency of a stage": _middle(pb.Decision, _stages),
    "the latency of a stage, the digest of the content as it was": _then(
        _middle(pb.Decision, _stages), _undigested
    ),
    "versions of packages, the digest of the content as it was": _then(
        _run(numpy="99.0"), _undigested
    ),
    "the tail cut off, result as it was": _tail,
    "the tail cut off, count and time too": _cut,
    "the tail cut off, a success": _then(_cut, SUCCESS),
    "the tail cut off, every figure made anew, a fall": _then(_cut, Forgery.refigure, FALL),
    "a decision taken out, the rest renumbered": _taken_out,
    "a decision taken out": _hole,
    "two decisions swapped": _swapped,
    "a decision twice": _twice,
    "a bit of a sweep": _middle(pb.Sweep, _sweep),
    "a bit of a sweep, digests and hashes made anew": _then(
        _middle(pb.Sweep, _sweep), Forgery.rehash
    ),
    "a pose, by 1 nm": _middle(pb.Pose, _pose),
    "a delay": _middle(pb.Latency, _delay),
    "the seed": _config(_seed),
    "world and difficulty": _config(
        lambda config: config.update(world="warehouse", difficulty=1.0)
    ),
    "the time limit": _config(_limit),
    "the perturbation, to none": UNPERTURBED,
    "the perturbation, to none, and its records": _then(UNPERTURBED, _unrecorded),
    "the inflation margin": _config(_inflation),
    "the goal, in the mission": _document("mission.json", _goal),
    "the outcome, to success": SUCCESS,
    "the cause": _result(cause="impossible", cause_evidence="no way leads there"),
    "the contact": _result(contact="nothing at 1.0000,1.0000,1.0000"),
    "the result's chain": _then(_unsealed, _result(chain="f" * 32)),
    "the clearance in the truth": _clearance,
    "the clearance in the truth, figures made anew": _then(_clearance, Forgery.refigure),
    "the truth, to what was believed": _truth_from_estimate,
    "the truth, to what was believed, figures made anew": _then(
        _truth_from_estimate, Forgery.refigure
    ),
    "stream hashes, all to zero": _all_streams,
    "the hash of the stream `world`": _middle(pb.Streams, lambda one: _streams(one, "world")),
    "a saved state": _middle(pb.State, _state),
    "an obstacle taken out of the scene": _scene,
    "the source of a sensor's figures": _source,
    "the version of the program": _run(wayproof="99.0"),
    "versions of packages": _run(numpy="99.0"),
}
"""Name of an edit -> function that makes it, in the order of the table."""

CLAIMS = ("the latency of a stage", "versions of packages")
"""Edits of claims, which only a signature protects."""
