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

EDITS: dict[str, Edit] = {}
"""Name of an edit -> function that makes it, in the order of the table."""

CLAIMS = ("the latency of a stage", "versions of packages")
"""Edits of claims, which only a signature protects."""


def _edit(name: str) -> Callable[[Edit], Edit]:
    def add(edit: Edit) -> Edit:
        EDITS[name] = edit
        return edit

    return add


def forge(source: Path, name: str, target: Path) -> Path:
    """Write a forged log."""
    forgery = Forgery(source)
    EDITS[name](forgery)
    return forgery.write(target)


@_edit("an action")
def _action(forgery: Forgery) -> None:
    one = forgery.middle(pb.Decision)
    one.action = "explore" if one.action == "stop_and_wait" else "stop_and_wait"


@_edit("a reason")
def _reason(forgery: Forgery) -> None:
    forgery.middle(pb.Decision).reason = "clear ahead"


@_edit("a path, by 3 mm")
def _path(forgery: Forgery) -> None:
    path = forgery.middle(pb.Decision).trajectory.path
    path[len(path) // 2].x += 0.003


@_edit("a map version")
def _map_version(forgery: Forgery) -> None:
    forgery.middle(pb.Decision).map_version = "0" * 32


@_edit("the margin of every decision")
def _margin(forgery: Forgery) -> None:
    for one in forgery.each(pb.Decision):
        one.localization_margin_m = 0.0


@_edit("every decision past its deadline")
def _missed(forgery: Forgery) -> None:
    for one in forgery.each(pb.Decision):
        one.deadline_missed = True
    forgery.refigure()


@_edit("every action to `recover`")
def _recover(forgery: Forgery) -> None:
    for one in forgery.each(pb.Decision):
        one.action = "recover"


@_edit("the latency of a stage")
def _stages(forgery: Forgery) -> None:
    forgery.middle(pb.Decision).stages.plan_ms = 0.001


@_edit("the latency of a stage, the digest of the content as it was")
def _stages_alone(forgery: Forgery) -> None:
    _stages(forgery)
    forgery.digested = False


@_edit("versions of packages, the digest of the content as it was")
def _packages_alone(forgery: Forgery) -> None:
    forgery.run["numpy"] = "99.0"
    forgery.digested = False


def _cut(forgery: Forgery) -> None:
    kept = round(len(forgery.each(pb.Decision)) * KEPT_SHARE)
    forgery.messages = [one for one in forgery.messages if one.sequence < kept]  # type: ignore[attr-defined]
    last = forgery.each(pb.Decision)[-1]
    forgery.result["decisions"] = str(kept)
    forgery.result["sim_time_s"] = str(last.timestamp.ToNanoseconds() * 1e-9)


def _succeed(forgery: Forgery) -> None:
    forgery.result.update(
        outcome="success", reason="at rest 0.02 m from the goal", goal_distance_m="0.02"
    )
    forgery.result.update(collisions="0", struck="0", contact="")
    forgery.result.update(cause="", cause_evidence="", cause_decision="-1")


@_edit("the tail cut off, result as it was")
def _tail(forgery: Forgery) -> None:
    before = dict(forgery.result)
    _cut(forgery)
    forgery.result = before


@_edit("the tail cut off, count and time too")
def _tail_counted(forgery: Forgery) -> None:
    _cut(forgery)


@_edit("the tail cut off, a success")
def _tail_success(forgery: Forgery) -> None:
    _cut(forgery)
    _succeed(forgery)


@_edit("the tail cut off, every figure made anew, a fall")
def _tail_fall(forgery: Forgery) -> None:
    _cut(forgery)
    forgery.refigure()
    forgery.result.update(outcome="fall", reason="tilted beyond 1.2 rad at (1.00, 1.00, 0.30)")
    forgery.result.update(collisions="0", struck="0", contact="")


@_edit("a decision taken out, the rest renumbered")
def _taken_out(forgery: Forgery) -> None:
    gone = forgery.middle(pb.Decision).sequence
    forgery.messages = [one for one in forgery.messages if one.sequence != gone]  # type: ignore[attr-defined]
    for one in forgery.messages:
        one.sequence -= one.sequence > gone  # type: ignore[attr-defined]
    forgery.refigure()


@_edit("a decision taken out")
def _hole(forgery: Forgery) -> None:
    gone = forgery.middle(pb.Decision).sequence
    forgery.messages = [one for one in forgery.messages if one.sequence != gone]  # type: ignore[attr-defined]


@_edit("two decisions swapped")
def _swapped(forgery: Forgery) -> None:
    places = [k for k, one in enumerate(forgery.messages) if isinstance(one, pb.Decision)]
    first, second = places[len(places) // 2 : len(places) // 2 + 2]
    messages = forgery.messages
    messages[first], messages[second] = messages[second], messages[first]


@_edit("a decision twice")
def _twice(forgery: Forgery) -> None:
    one = forgery.middle(pb.Decision)
    again = pb.Decision()
    again.CopyFrom(one)
    place = next(k for k, other in enumerate(forgery.messages) if other is one)
    forgery.messages.insert(place, again)


@_edit("a bit of a sweep")
def _sweep(forgery: Forgery) -> None:
    sweep = forgery.middle(pb.Sweep)
    data = bytearray(sweep.ranges)
    data[len(data) // 3] ^= 1
    sweep.ranges = bytes(data)


@_edit("a bit of a sweep, digests and hashes made anew")
def _sweep_rehashed(forgery: Forgery) -> None:
    _sweep(forgery)
    forgery.rehash()


@_edit("a pose, by 1 nm")
def _pose(forgery: Forgery) -> None:
    forgery.middle(pb.Pose).position[0] += 1e-9


@_edit("a delay")
def _delay(forgery: Forgery) -> None:
    forgery.middle(pb.Latency).delay_s += 0.05


@_edit("the seed")
def _seed(forgery: Forgery) -> None:
    with forgery.document("config.json") as config:
        config["seed"] += 1000


@_edit("world and difficulty")
def _world(forgery: Forgery) -> None:
    with forgery.document("config.json") as config:
        config.update(world="warehouse", difficulty=1.0)


@_edit("the time limit")
def _limit(forgery: Forgery) -> None:
    with forgery.document("config.json") as config:
        config["episode"]["time_limit"] *= 2.0


@_edit("the perturbation, to none")
def _unperturbed(forgery: Forgery) -> None:
    with forgery.document("config.json") as config:
        config["perturbation"] = None


@_edit("the perturbation, to none, and its records")
def _unperturbed_everywhere(forgery: Forgery) -> None:
    _unperturbed(forgery)
    forgery.messages = [one for one in forgery.messages if not isinstance(one, pb.Perturbation)]


@_edit("the inflation margin")
def _inflation(forgery: Forgery) -> None:
    with forgery.document("config.json") as config:
        config["costmap"]["localization_margin"] += 0.1


@_edit("the goal, in the mission")
def _goal(forgery: Forgery) -> None:
    with forgery.document("mission.json") as mission:
        mission["goal"][0] -= 0.5


@_edit("the outcome, to success")
def _outcome(forgery: Forgery) -> None:
    _succeed(forgery)


@_edit("the cause")
def _cause(forgery: Forgery) -> None:
    forgery.result.update(cause="impossible", cause_evidence="no way leads there")


@_edit("the contact")
def _contact(forgery: Forgery) -> None:
    forgery.result["contact"] = "nothing at 1.0000,1.0000,1.0000"


@_edit("the result's chain")
def _chain(forgery: Forgery) -> None:
    forgery.sealed = False
    forgery.result["chain"] = "f" * 32


@_edit("the clearance in the truth")
def _clearance(forgery: Forgery) -> None:
    for one in forgery.each(pb.Truth):
        one.clearance_m += 0.5


@_edit("the clearance in the truth, figures made anew")
def _clearance_refigured(forgery: Forgery) -> None:
    _clearance(forgery)
    forgery.refigure()


@_edit("the truth, to what was believed")
def _truth_from_estimate(forgery: Forgery) -> None:
    poses = {one.sequence: one for one in forgery.each(pb.Pose)}
    for one in forgery.each(pb.Truth):
        one.position[:] = poses[one.sequence].position


@_edit("the truth, to what was believed, figures made anew")
def _believed_refigured(forgery: Forgery) -> None:
    _truth_from_estimate(forgery)
    forgery.refigure()


@_edit("stream hashes, all to zero")
def _streams(forgery: Forgery) -> None:
    for message in forgery.each(pb.Streams):
        for one in message.streams:
            one.hash = "00" * 8


@_edit("the hash of the stream `world`")
def _world_stream(forgery: Forgery) -> None:
    for one in forgery.middle(pb.Streams).streams:
        if one.name == "world":
            one.hash = "00" * 8


@_edit("a saved state")
def _state(forgery: Forgery) -> None:
    array = next(one for one in forgery.middle(pb.State).arrays if one.data)
    array.data = bytes([array.data[0] ^ 1]) + array.data[1:]


@_edit("an obstacle taken out of the scene")
def _scene(forgery: Forgery) -> None:
    geoms = re.findall(r'<geom name="[a-z]+_\d+"[^>]*/>', forgery.scene)
    forgery.scene = forgery.scene.replace(geoms[len(geoms) // 2], "", 1)


@_edit("the source of a sensor's figures")
def _source(forgery: Forgery) -> None:
    for _, info in forgery.tables:
        info.source = "somebody"


@_edit("the version of the program")
def _version(forgery: Forgery) -> None:
    forgery.run["wayproof"] = "99.0"


@_edit("versions of packages")
def _packages(forgery: Forgery) -> None:
    forgery.run["numpy"] = "99.0"
