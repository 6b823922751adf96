"""Movers as recorded in a log, for worlds that cannot be generated again."""

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
"""Time of appearance of a mover that never appeared in the log, s."""

ONWARD = 10.0
"""Time for which a mover continues at its last velocity after the log ends, s."""

POINT = Sphere((0.0, 0.0, 0.0), 1e-3, "recorded")
"""Placeholder of the body, which the scene has; a recorded mover never stops."""


@dataclass(frozen=True)
class RecordedMover(Mover):
    """Mover along its recorded poses, and a while beyond.

    Attributes:
        clock: (n,) time in motion at each recorded pose, ns.
        poses: (n, 4) x, y, z in m and its yaw, unwrapped, in rad.
    """

    clock: tuple[int, ...] = ()
    poses: tuple[tuple[float, float, float, float], ...] = ()

    def place(self, moving_ns: int) -> Place:
        """Return its place after a time in motion, ns."""
        x, y, z, yaw = (
            float(np.interp(moving_ns, self.clock, one)) for one in zip(*self.poses, strict=True)
        )
        return Place((x, y, z), yaw, yaw)


def with_recorded_movers(scenario: Scenario, case: Case) -> Scenario:
    """Return the scenario with all movers of the log; those that its world lacks as recorded."""
    known = {mover.name: mover for mover in scenario.world.movers}
    names = [mover.name for mover in case.moments[0].truth.movers]
    if set(names) <= set(known):
        return scenario
    movers = tuple(known.get(name) or _recorded(case.moments, k) for k, name in enumerate(names))
    return replace(scenario, world=replace(scenario.world, movers=movers))


def _recorded(moments: Sequence[Moment], number: int) -> RecordedMover:
    """Return one mover of a log, by its index in every truth."""
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
    """Return the time of a decision, s; infinite beyond the last one."""
    return float(times[number]) * 1e-9 if number < len(times) else inf
