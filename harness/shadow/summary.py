"""Summary of an assessment as plain values: shares, places, and what the stack would have done."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.assess import Assessed, Passed
from wayproof.harness.shadow.legs import Leg
from wayproof.harness.shadow.overlap import CLEARANCE_REACH, Cell
from wayproof.harness.shadow.own_maps import OwnMaps
from wayproof.harness.shadow.way import LEAST_STEP

Verdict = Literal["admitted", "not admitted", "nothing shown"]
"""All of the way was admitted when it was entered; some was not; or there was no way to judge."""

STOPPED = ("stop_and_wait", "abort")
"""Actions of a robot that goes nowhere."""

MEBIBYTE = 2.0**20


@dataclass(frozen=True)
class Place:
    """Successive legs that were not admitted for one reason.

    Attributes:
        sequence: Decision on whose map the first was not admitted.
        begin_s: Time at which it was entered, s.
        end_s: Time at which it was left, s.
        length_m: Length of way, m.
        position: Position of its beginning, m.
        why: `unknown`, `stale`, `occupied`, `margin` or `outside`.
        cells: Cells in the way of the first leg.
    """

    sequence: int
    begin_s: float
    end_s: float
    length_m: float
    position: tuple[float, ...]
    why: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Stop:
    """Successive decisions by which the stack would have stood while the robot moved.

    Attributes:
        sequence: The first of them.
        begin_s: Its time, s.
        seconds: Until the first decision to go, s.
        position: Position at which the stack would have come to rest, m.
        action: Action of the first decision.
        reason: Reason of the first decision.
    """

    sequence: int
    begin_s: float
    seconds: float
    position: tuple[float, ...]
    action: str
    reason: str


@dataclass(frozen=True)
class Summary:
    """Verdict on a recording, with its figures.

    Attributes:
        log: Path of the log.
        recording: Name and hash.
        format: Format of the recording.
        robot: Body that it is judged for.
        verdict: See `Verdict`.
        reason: Reason of the verdict, in words.
        chain: Hash over all decisions.
        decisions: Number of decisions.
        duration_s: Time from the first to the last, s.
        driven_m: Length of the way in steps of 0.05 m, m.
        unrecorded_m: Straight distance between poses of the recording that are too far apart to
            tell the way between them, m; neither driven nor admitted.
        admitted_m: Length of it that was admitted when it was entered, m.
        admitted_share: `admitted_m / driven_m`; None if nothing was driven.
        refused_m: Length that was not admitted by reason, m.
        places: Places where it was not admitted, the longest first.
        ahead_share: Share of the decisions whose next second of way was admitted, of those with
            way in it; None if there is none.
        ahead_decisions: Number of these.
        hindsight_m: Length of way through cells that the map without decay holds occupied at the
            end of the recording, m: they moved there later, or the poses are off, or the body did
            pass them.
        hindsight_admitted_m: Length of it that was admitted when it was entered, m.
        least_clearance_m: Least clearance of the bare body from occupied cells of the map of the
            moment, m.
        least_clearance_s: Time of that, s.
        clearance_is_bound: Whether nothing was within reach: `least_clearance_m` is a lower bound.
        actions: Decisions by action.
        moving_s: Time in which the robot moved, s.
        stopped_s: Time of it in which the stack would have stood, s.
        stops: Places and reasons of these stops, the longest first.
        latency_ms: Wall time of a decision: median, 99th percentile and greatest, ms.
        map_mib: Greatest memory of the map, MiB.
        own_maps: The robot's own maps beside ours, by topic.
        faults: Faults of the recording, in words.
    """

    log: str
    recording: str
    format: str
    robot: str
    verdict: Verdict
    reason: str
    chain: str
    decisions: int
    duration_s: float
    driven_m: float
    unrecorded_m: float
    admitted_m: float
    admitted_share: float | None
    refused_m: dict[str, float]
    places: tuple[Place, ...]
    ahead_share: float | None
    ahead_decisions: int
    hindsight_m: float
    hindsight_admitted_m: float
    least_clearance_m: float
    least_clearance_s: float
    clearance_is_bound: bool
    actions: dict[str, int]
    moving_s: float
    stopped_s: float
    stops: tuple[Stop, ...]
    latency_ms: dict[str, float]
    map_mib: float
    own_maps: dict[str, OwnMaps]
    faults: str


def summarize(assessed: Assessed) -> Summary:
    """Sum up an assessment."""
    log, passed, legs = assessed.log, assessed.passed, assessed.legs
    assert log.config.recording is not None
    driven = sum(leg.length_m for leg in legs)
    admitted = sum(leg.length_m for leg in legs if leg.admitted)
    places = places_of(legs)
    verdict, reason = _verdict(passed, legs, places, driven)
    if assessed.unrecorded_m >= LEAST_STEP:
        reason += f"; {assessed.unrecorded_m:.2f} m without poses were not judged"
    ahead = [one.ahead_admitted for one in passed if one.ahead_admitted is not None]
    nearest = min(passed, key=lambda one: one.clearance_m)
    moving, stops = stops_of(passed, legs)
    return Summary(
        log=str(log.path),
        recording=log.config.world,
        format=log.config.recording.format,
        robot=log.config.robot,
        verdict=verdict,
        reason=reason,
        chain=log.result["chain"],
        decisions=len(passed),
        duration_s=seconds(passed[-1].decision) - seconds(passed[0].decision),
        driven_m=driven,
        unrecorded_m=assessed.unrecorded_m,
        admitted_m=admitted,
        admitted_share=admitted / driven if driven > 0.0 else None,
        refused_m=_by_reason(legs),
        places=places,
        ahead_share=sum(ahead) / len(ahead) if ahead else None,
        ahead_decisions=len(ahead),
        hindsight_m=sum(leg.length_m for leg in legs if leg.hindsight_cells),
        hindsight_admitted_m=sum(
            leg.length_m for leg in legs if leg.hindsight_cells and leg.admitted
        ),
        least_clearance_m=nearest.clearance_m,
        least_clearance_s=seconds(nearest.decision),
        clearance_is_bound=nearest.clearance_m >= CLEARANCE_REACH,
        actions=_counts([one.decision.action for one in passed]),
        moving_s=moving,
        stopped_s=sum(stop.seconds for stop in stops),
        stops=stops,
        latency_ms=_latencies(passed),
        map_mib=assessed.greatest_bytes / MEBIBYTE,
        own_maps=assessed.own_maps,
        faults=log.result.get("reason", ""),
    )


def lines_of(summary: Summary) -> list[str]:
    """Return the figures of a summary in sentences."""
    actions = ", ".join(f"{name} {count}" for name, count in summary.actions.items())
    bound = ">= " if summary.clearance_is_bound else ""
    latency = summary.latency_ms
    lines = []
    if summary.ahead_share is not None:
        lines.append(
            f"at {summary.ahead_share:.1%} of {summary.ahead_decisions} decisions, the next second "
            "of driving stayed in space known to be free"
        )
    lines.append(
        f"{summary.hindsight_m:.2f} m cross cells that the final map holds as occupied; "
        f"{summary.hindsight_admitted_m:.2f} m of them were admitted when entered"
    )
    if summary.hindsight_m > SUSPICIOUS_SHARE * summary.driven_m:
        lines.append(
            "suspect the poses: a robot does not drive through what stands, but walls that are in "
            "the map twice do stand in its way; compare with --set estimate.kind=lidar"
        )
    lines += [WHY[why] for why in summary.refused_m if why in WHY]
    return [
        *lines,
        f"least clearance by the map {bound}{summary.least_clearance_m:.2f} m, at "
        f"{summary.least_clearance_s:.1f} s",
        f"decisions {latency['p50']:.1f} ms (p50), {latency['p99']:.1f} (p99), "
        f"{latency['max']:.1f} (max); map {summary.map_mib:.1f} MiB",
        f"started again at every recorded pose, the stack would have stood for "
        f"{summary.stopped_s:.1f} of the {summary.moving_s:.1f} s in which the robot moved: "
        f"{actions}",
        *(f"the robot's own {topic}: {one.text}" for topic, one in summary.own_maps.items()),
    ]


SUSPICIOUS_SHARE = 0.05
"""Share of the way through what stands in the end beyond which the poses are named."""

WHY = {
    "occupied": "occupied: the body overlapped what the map held as an obstacle at that time",
    "unknown": "unknown: no beam had ever crossed that space",
    "stale": "stale: the space was known once, and the map had forgotten it (map.half_life)",
    "margin": "margin: the body itself was free, the margin for the error of the pose was not",
    "outside": "outside: the body left the operating area",
}
"""Reason why a place was not admitted -> what it means."""


def seconds(decision: pb.Decision) -> float:
    """Time of a decision, s."""
    return float(decision.timestamp.ToNanoseconds()) * 1e-9


def places_of(legs: Sequence[Leg]) -> tuple[Place, ...]:
    """Join successive legs that were not admitted for one reason; the longest first."""
    places = []
    for (admitted, why), run in itertools.groupby(legs, lambda leg: (leg.admitted, leg.why)):
        joined = list(run)
        if admitted:
            continue
        first = joined[0]
        place = Place(
            sequence=first.sequence,
            begin_s=first.begin_ns * 1e-9,
            end_s=joined[-1].end_ns * 1e-9,
            length_m=sum(leg.length_m for leg in joined),
            position=_rounded(first.poses[0, :3]),
            why=why,
            cells=first.cells,
        )
        places.append(place)
    places.sort(key=lambda place: (-place.length_m, place.sequence))
    return tuple(places)


def stops_of(passed: Sequence[Passed], legs: Sequence[Leg]) -> tuple[float, tuple[Stop, ...]]:
    """Time in which the robot moved, s, and where the stack would have stood in it."""
    spans = [(leg.begin_ns, leg.end_ns, leg.length_m) for leg in legs]
    moving, stops = 0.0, []
    standing: list[tuple[Passed, float]] = []
    index = 0
    for one, after in itertools.pairwise(passed):
        begin, end = seconds(one.decision), seconds(after.decision)
        while index < len(spans) and spans[index][1] * 1e-9 <= begin:
            index += 1
        moves = index < len(spans) and spans[index][0] * 1e-9 <= begin and _moves(*spans[index])
        moving += (end - begin) * moves
        if moves and one.decision.action in STOPPED:
            standing.append((one, end - begin))
        elif standing and one.decision.action not in STOPPED:
            stops.append(_stop(standing))
            standing = []
    if standing:
        stops.append(_stop(standing))
    stops.sort(key=lambda stop: (-stop.seconds, stop.sequence))
    return moving, tuple(stops)


def _moves(begin_ns: int, end_ns: int, length_m: float) -> bool:
    """Return whether a leg is one of motion: faster than a step of way in a second."""
    return length_m >= LEAST_STEP * (end_ns - begin_ns) * 1e-9


def _stop(standing: Sequence[tuple[Passed, float]]) -> Stop:
    decision = standing[0][0].decision
    end = decision.trajectory.path[-1]
    return Stop(
        sequence=decision.sequence,
        begin_s=seconds(decision),
        seconds=sum(span for _, span in standing),
        position=_rounded(np.array([end.x, end.y, end.z])),
        action=decision.action,
        reason=decision.reason,
    )


def _verdict(
    passed: Sequence[Passed], legs: Sequence[Leg], places: Sequence[Place], driven: float
) -> tuple[Verdict, str]:
    if len(passed) < 2:
        return "nothing shown", "one decision, so there is no way from one to the next"
    if not legs:
        return "nothing shown", f"the robot never moved by {LEAST_STEP:g} m"
    if places:
        refused = sum(place.length_m for place in places)
        return "not admitted", (
            f"{refused:.2f} m of {driven:.2f} m were entered without proof, "
            f"at {len(places)} place{'s'[: len(places) > 1]}"
        )
    return "admitted", f"all {driven:.2f} m were known to be free when they were entered"


def _by_reason(legs: Sequence[Leg]) -> dict[str, float]:
    lengths: dict[str, float] = {}
    for leg in legs:
        if not leg.admitted:
            lengths[leg.why] = lengths.get(leg.why, 0.0) + leg.length_m
    return dict(sorted(lengths.items(), key=lambda item: -item[1]))


def _counts(names: Sequence[str]) -> dict[str, int]:
    """Count values, the most frequent first, equal counts by name."""
    ordered = sorted(set(names), key=lambda name: (-names.count(name), name))
    return {name: names.count(name) for name in ordered}


def _latencies(passed: Sequence[Passed]) -> dict[str, float]:
    stages = [one.decision.stages for one in passed]
    spent = [s.sense_ms + s.map_ms + s.costmap_ms + s.plan_ms for s in stages]
    p50, p99 = np.percentile(spent, [50, 99]).tolist()
    return {"p50": p50, "p99": p99, "max": max(spent)}


def _rounded(point: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, ...]:
    return tuple(round(float(value), 3) for value in point)
