"""Voxel maps of recorded scans: processor time, memory and agreement with OctoMap, in one table.

    python -m wayproof.harness.bench.micro.recorded_map RECORDING... --resolution 0.1 --sweeps 20

The same returns go into VoxelMap and into pyoctomap, which is called as its documentation says.
Only returns count: what a beam without one has shown differs from format to format.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from wayproof.harness.bench.micro.map_entrants import THINNING, OctoMap, Ours, integrate
from wayproof.harness.bench.micro.map_workload import Sweep
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.poses import rotate
from wayproof.harness.recordings.recording import Recording, RecordingOptions
from wayproof.maps import MAPS, MapConfig, Representation, VoxelMap, beams_from_points
from wayproof.maps.columns import WORD_BITS
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL, cells_at

TILE = 256
"""Cells along the edges of the columns that are compared at a time."""

BEYOND = 1.0
"""Excess of the range limit over the longest return, m."""


@dataclass(frozen=True)
class RecordedRow:
    """One recording at one resolution.

    Attributes:
        recording: Its name.
        sweeps: Number of sweeps.
        points: Mean number of returns of a sweep.
        resolution: Edge of a cell, m.
        ours_ms: Median processor time of a sweep on one thread, ms.
        octomap_ms: Median processor time in OctoMap's faster mode, ms.
        ours_mib: Memory of the map, MiB.
        octomap_mib: Memory of the tree, MiB.
        cells: Number of cells that either map knows.
        agreement: Share of these that have one state in both.
        swapped: Share of the cells occupied in either that are free in the other.
    """

    recording: str
    sweeps: int
    points: int
    resolution: float
    ours_ms: float
    octomap_ms: float
    ours_mib: float
    octomap_mib: float
    cells: int
    agreement: float
    swapped: float


def returns(recording: Recording) -> Iterator[Sweep]:
    """Yield the sweeps of a recording in the world's frame, with their returns alone."""
    for sweep in recording.sweeps():
        position, quaternion = (one[0] for one in recording.track.at(np.array([sweep.time_ns])))
        mount = sweep.T_body_sensor
        origin = position + rotate(quaternion, np.asarray(mount.position))
        hit = np.isfinite(sweep.ranges)
        directions = sweep.directions[hit].astype(np.float64)
        own = directions * sweep.ranges[hit, None].astype(np.float64)
        points = origin + rotate(quaternion, rotate(mount.quaternion, own))
        beams, ranges_mm = beams_from_points(origin, points)
        kept = ranges_mm > 0
        none = np.empty(0)
        if kept.any():
            yield Sweep(
                origin,
                directions=beams[kept],
                ranges_mm=ranges_mm[kept],
                distances=none,
                geoms=none.astype(np.int32),
            )


def compare(name: str, sweeps: Sequence[Sweep], resolution: float) -> RecordedRow:
    """Map the sweeps with both and compare time, memory and every cell.

    Args:
        name: Name of the recording.
        sweeps: At least one.
        resolution: Edge of a cell, m.

    Raises:
        ValueError: A return is farther than the map takes.
    """
    config = MapConfig(
        resolution=resolution, half_life=0.0, floor_grazing_filter=False, minimum_range=0.0
    )
    limit = max(float(sweep.ranges_mm.max()) for sweep in sweeps) / 1000.0 + BEYOND
    _median(Ours("", 1, config, limit), sweeps[:1])  # compiles
    ours = Ours("", 1, config, limit, clock=time.thread_time)
    peers = [OctoMap(mode, resolution, limit, clock=time.thread_time) for mode in THINNING]
    ours_ms = _median(ours, sweeps)
    # OctoMap's cells begin at z = 0, ours below: the same points in the same cells
    lift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL * resolution])
    lifted = [sweep.moved(lift) for sweep in sweeps]
    peer_ms = min(_median(peer, lifted) for peer in peers)
    one, other = VoxelMap(config, 1), MAPS["octomap"](config, 1)
    for number, sweep in enumerate(sweeps):
        integrate(one, sweep, number, limit)
        integrate(other, sweep, number, limit)
    known, same, swapped, occupied = count_cells(one, other, sweeps)
    return RecordedRow(
        recording=name,
        sweeps=len(sweeps),
        points=round(statistics.mean(len(sweep.ranges_mm) for sweep in sweeps)),
        resolution=resolution,
        ours_ms=ours_ms,
        octomap_ms=peer_ms,
        ours_mib=ours.memory_bytes() / 2**20,
        octomap_mib=peers[0].memory_bytes() / 2**20,
        cells=known,
        agreement=same / known,
        swapped=swapped / max(occupied, 1),
    )


def _median(entrant: Ours | OctoMap, sweeps: Sequence[Sweep]) -> float:
    for number, sweep in enumerate(sweeps):
        entrant.take(sweep, number)
    return statistics.median(entrant.timed(after=0))


def count_cells(
    one: Representation, other: Representation, sweeps: Sequence[Sweep]
) -> tuple[int, int, int, int]:
    """Return how many cells are known to either, alike, swapped, and occupied in either."""
    ends = [sweep.origin + sweep.directions * (sweep.ranges_mm / 1000.0)[:, None]
            for sweep in sweeps]  # fmt: skip
    places = np.concatenate([*ends, [sweep.origin for sweep in sweeps]])
    cells, _ = cells_at(places, one.resolution)
    low, high = cells.min(axis=0) - 2, cells.max(axis=0) + 3
    words = -(-int(high[2] - low[2]) // WORD_BITS)
    counts = np.zeros(4, np.int64)
    for x in range(int(low[0]), int(high[0]), TILE):
        for y in range(int(low[1]), int(high[1]), TILE):
            box = (x, y, int(low[2])), (TILE, TILE, words)
            (a, free_a), (b, free_b) = one.columns(*box), other.columns(*box)
            counts += [
                int(np.bitwise_count(bits).sum(dtype=np.int64))
                for bits in (
                    a | free_a | b | free_b, (a & b) | (free_a & free_b),
                    (a & free_b) | (b & free_a), a | b,
                )
            ]  # fmt: skip
    known, same, swapped, occupied = counts.tolist()
    return known, same, swapped, occupied


def table(rows: Sequence[RecordedRow]) -> str:
    """Return the rows as a table in Markdown."""
    lines = [
        "| recording (sweeps) | cell, m | points | ours, ms | OctoMap, ms "
        "| faster by | MiB: ours, OctoMap | one state in both | swapped |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row.recording} ({row.sweeps}) | {row.resolution:g} | {row.points:,} | "
            f"{row.ours_ms:.3g} | {row.octomap_ms:.3g} | {row.octomap_ms / row.ours_ms:.0f} | "
            f"{row.ours_mib:.1f}, "
            f"{row.octomap_mib:.1f} | {row.agreement:.3%} | {row.swapped:.2%} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare on every recording and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--resolution", type=float, action="append", help="edge of a cell, m")
    parser.add_argument("--sweeps", type=int, default=20, help="number of sweeps of each")
    parser.add_argument("--every", type=int, default=1, help="take every so many sweeps")
    parser.add_argument("--out", type=Path, help="append each row to this file as JSON")
    parser.add_argument("--range-max", type=float, help="leave out returns beyond this, m")
    parser.add_argument("--pixel-stride", type=int, default=RecordingOptions().pixel_stride)
    options = parser.parse_args(arguments)
    reading = RecordingOptions(pixel_stride=options.pixel_stride, range_max=options.range_max)
    rows = []
    for path in options.recordings:
        recording = open_recording(path, options=reading)
        chosen = islice(returns(recording), 0, options.sweeps * options.every, options.every)
        sweeps = list(chosen)
        for resolution in options.resolution or (0.1,):
            rows.append(compare(recording.name, sweeps, resolution))
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(rows[-1])) + "\n")
    print(table(rows), end="")


if __name__ == "__main__":
    main()
