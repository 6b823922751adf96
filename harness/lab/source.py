"""Placed sweeps of a log or of a recording, without a stack."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.filters import Filters, Origin, names_of
from wayproof.harness.input_messages import beams_from_info, inputs_from_messages
from wayproof.harness.inputs import Beams, Inputs, WorldSweep
from wayproof.harness.log.reader import open_log
from wayproof.harness.mission import Mission
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.shadow.batches import batches
from wayproof.harness.shadow.inputs import InputWriter
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared
from wayproof.maps import MAPS, MapConfig

Corner = tuple[float, float, float]

FLOOR = ("ground_fit", "missing_floor", "grazing")
"""Filters of a source: the floor is where the stack has it, and all else counts as it came."""


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
    inputs = (record.inputs for record in log.records())
    placed = _placed(inputs, log.beams, log.config, log.mission)
    return _source(path.name, log.config, log.mission, islice(placed, most))


def of_recording(recording: Recording, prepared: Prepared, most: int) -> Source:
    """Read the first sweeps of a recording.

    Raises:
        InputError: It is damaged.
    """
    config, mission = prepared.config, prepared.mission
    beams = {info.name: beams_from_info(info) for info in prepared.infos}
    writer = InputWriter(prepared, RecordedPerturbation(config, prepared.infos))
    given = (writer.write(each, n) for n, each in enumerate(batches(recording.sweeps(), 0)))
    inputs = (inputs_from_messages(one.pose, one.sweeps, goal=one.goal) for one in given)
    placed = _placed(inputs, beams, config, mission)
    return _source(recording.name, config, mission, islice(placed, most))


def _placed(
    each: Iterable[Inputs], beams: Mapping[str, Beams], config: Config, mission: Mission
) -> Iterator[PlacedSweep]:
    names = [name for name in FLOOR if name in names_of(config)]
    filters = Filters(names, config, mission, MAPS[config.map.kind](config.map))
    for inputs in each:
        for sweep in inputs.sweeps:
            own = beams[sweep.sensor]
            placed = own.place(sweep, inputs.pose, inputs.sequence)
            world = filters(placed, Origin(sweep.sensor, own, inputs.pose, deviation=0.0))
            yield PlacedSweep(inputs.time_ns, world, own.range)


def _source(name: str, config: Config, mission: Mission, sweeps: Iterable[PlacedSweep]) -> Source:
    return Source(name, config.map, low=mission.low, high=mission.high, sweeps=tuple(sweeps))
