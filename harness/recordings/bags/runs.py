"""Runs of a bag: where its clock was set back, or a simulator reset, and the one that is judged.

A time that a bag has twice has two poses, so the order in the file tells its runs apart: for poses,
transforms and sweeps alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.survey import Survey
from wayproof.harness.recordings.options import Faults
from wayproof.harness.recordings.order import set_backs

OTHER_RUN = "sweep: of another run, as the clock was set back"

Stream = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Stamps, ns, and places in the file, in its order."""


class Chosen(NamedTuple):
    """The run of a bag that is judged.

    Attributes:
        found: What the first pass found of it.
        text: It and the others in words; empty where there is one.
    """

    found: Survey
    text: str


def choose_run(path: Path, found: Survey, names: Sequence[str], faults: Faults) -> Chosen:
    """Return the run with the most sweeps of the sensors.

    Args:
        path: Path of the bag.
        found: What the first pass found.
        names: Sensors that are read.
        faults: Sweeps of other runs are counted.

    Raises:
        InputError: It cannot be told to which run the sweeps belong.
    """
    streams = _streams(found, names)
    cuts = _cuts(streams)
    if not cuts:
        return Chosen(found, "")
    runs = [_cut(found, cuts, k) for k in range(len(cuts) + 1)]
    counts = [sum(len(run.sensors[name].stamps) for name in names) for run in runs]
    best = int(np.argmax(counts))
    for name in names:
        _check_between(path, name, runs[best])
    faults[OTHER_RUN] += sum(counts) - counts[best]
    listed = ", ".join(
        f"run {k + 1} ({count} sweeps{_from(run, names)})"
        for k, (count, run) in enumerate(zip(counts, runs, strict=True))
        if k != best
    )
    text = f"; run {best + 1} of {len(runs)}, as the clock was set back; not judged: {listed}"
    return Chosen(runs[best], text)


def _from(run: Survey, names: Sequence[str]) -> str:
    stamps = [stamp for name in names for stamp in run.sensors[name].stamps]
    return f", {min(stamps) * 1e-9:.1f} to {max(stamps) * 1e-9:.1f} s" if stamps else ""


def _streams(found: Survey, names: Sequence[str]) -> dict[str, Stream]:
    """Return the stamps and places of the sensors, and of all that moves."""
    listed = {name: (found.sensors[name].stamps, found.sensors[name].places) for name in names}
    for name, topic in found.poses.items():
        listed[name] = topic.samples.stamps, topic.samples.places
    for one in found.transforms.values():
        for (parent, child), samples in one.moving.items():
            listed[f"{parent} -> {child}"] = samples.stamps, samples.places
    return {
        name: (np.array(stamps, np.int64), np.array(places, np.int64))
        for name, (stamps, places) in listed.items()
    }


def _cuts(streams: dict[str, Stream]) -> list[int]:
    """Return the places in the file from which on a new run counts.

    Streams are set back one after another, each at its next message: those up to the second one of
    any stream are one event, and it is where the first of them was.
    """
    met = [
        (int(places[k]), name)
        for name, (stamps, places) in streams.items()
        for k in set_backs(stamps)
    ]
    cuts: list[int] = []
    seen: set[str] = set()
    for place, name in sorted(met):
        if not cuts or name in seen:
            cuts.append(place)
            seen = set()
        seen.add(name)
    return cuts


def _cut(found: Survey, cuts: Sequence[int], number: int) -> Survey:
    """Return what was found of a run."""
    first = cuts[number - 1] if number > 0 else 0
    last = cuts[number] if number < len(cuts) else 2**62
    return replace(
        found,
        sensors={name: one.between(first, last) for name, one in found.sensors.items()},
        poses={
            name: replace(one, samples=one.samples.between(first, last))
            for name, one in found.poses.items()
        },
        transforms={
            name: replace(
                one,
                moving={link: each.between(first, last) for link, each in one.moving.items()},
            )
            for name, one in found.transforms.items()
        },
        grids={name: one.between(first, last) for name, one in found.grids.items()},
    )


def _check_between(path: Path, name: str, run: Survey) -> None:
    """Refuse sweeps that lie beside all poses in the file: the poses may be of another run.

    Raises:
        InputError: Naming the sensor.
    """
    places = run.sensors[name].places
    moving = [stream[1] for other, stream in _streams(run, []).items() if other != name]
    inside = sum(int(((one >= places[0]) & (one <= places[-1])).sum()) for one in moving)
    if len(places) > 1 and inside == 0:
        raise InputError(
            f"recording '{path}': the clock was set back, and no pose lies between the sweeps of "
            f"'{name}' in the file, so it cannot be told which run they are of: split it there"
        )
