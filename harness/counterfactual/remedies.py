"""Going on with one thing put right: what each remedy changes, and from which decision on."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case
from wayproof.harness.config import Config, LatencyConfig, to_json
from wayproof.harness.counterfactual.recorded_movers import with_recorded_movers
from wayproof.harness.counterfactual.true_cells import TrueCells, mark_truth, true_cells
from wayproof.harness.episode import Episode
from wayproof.harness.inputs import Inputs
from wayproof.harness.log.reader import Log
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.perturbations.perturbation import Changes
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.fork import live_through
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.odometry import OdometryConfig
from wayproof.models.robots import Controller, Setpoint
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import make_caster
from wayproof.models.sensors.devices import Mount, RangeNoise
from wayproof.models.worlds.traffic import MoverState, Traffic
from wayproof.planners import PlannerConfig

Array = NDArray[np.float64]

MOST = 100_000
"""No episode has more decisions after its last chance."""

MARGIN_FACTOR, MARGIN_MORE = 2.0, 0.2
"""A larger margin is so many times the old one, and so much more, m."""

MORE_SEARCH = 20_000
"""Iterations of a search that does not give up early."""

MORE_LIMIT = 4.0
"""A longer limit is so many times the old one."""

STEP = 6.0
"""Log-odds that one mark carries a cell by, from either clamp across the middle."""

NEVER = 1e9
"""A mover that appears at this time does not, s."""

ERRORS = {one.name for one in fields(OdometryConfig)} - {"rate", "correlation_time"}
EXACT = OdometryConfig(**dict.fromkeys(ERRORS, 0.0))


Movers = Callable[[], Sequence[MoverState]]
"""Where all that moves is at the time of asking."""


@dataclass(frozen=True)
class Change:
    """What a remedy puts right.

    Attributes:
        config: The settings with it.
        scenario: Changes the simulation; nothing by default.
        stack: Changes the stack, which may ask where all that moves is; nothing by default.
        forget: Parts of the simulator's state that begin anew.
        at_once: Decisions take effect at once, whatever they took in the log.
    """

    config: Config
    scenario: Callable[[Scenario], Scenario] = field(default=lambda scenario: scenario)
    stack: Callable[[Navigator, Movers], None] = field(default=lambda navigator, movers: None)
    forget: tuple[str, ...] = ()
    at_once: bool = False


def nothing(log: Log, case: Case) -> Change:
    """The control: the episode goes on as it did."""
    return Change(log.config)


def true_pose(log: Log, case: Case) -> Change:
    """The pose has no error."""
    config = replace(log.config, odometry=replace(EXACT, rate=log.config.odometry.rate))
    return Change(_unperturbed(config, "pose"), forget=("estimate",))


def true_ranges(log: Log, case: Case) -> Change:
    """Every sensor measures without an error, as near as it may be, and the map takes all of it."""
    config = replace(log.config, map=replace(log.config.map, minimum_range=0.0))

    def exact(scenario: Scenario) -> Scenario:
        scene, sensors = scenario.scene, scenario.config.sensors
        casters = tuple(
            make_caster(
                scene.model, _exact(one.mount), scene.base, ROBOT_PREFIX, sensors, config.threads
            )
            for one in scene.casters
        )
        return replace(scenario, scene=replace(scene, casters=casters))

    return Change(_unperturbed(config, "ranges"), scenario=exact)


def true_map(log: Log, case: Case) -> Change:
    """Every cell is marked as it truly is, at each decision."""
    marks: list[TrueCells] = []

    def inform(navigator: Navigator, movers: Movers) -> None:
        def mark(inputs: Inputs) -> None:
            now = pb.Truth()
            for mover in movers():
                now.movers.add(**mover._asdict())
            case.space.place_movers(now)
            if not marks or now.movers:
                marks[:] = [true_cells(case, navigator)]
            mark_truth(navigator, marks[0], inputs)

        navigator.mapper.on_integrated = mark

    config = replace(log.config, map=replace(log.config.map, log_odds_hit=STEP, log_odds_miss=STEP))
    return Change(config, stack=inform)


def forbidden_unknown(log: Log, case: Case) -> Change:
    """Unknown space is not entered."""
    return Change(replace(log.config, costmap=replace(log.config.costmap, unknown_policy="forbid")))


def larger_margin(log: Log, case: Case) -> Change:
    """More distance from everything."""
    old = log.config.costmap
    margin = MARGIN_FACTOR * old.localization_margin + MARGIN_MORE
    return Change(replace(log.config, costmap=replace(old, localization_margin=margin)))


def no_movers(log: Log, case: Case) -> Change:
    """Nothing moves by itself, for all that moves is gone."""

    def still(scenario: Scenario) -> Scenario:
        gone = tuple(
            replace(one, appears=NEVER, vanishes=2.0 * NEVER) for one in scenario.world.movers
        )
        return replace(scenario, world=replace(scenario.world, movers=gone))

    return Change(log.config, scenario=still)


def perfect_tracking(log: Log, case: Case) -> Change:
    """The body is wherever its setpoints are, at rest in its joints and upright."""

    def carried(scenario: Scenario) -> Scenario:
        scene = scenario.scene
        controller = Carried(scene.controller, scene.model, scenario)
        return replace(scenario, scene=replace(scene, controller=controller))

    default = type(log.config.behaviour)().tracking_tolerance
    tolerance = max(log.config.behaviour.tracking_tolerance, default)
    behaviour = replace(log.config.behaviour, tracking_tolerance=tolerance)
    return Change(replace(log.config, behaviour=behaviour), scenario=carried)


def no_delay(log: Log, case: Case) -> Change:
    """Decisions take effect as they are made, and every sweep arrives."""
    deadline = log.config.latency.deadline
    latency = LatencyConfig(sense=0.0, map=0.0, plan=0.0, deadline=deadline)
    config = _unperturbed(replace(log.config, latency=latency), "delay", "arrivals")
    return Change(config, at_once=True)


def more_search(log: Log, case: Case) -> Change:
    """The default planner, with many more iterations than it needs."""
    return Change(replace(log.config, planner=PlannerConfig(iterations=MORE_SEARCH)))


def no_margin(log: Log, case: Case) -> Change:
    """The body may pass wherever it fits."""
    return Change(replace(log.config, costmap=replace(log.config.costmap, localization_margin=0.0)))


def more_time(log: Log, case: Case) -> Change:
    """The time limit is several times as long."""
    old = log.config.episode
    limit = min(MORE_LIMIT * old.time_limit + 30.0, 3600.0)
    return Change(replace(log.config, episode=replace(old, time_limit=limit)))


Remedy = Callable[[Log, Case], Change]

REMEDIES: dict[str, tuple[Remedy, tuple[str, ...]]] = {
    "true_pose": (true_pose, ("localization",)),
    "true_ranges": (true_ranges, ("perception",)),
    "true_map": (
        true_map,
        ("perception", "missed_obstacle", "unseen_obstacle", "ghost_obstacle"),
    ),
    "forbidden_unknown": (forbidden_unknown, ("unseen_obstacle",)),
    "larger_margin": (larger_margin, ("margin_too_small",)),
    "no_movers": (no_movers, ("moved_obstacle",)),
    "perfect_tracking": (perfect_tracking, ("tracking",)),
    "no_delay": (no_delay, ("latency",)),
    "more_search": (more_search, ("planner",)),
    "no_margin": (no_margin, ("impossible",)),
    "more_time": (more_time, ("impossible",)),
}
"""What is put right, one thing at a time, and the causes that it bears out if it saves."""


def go_on(log: Log, case: Case, change: Change, at: int, limit_s: float) -> Result:
    """Simulate on from a decision with a change, up to a time."""
    config = change.config
    if config.episode.time_limit == log.config.episode.time_limit:
        config = replace(config, episode=replace(config.episode, time_limit=limit_s))
    scenario = replace(rebuild(log, config), mission=case.mission)
    scenario = change.scenario(with_recorded_movers(scenario, case))
    past = live_through(log, at, scenario)
    with tempfile.TemporaryDirectory() as folder:
        head = to_json(scenario.config), scenario.mission.to_json(), scenario.scene.mjcf
        with LogWriter(Path(folder) / "check.mcap", *head) as writer:
            writer.record = "decisions"  # nobody reads it
            episode = Episode(scenario, past.navigator, writer)
            traffic = episode.parts.get("traffic")
            change.stack(past.navigator, traffic.states if isinstance(traffic, Traffic) else list)
            for part in change.forget:
                del episode.parts[part]
            if not change.at_once:
                episode.delays.update(_delays(case))
            episode.resume(past.state, past.trajectories, past.decisions, past.truths)
            return episode.run()


def _delays(case: Case) -> dict[int, float]:
    """Those of the log, and after its end their median."""
    delays = [one.latency.delay_s for one in case.moments]
    after = dict.fromkeys(range(len(delays), MOST), float(np.median(delays)))
    return {**dict(enumerate(delays)), **after}


def _unperturbed(config: Config, *changes: Changes) -> Config:
    """The settings without a perturbation that changes one of these."""
    if config.perturbation is None or config.perturbation.changes not in changes:
        return config
    return replace(config, perturbation=None)


def _exact(mount: Mount) -> Mount:
    """A mount with a device that makes no error."""
    device = mount.device
    exact = replace(device, noise=RangeNoise(), minimum_range=0.0, no_return_is_free=True)
    return replace(mount, device=exact)


class Carried(Controller):
    """In a controller's place: puts the body where it should be before each physics step."""

    def __init__(self, own: Controller, model: mujoco.MjModel, scenario: Scenario) -> None:
        """Keep the joints as the robot's own controller has them at rest."""
        self._own = own
        base = scenario.scene.base
        joint = int(model.body_jntadr[base])
        self._qpos, self._qvel = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        resting = mujoco.MjData(model)
        mission = scenario.mission
        own.reset(resting, np.array(mission.start), mission.start_heading)
        self._resting = resting.qpos.copy()
        self._on_ground = mission.planar

    def reset(self, data: mujoco.MjData, position: Array, heading: float) -> None:
        """As the robot's own controller does."""
        self._own.reset(data, position, heading)

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Put the body at the setpoint, with its velocity."""
        x, y, z, vx, vy, vz, heading, yaw_rate = setpoint.row.tolist()
        first, rate = self._qpos, self._qvel
        if self._on_ground:
            z, vz = float(self._resting[first + 2]), 0.0
        data.qpos[first:] = self._resting[first:]
        data.qpos[first : first + 3] = x, y, z
        data.qpos[first + 3 : first + 7] = np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)
        data.qvel[rate:] = 0.0
        data.qvel[rate : rate + 3] = vx, vy, vz
        data.qvel[rate + 5] = yaw_rate
        data.ctrl[:] = 0.0

    def state(self) -> dict[str, NDArray[Any]]:
        """Of the robot's own controller."""
        return self._own.state()

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Of the robot's own controller."""
        self._own.restore(state)
