"""An episode in its log: run it or open it, and read its tables, its maps and its metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_document, override, with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.metrics import score
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.tables.tables import TABLES
from wayproof.harness.trace import read_trace
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.maps import states_in
from wayproof.maps.costmap.nav2_costs import costs_of
from wayproof.maps.grid import cell_box, centres

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 1_000_000
"""Maximum number of points of one decision."""


class MapArrays(NamedTuple):
    """The map of one decision in the mission's box.

    Attributes:
        states: (nx, ny, nz) uint8: 0 unknown, 1 free, 2 occupied.
        distances: (cx, cy, cz) float32: distance of the centre of a cell of the costmap to what is
            occupied, m; cz is 1 of a body that walks. Infinite where it is beyond the inflation.
        costs: (cx, cy, cz) uint8 by Nav2's scale: 254 occupied, 253 within the body's radius and
            the margin, 252 to 0 beyond; 255 unknown.
        costs_low: (3,) lower corner of the first cell of the costmap, world, m.
        low: (3,) lower corner of the first cell, world, m.
        resolution: Edge of a cell, m.
        version: Hash of the whole map's content.
    """

    states: NDArray[np.uint8]
    distances: NDArray[np.float32]
    costs: NDArray[np.uint8]
    costs_low: NDArray[np.float64]
    low: NDArray[np.float64]
    resolution: float
    version: str


@dataclass(frozen=True)
class RecordedEpisode:
    """An episode in its log; nothing is simulated to read it.

    Attributes:
        log: Head of the log, with access to its records.
    """

    log: Log

    @property
    def config(self) -> Config:
        """Return the resolved config."""
        return self.log.config

    @property
    def outcome(self) -> str:
        """Return the outcome: success, collision, fall, timeout, stuck, aborted, error, ..."""
        return self.log.result["outcome"]

    @property
    def reason(self) -> str:
        """Return the reason of the outcome, in words."""
        return self.log.result.get("reason", "")

    @property
    def cause(self) -> str:
        """Return the cause of a failure, as corrected by a check; empty of a success."""
        return self.log.check.get("cause") or self.log.result.get("cause", "")

    @property
    def evidence(self) -> str:
        """Return the evidence for the recorded cause, in words; empty of a success."""
        return self.log.result.get("cause_evidence", "")

    def decisions(self) -> pa.Table:
        """Return one row for each decision.

        Raises:
            InputError: The log is damaged.
        """
        return TABLES["decisions"](self.log)

    def truth(self) -> pa.Table:
        """Return the true pose, velocity and clearance at each decision.

        Raises:
            InputError: The log is damaged.
        """
        return TABLES["truth"](self.log)

    def poses(self) -> pa.Table:
        """Return the estimated pose of each decision, and its error.

        Raises:
            InputError: The log is damaged.
        """
        return TABLES["poses"](self.log)

    def sweeps(self) -> pa.Table:
        """Return the ranges of each sweep.

        Raises:
            InputError: The log is damaged, or its sweeps were left out.
        """
        return TABLES["sweeps"](self.log)

    def metrics(self) -> dict[str, float | None]:
        """Return every metric by name; None where it does not apply.

        Raises:
            InputError: The log is damaged.
        """
        return score(read_trace(self.log))

    def map_at(self, sequence: int) -> MapArrays:
        """Return the map that a decision was made with, made again from the sweeps before it.

        Args:
            sequence: Number of the decision, from 0.

        Raises:
            InputError: There is no such decision, or the sweeps were left out of the log.
        """
        moment = self._moment(sequence)
        resolution = moment.map.resolution
        low, high = np.array(self.log.mission.low), np.array(self.log.mission.high)
        states = states_in(moment.map, low, high)
        first, _ = cell_box(low, high, resolution)
        corner = centres(first, resolution) - 0.5 * resolution
        costmap = moment.costmap
        squared = costmap.obstacle_clearance
        distances = (np.sqrt(squared, dtype=np.float32) * resolution).astype(np.float32)
        distances[squared >= costmap.truncation] = np.inf
        layers = range(costmap.shape[2])
        costs = [costs_of(costmap, one, costmap.collision_distance_sq) for one in layers]
        return MapArrays(
            states=states,
            distances=distances,
            costs=np.stack(costs, axis=2),
            costs_low=costmap.origin.copy(),
            low=corner,
            resolution=resolution,
            version=moment.decision.map_version,
        )

    def points_at(self, sequence: int) -> NDArray[np.float64]:  # (n, 3)
        """Return the ends of a decision's beams that met something, (n, 3) m, world.

        They are placed by the estimated pose.

        Args:
            sequence: Number of the decision, from 0.

        Raises:
            InputError: There is no such decision, or the sweeps were left out of the log.
        """
        return self._moment(sequence).hits(MOST_POINTS)

    def plot(self) -> Figure:
        """Return a figure over time: clearance, speed, error of the pose, latency."""
        from wayproof.harness.api.plots import plot_episode

        return plot_episode(self)

    def plot_track(self) -> Figure:
        """Return a figure from above: the last map, the estimated and the true track."""
        from wayproof.harness.api.plots import plot_track

        return plot_track(self)

    def _moment(self, sequence: int) -> Moment:
        last = -1
        for moment in moments(self.log):
            last = moment.decision.sequence
            if last == sequence:
                return moment
        raise InputError(f"log '{self.log.path}': got decision {sequence}, expected 0 to {last}")


def run(
    world: str,
    *,
    robot: str,
    seed: int,
    goals: Sequence[Sequence[float] | str] = (),
    settings: Mapping[str, object] | None = None,
    perturb: str | None = None,
    stack: str | None = None,
    log: Path | str | None = None,
) -> RecordedEpisode:
    """Run one episode and write its log, as `wayproof run` does.

    Args:
        world: Name of a world, or path of a world file.
        robot: Name of a robot, or path of a spec file.
        seed: Seed of the world and of all randomness.
        goals: Goals one after the other: x, y or x, y, z, m, or names of places such as `home`; the
            world's own if none.
        settings: Name of a setting, such as `map.resolution` -> value.
        perturb: `KIND:SEVERITY` or `KIND:SEVERITY:MODE`.
        stack: Stack on trial, as `--stack` takes it; the built-in one if none.
        log: Path of the log; `logs/WORLD-ROBOT-SEED.mcap` if none. A log of that name is replaced.

    Raises:
        InputError: A name, a setting or the perturbation is wrong, or the log cannot be written.
    """
    from wayproof.harness.runner import run_episode  # it loads the simulator
    from wayproof.harness.scenario.scenario import build
    from wayproof.harness.scenario.worlds import refuse_other_worlds

    given = {"world": world, "robot": robot, "seed": seed}
    pairs = [f"{name}={text_of(value)}" for name, value in (settings or {}).items()]
    config = override(from_document(given), pairs)
    refuse_other_worlds(world, pairs)
    if goals:
        *waypoints, goal = (one if isinstance(one, str) else tuple(one) for one in goals)
        config = override(config, [f"waypoints={text_of(waypoints)}", f"goal={text_of(goal)}"])
    if perturb is not None:
        config = with_perturbation(config, perturbation_from(perturb))
    if stack is not None:
        config = replace(config, stack=replace(config.stack, name=stack))
    names = "-".join((Path(world).stem, Path(robot).stem, str(seed)))
    path = Path(log) if log is not None else Path("logs") / f"{names}.mcap"
    run_episode(build(config), path)
    return open(path)


def text_of(value: object) -> str:
    """Return a setting as `--set` takes it."""
    return value if isinstance(value, str) else msgspec.json.encode(value).decode()


def open(path: Path | str) -> RecordedEpisode:
    """Open a log; its checksums are recomputed, and no code that it names is run.

    Raises:
        InputError: No such file, no log, or damaged.
    """
    return RecordedEpisode(open_log(Path(path)))
