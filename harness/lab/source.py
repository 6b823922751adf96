"""Placed sweeps of a log or of a recording, without a stack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.input_messages import beams_from_info, inputs_from_messages
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.shadow.batches import batches
from wayproof.harness.shadow.inputs import InputWriter
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared
from wayproof.harness.stack.ground import floor_evidence, missing_floor_of
from wayproof.maps import MapConfig

Corner = tuple[float, float, float]


@dataclass(frozen=True)
class PlacedSweep:
    """One sweep in the world frame.

    Attributes:
        time_ns: ns.
        sweep: Its beams.
        range_m: Range up to which a beam without return clears, m.
    """

    time_ns: int
    sweep: WorldSweep
    range_m: float


@dataclass(frozen=True)
class Source:
    """Sweeps for the maps of the lab.

    Attributes:
        name: Name of the log or the recording.
        config: Settings of its own map.
        low: Low corner of the region that is mapped, m.
        high: High corner, m.
        sweeps: Sweeps in order of time.
    """

    name: str
    config: MapConfig
    low: Corner
    high: Corner
    sweeps: tuple[PlacedSweep, ...]


def of_log(path: Path, most: int) -> Source:
    """Read the first sweeps of a log.

    Raises:
        InputError: It is no log, or has no sweeps.
    """
    log = open_log(path)

    def placed() -> Iterator[PlacedSweep]:
        missing = missing_floor_of(log.config, log.mission)
        for record in log.records():
            inputs = record.inputs
            for sweep in inputs.sweeps:
                beams = log.beams[sweep.sensor]
                world = beams.place(sweep, inputs.pose, inputs.sequence)
                world = floor_evidence(
                    world,
                    beams.range,
                    pose=inputs.pose,
                    config=log.config,
                    mission=log.mission,
                    missing=missing,
                )
                yield PlacedSweep(inputs.time_ns, world, beams.range)

    return Source(
        path.name,
        config=log.config.map,
        low=log.mission.low,
        high=log.mission.high,
        sweeps=first(placed(), most),
    )


def of_recording(recording: Recording, prepared: Prepared, most: int) -> Source:
    """Read the first sweeps of a recording.

    Raises:
        InputError: It is damaged.
    """
    mission = prepared.mission
    beams = {info.name: beams_from_info(info) for info in prepared.infos}
    writer = InputWriter(prepared, RecordedPerturbation(prepared.config, prepared.infos))

    def placed() -> Iterator[PlacedSweep]:
        missing = missing_floor_of(prepared.config, mission)
        for sequence, batch in enumerate(batches(recording.sweeps(), 0)):
            given = writer.write(batch, sequence)
            inputs = inputs_from_messages(given.pose, given.sweeps, goal=given.goal)
            for sweep in inputs.sweeps:
                own = beams[sweep.sensor]
                world = own.place(sweep, inputs.pose, sequence)
                world = floor_evidence(
                    world,
                    own.range,
                    pose=inputs.pose,
                    config=prepared.config,
                    mission=mission,
                    missing=missing,
                )
                yield PlacedSweep(inputs.time_ns, world, own.range)

    sweeps = first(placed(), most)
    return Source(
        recording.name,
        config=prepared.config.map,
        low=mission.low,
        high=mission.high,
        sweeps=sweeps,
    )


def first(sweeps: Iterator[PlacedSweep], most: int) -> tuple[PlacedSweep, ...]:
    """Return the first of some sweeps."""
    kept = []
    for sweep in sweeps:
        kept.append(sweep)
        if len(kept) >= most:
            break
    return tuple(kept)
