"""Movers as a log recorded them: for worlds that neither a name nor a config makes again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, yaw_of
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.worlds import Mover, Sphere
from wayproof.models.worlds.movers import Place

NEVER = 1e9
"""When a mover appears that did not before the log ended, s."""

ONWARD = 10.0
"""What was going when the log ended goes on for so long as it went last, s."""

POINT = Sphere((0.0, 0.0, 0.0), 1e-3, "recorded")
"""In place of a body: the scene has it, and what was recorded stops for nobody."""


@dataclass(frozen=True)
class RecordedMover(Mover):
    """A mover that goes where it was seen, and a while beyond.

    Attributes:
        clock: (n,) how long it had been going at each sighting, ns.
        poses: (n, 4) x, y, z in m and its yaw, unwrapped, in rad.
    """

    clock: tuple[int, ...] = ()
    poses: tuple[tuple[float, float, float, float], ...] = ()

    def place(self, moving_ns: int) -> Place:
        """Where it was after going, not standing, for so many nanoseconds."""
        x, y, z, yaw = (
            float(np.interp(moving_ns, self.clock, one)) for one in zip(*self.poses, strict=True)
        )
        return Place((x, y, z), yaw, yaw)


def with_recorded_movers(scenario: Scenario, case: Case) -> Scenario:
    """The scenario with all that moved in the log; what its world does not have, as recorded."""
    known = {mover.name: mover for mover in scenario.world.movers}
    names = [mover.name for mover in case.moments[0].truth.movers]
    if set(names) <= set(known):
        return scenario
    movers = tuple(known.get(name) or _recorded(case.moments, k) for k, name in enumerate(names))
    return replace(scenario, world=replace(scenario.world, movers=movers))


def _recorded(moments: Sequence[Moment], number: int) -> RecordedMover:
    """One mover of a log, by its place in every truth."""
    seen = [moment.truth.movers[number] for moment in moments]
    times = np.array([moment.time_ns for moment in moments])
    rows = np.array([[*one.position, yaw_of(one.quaternion)] for one in seen])
    rows[:, 3] = np.unwrap(rows[:, 3])
    going = (np.diff(rows, axis=0) != 0.0).any(axis=1)
    clock = np.concatenate([[0], np.cumsum(np.where(going, np.diff(times), 0))])
    if len(going) and going[-1]:
        onward = round(ONWARD * 1e9)
        step = (rows[-1] - rows[-2]) * (onward / (times[-1] - times[-2]))
        clock, rows = np.append(clock, clock[-1] + onward), np.vstack([rows, rows[-1] + step])
    here = [k for k, one in enumerate(seen) if one.present]
    x, y, z = rows[0, :3].tolist()
    return RecordedMover(
        name=seen[0].name,
        solids=(POINT,),
        route=((x, y, z),),
        speed=1.0 if going.any() else 0.0,
        stands_off=0.0,
        appears=_seconds(times, here[0]) if here else NEVER,
        vanishes=_seconds(times, here[-1] + 1) if here else inf,
        clock=tuple(clock.tolist()),
        poses=tuple((x, y, z, yaw) for x, y, z, yaw in rows.tolist()),
    )


def _seconds(times: np.ndarray, number: int) -> float:
    """Time of a decision, s; beyond the last one never."""
    return float(times[number]) * 1e-9 if number < len(times) else inf
