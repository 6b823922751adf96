"""The counterfactual check: one thing put right before the last chance; is the robot saved?

The episode goes on from the simulator's state a second before that decision, four times: with the
true pose, with the true map, with a larger margin, and without delay. What saves the robot is what
it lacked; where nothing does, it was something else.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.cause.case import Case, Moment, read_case
from harness.cause.finding import Finding
from harness.cause.grids import true_occupancy
from harness.config import Config, LatencyConfig, to_json
from harness.episode import Episode
from harness.errors import InputError
from harness.evidence.fork import Past, live_through
from harness.evidence.rebuild import rebuild
from harness.evidence.relay import Relay
from harness.inputs import Inputs
from harness.logs.log import LogWriter
from harness.logs.reader import Log
from harness.result import Result
from harness.stack.navigator import Navigator
from maps import Representation
from models.beams import NO_RETURN
from models.odometry import OdometryConfig

Array = NDArray[np.float64]

MORE_TIME = 5.0
"""How long an episode may go on after the contact that it ended with, s."""

MOST = 100_000
"""No episode has more decisions after its last chance."""

MARGIN_FACTOR, MARGIN_MORE = 2.0, 0.2
"""A larger margin is so many times the old one, and so much more, m."""

BACK = 1.0
"""A beam that marks a cell begins this far before it, m: beyond the range that a map drops."""

BEFORE = 1.0
"""Before a contact things are put right so long before the last chance, s: it takes a moment."""

STEP = 6.0
"""Log-odds that one mark carries a cell by, from either clamp across the middle."""

POSE_PERTURBATIONS = ("pose_drift", "pose_jump")
ERRORS = {one.name for one in fields(OdometryConfig)} - {"rate", "correlation_time"}
EXACT = OdometryConfig(**dict.fromkeys(ERRORS, 0.0))


@dataclass(frozen=True)
class Check:
    """What one change would have done.

    Attributes:
        remedy: Which, one of `REMEDIES`.
        outcome: Of the episode with it.
        end_s: When that ended, in simulated time.
        saves: Whether the robot came to the goal; or, where it had touched something, to no harm.
    """

    remedy: str
    outcome: str
    end_s: float
    saves: bool


def check(log: Log, finding: Finding, remedies: Sequence[str] = ()) -> list[Check]:
    """Try remedies from a second before a failure's last chance on.

    Args:
        log: Of the failure.
        finding: Its cause.
        remedies: Of `REMEDIES`; all if none are named.

    Raises:
        InputError: The log keeps no state there, does not replay, or its movers are not known.
    """
    case = read_case(log)
    if case.moments[0].truth.movers and not rebuild(log).world.movers:
        raise InputError(
            f"log '{log.path}': --check: nobody knows how the movers of world "
            f"'{log.config.world}' go on, expected a world of 'wayproof list'"
        )
    touched = log.result["outcome"] in ("collision", "fall")
    earlier = BEFORE if touched else 0.0
    before_ns = case.moments[finding.decision].time_ns - round(earlier * 1e9)
    at = sum(moment.time_ns < before_ns for moment in case.moments)
    log, case = log.as_of(at), case.as_of(at)
    harm = ("collision", "fall", "out_of_bounds", "error")
    checks = []
    for name in remedies or REMEDIES:
        result = REMEDIES[name](log, case, at)
        survived = touched and result.outcome not in harm
        saves = result.outcome == "success" or survived
        checks.append(Check(name, result.outcome, result.sim_time_s, saves))
    return checks


def true_pose(log: Log, case: Case, at: int) -> Result:
    """The map as it would be by the true poses, and no error of the pose from then on."""
    config = replace(log.config, odometry=replace(EXACT, rate=log.config.odometry.rate))
    if _perturbed(config, *POSE_PERTURBATIONS):
        config = replace(config, perturbation=None)

    def inform(navigator: Navigator) -> Navigator:
        *before, last = case.runs
        relay = Relay([*before, replace(last, config=config)])
        for moment in case.moments[:at]:
            relay.watch(_truly_placed(moment))
        informed = relay.go_to(at)
        informed.adopt(navigator.memory, navigator.chain)
        return informed

    return _go_on(log, case, at, config, inform, forget=("estimate",))


def true_map(log: Log, case: Case, at: int) -> Result:
    """Everything as it truly was at each decision."""

    def inform(navigator: Navigator) -> Navigator:
        told: list[TrueCells] = []

        def tell(inputs: Inputs) -> None:
            then = case.moments[min(inputs.sequence, len(case.moments) - 1)]
            case.space.place_movers(then.truth)
            if not told or then.truth.movers:
                told[:] = [true_cells(case, navigator)]
            mark_truth(navigator, told[0], inputs)

        navigator.informant = tell
        return navigator

    config = replace(log.config, map=replace(log.config.map, hit=STEP, miss=STEP))
    return _go_on(log, case, at, config, inform)


def larger_margin(log: Log, case: Case, at: int) -> Result:
    """More distance from everything."""
    old = log.config.map
    margin = MARGIN_FACTOR * old.inflation_margin + MARGIN_MORE
    return _go_on(log, case, at, replace(log.config, map=replace(old, inflation_margin=margin)))


def no_delay(log: Log, case: Case, at: int) -> Result:
    """Decisions take effect as they are made."""
    deadline = log.config.latency.deadline
    latency = LatencyConfig(sense=0.0, map=0.0, plan=0.0, deadline=deadline)
    config = replace(log.config, latency=latency)
    if _perturbed(config, "latency"):
        config = replace(config, perturbation=None)
    return _go_on(log, case, at, config, at_once=True)


REMEDIES: dict[str, Callable[[Log, Case, int], Result]] = {
    "true_pose": true_pose,
    "true_map": true_map,
    "larger_margin": larger_margin,
    "no_delay": no_delay,
}
"""What is put right, one thing at a time."""


def _go_on(
    log: Log,
    case: Case,
    at: int,
    config: Config,
    inform: Callable[[Navigator], Navigator] | None = None,
    forget: tuple[str, ...] = (),
    at_once: bool = False,
) -> Result:
    """Simulate on from a decision with another config, and a navigator told more."""
    limit = case.end_s + MORE_TIME
    if case.contact is None:  # all its time again, for there may be all the way to go
        limit = case.moments[at].time_ns * 1e-9 + log.config.episode.time_limit
    config = replace(config, episode=replace(config.episode, time_limit=limit))
    scenario = rebuild(log, config)
    scenario = replace(scenario, mission=case.mission)
    past: Past = live_through(log, at, scenario)
    navigator = past.navigator if inform is None else inform(past.navigator)
    with tempfile.TemporaryDirectory() as folder:
        head = to_json(scenario.config), scenario.mission.to_json(), scenario.scene.mjcf
        with LogWriter(Path(folder) / "check.mcap", *head) as writer:
            writer.record = "decisions"
            episode = Episode(scenario, navigator, writer)
            for part in forget:
                del episode.parts[part]
            if not at_once:
                delay = float(np.median([one.latency.delay_s for one in case.moments]))
                episode.delays.update(dict.fromkeys(range(at, at + MOST), delay))
            episode.go_on(past.state, past.trajectories, past.decisions, past.truths)
            return episode.run()


def _perturbed(config: Config, *kinds: str) -> bool:
    return config.perturbation is not None and config.perturbation.kind in kinds


def _truly_placed(moment: Moment) -> Inputs:
    """A moment's inputs with its sweeps where the body truly was."""
    inputs = moment.inputs
    pose = replace(
        inputs.pose,
        position=moment.true_position,
        quaternion=np.array(moment.truth.quaternion),
        trail=None,
    )
    return replace(inputs, pose=pose)


@dataclass(frozen=True)
class TrueCells:
    """Centres of cells (n, 3), and whether something stands in each (n,)."""

    centres: Array
    occupied: NDArray[np.bool_]


def true_cells(case: Case, navigator: Navigator) -> TrueCells:
    """The cells of a map's region as they truly are, with the movers where they were placed."""
    size, costmap = navigator.map.resolution, navigator.costmap
    corner = costmap.origin.copy()
    if case.mission.motion == "air":
        grid = true_occupancy(case, navigator)
    else:
        below = int(np.ceil(max(-case.mission.low[2], 0.0) / size))
        corner[2] += size * (np.floor(-corner[2] / size) - below)
        layers = int(np.ceil((case.mission.height - corner[2]) / size))
        grid = case.space.occupied(corner, (*costmap.shape[:2], layers), size)
        # The floor's layer, and those below: what was taken for free there is a hole to the stack.
        grid[:, :, : below + 1] |= _floor(case, corner, grid.shape[:2], size)[:, :, None]
    cells = np.moveaxis(np.indices(grid.shape), 0, -1).reshape(-1, 3)
    return TrueCells(corner + (cells + 0.5) * size, grid.ravel())


def _floor(
    case: Case, corner: Array, shape: tuple[int, ...], size: float
) -> NDArray[np.bool_]:  # (nx, ny)
    """Which columns have a floor to stand on."""
    x, y = np.meshgrid(*((np.arange(n) + 0.5) * size for n in shape), indexing="ij")
    spots = np.stack([corner[0] + x, corner[1] + y, np.zeros_like(x)], axis=-1)
    return case.space.borne(spots.reshape(-1, 3)).reshape(shape)


def mark_truth(navigator: Navigator, truth: TrueCells, inputs: Inputs) -> None:
    """Tell a map by beams of its own what truly stands where, and where nothing does.

    A beam that ends in each occupied cell, and for each free one a beam without return that is no
    longer than the cell; in one sweep occupied wins, so no beam harms another's cell.
    """
    voxel_map, size = navigator.map, navigator.map.resolution
    free = truth.centres[~truth.occupied]
    solid = truth.centres[truth.occupied]
    back = max(BACK, 1.1 * voxel_map.config.minimum_range)
    _cast(voxel_map, free, 0.2 * size, int(NO_RETURN), 0.4 * size, inputs.time_ns)
    _cast(voxel_map, solid, back, round(back * 1e3), 2.0 * back, inputs.time_ns)


def _cast(
    voxel_map: Representation, ends: Array, back: float, range_mm: int, limit: float, time_ns: int
) -> None:
    """Beams straight down from so far above points (n, 3), as one sweep."""
    count = len(ends)
    if not count:
        return
    voxel_map.integrate(
        ends + np.array([0.0, 0.0, back]),
        np.tile([0.0, 0.0, -1.0], (count, 1)),
        np.full(count, range_mm, np.uint16),
        limit,
        time_ns,
        np.arange(count, dtype=np.int32),
    )
