"""Remedies: simulations resumed from a decision with one thing put right."""

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
from wayproof.harness.config import Config, LatencyConfig
from wayproof.harness.config_document import to_json
from wayproof.harness.counterfactual.recorded_movers import NEVER, with_recorded_movers
from wayproof.harness.counterfactual.true_cells import TrueCells, mark_truth, true_cells
from wayproof.harness.episode import Episode
from wayproof.harness.inputs import Inputs
from wayproof.harness.interface.connect import Session
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.reader import Log
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.perturbations.perturbation import Changes
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.prior_config import NO_PRIOR
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.answers import RecordedPredictions, RestartedStack
from wayproof.harness.replay.fork import live_through
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.pose_model import PoseModelConfig
from wayproof.models.robots import Controller, Setpoint
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import make_caster
from wayproof.models.sensors.devices import Mount, RangeNoise
from wayproof.models.worlds.movers import MoverState, Traffic
from wayproof.planners import PlannerConfig

Array = NDArray[np.float64]

MOST = 100_000
"""Bound of the number of decisions after a last chance."""

MARGIN_FACTOR, MARGIN_MORE = 2.0, 0.2
"""Factor, and addition, m, that make a larger margin."""

MORE_SEARCH = 20_000
"""Iterations of a search that does not give up early."""

MORE_LIMIT = 4.0
"""Factor of a longer time limit."""

STEP = 6.0
"""Log-odds of one mark, from either clamp across the middle."""

ERRORS = {one.name for one in fields(PoseModelConfig)} - {"rate", "correlation_time"}
EXACT = PoseModelConfig(**dict.fromkeys(ERRORS, 0.0))


Movers = Callable[[], Sequence[MoverState]]
"""Function that returns the current states of all movers."""


@dataclass(frozen=True)
class Change:
    """Change by a remedy.

    Attributes:
        config: Settings with the remedy.
        scenario: Change of the simulation; by default none.
        stack: Change of the stack, given the states of all movers; by default none.
        forget: Parts of the state of the simulator that are reset.
        at_once: Whether decisions take effect at once, whatever their delay in the log.
    """

    config: Config
    scenario: Callable[[Scenario], Scenario] = field(default=lambda scenario: scenario)
    stack: Callable[[Navigator, Movers], None] = field(default=lambda navigator, movers: None)
    forget: tuple[str, ...] = ()
    at_once: bool = False


def nothing(log: Log, case: Case) -> Change:
    """Continue the episode unchanged, as the control."""
    return Change(log.config)


def true_pose(log: Log, case: Case) -> Change:
    """Return poses without error."""
    config = replace(
        log.config,
        estimate=replace(log.config.estimate, kind="truth"),
        pose_model=replace(EXACT, rate=log.config.pose_model.rate),
    )
    return Change(_unperturbed(config, "pose", "pose_arrivals"), forget=("estimate",))


def true_ranges(log: Log, case: Case) -> Change:
    """Take sensors without errors and without a minimum range, whose returns all enter the map."""
    config = replace(log.config, map=replace(log.config.map, minimum_range=0.0, no_return="free"))

    def exact(scenario: Scenario) -> Scenario:
        scene, sensors = scenario.scene, scenario.config.sensors
        casters = tuple(
            make_caster(
                scene.model,
                mount=_exact(one.mount),
                base=scene.base,
                prefix=ROBOT_PREFIX,
                config=sensors,
            )
            for one in scene.casters
        )
        return replace(scenario, scene=replace(scene, casters=casters))

    return Change(_unperturbed(config, "ranges"), scenario=exact)


def true_map(log: Log, case: Case) -> Change:
    """Set every cell of the map to its true state at each decision."""
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
    """Forbid unknown space, also where a prior map has it free."""
    config = log.config
    prior = replace(config.prior, policy="guide") if admits_by_prior(config) else config.prior
    costmap = replace(config.costmap, unknown_policy="forbid")
    return Change(replace(config, costmap=costmap, prior=prior))


def admits_by_prior(config: Config) -> bool:
    """Return whether free space of a prior map lets the robot in where nothing was measured."""
    return config.prior.source != NO_PRIOR and config.prior.policy == "admit"


def larger_margin(log: Log, case: Case) -> Change:
    """Enlarge the margin."""
    old = log.config.costmap
    margin = MARGIN_FACTOR * old.localization_margin + MARGIN_MORE
    return Change(replace(log.config, costmap=replace(old, localization_margin=margin)))


def no_movers(log: Log, case: Case) -> Change:
    """Remove all movers."""

    def still(scenario: Scenario) -> Scenario:
        gone = tuple(
            replace(one, appears=NEVER, vanishes=2.0 * NEVER) for one in scenario.world.movers
        )
        return replace(scenario, world=replace(scenario.world, movers=gone))

    return Change(log.config, scenario=still)


def perfect_tracking(log: Log, case: Case) -> Change:
    """Hold the body exactly at its setpoints, upright and with its joints at rest."""

    def carried(scenario: Scenario) -> Scenario:
        scene = scenario.scene
        controller = Carried(scene.controller, scene.model, scenario)
        return replace(scenario, scene=replace(scene, controller=controller))

    default = type(log.config.behaviour)().tracking_tolerance
    tolerance = max(log.config.behaviour.tracking_tolerance, default)
    behaviour = replace(log.config.behaviour, tracking_tolerance=tolerance)
    return Change(replace(log.config, behaviour=behaviour), scenario=carried)


def fresh_evidence(log: Log, case: Case) -> Change:
    """Let every sweep and every pose arrive when it is sent, with its own stamp."""
    return Change(_unperturbed(log.config, "arrivals", "pose_arrivals"))


def no_delay(log: Log, case: Case) -> Change:
    """Remove delays."""
    deadline = log.config.latency.deadline
    latency = LatencyConfig(sense=0.0, map=0.0, plan=0.0, deadline=deadline)
    config = _unperturbed(replace(log.config, latency=latency), "delay")
    return Change(config, at_once=True)


def more_search(log: Log, case: Case) -> Change:
    """Use the default planner with many more iterations than it needs."""
    return Change(replace(log.config, planner=PlannerConfig(iterations=MORE_SEARCH)))


def no_margin(log: Log, case: Case) -> Change:
    """Remove the margin: the body may pass wherever it fits."""
    return Change(replace(log.config, costmap=replace(log.config.costmap, localization_margin=0.0)))


def more_time(log: Log, case: Case) -> Change:
    """Prolong the time limit several times."""
    old = log.config.episode
    limit = min(MORE_LIMIT * old.time_limit + 30.0, 3600.0)
    return Change(replace(log.config, episode=replace(old, time_limit=limit)))


def guard(log: Log, case: Case) -> Change:
    """Let the guard brake in place of a stack on trial, from the first command on that it cuts."""
    return Change(replace(log.config, stack=replace(log.config.stack, guard=True)))


def no_guard(log: Log, case: Case) -> Change:
    """Let a stack on trial do as it commands, without the guard."""
    return Change(replace(log.config, stack=replace(log.config.stack, guard=False)))


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
    "fresh_evidence": (fresh_evidence, ("frozen_evidence", "stale_evidence")),
    "no_delay": (no_delay, ("latency", "plugin_failed")),
    "more_search": (more_search, ("planner",)),
    "no_margin": (no_margin, ("impossible",)),
    "more_time": (more_time, ("impossible",)),
    "guard": (guard, ("disregarded_obstacle", "unseen_obstacle")),
    "no_guard": (no_guard, ("stack_held",)),
}
"""Remedies by name, each with the causes that it confirms if it saves the robot."""

ON_TRIAL = (
    "guard", "no_guard", "true_pose", "true_ranges", "no_movers", "perfect_tracking", "no_delay",
    "fresh_evidence", "more_time",
)  # fmt: skip
"""Remedies that change something for a stack on trial: the referee's map is no input of it."""


def go_on(
    log: Log,
    case: Case,
    change: Change,
    at: int,
    limit_s: float,
    restarted: RestartedStack | None = None,
    session: Session | None = None,
) -> Result:
    """Resume the simulation at a decision with a change, up to a time.

    Args:
        log: Log of the episode.
        case: The episode.
        change: Change by a remedy.
        at: Number of the decision.
        limit_s: Simulated time of the end, s.
        restarted: A stack on trial that continues from there.
        session: Answers in its place.
    """
    config = change.config
    if config.episode.time_limit == log.config.episode.time_limit:
        config = replace(config, episode=replace(config.episode, time_limit=limit_s))
    scenario = replace(rebuild(log, config), mission=case.segments[-1].mission)  # all its goals
    scenario = change.scenario(with_recorded_movers(scenario, case))
    past = live_through(log, at, scenario, restarted)
    if is_outside(log.config.prediction.source):  # it is not run again
        past.navigator.predictions = RecordedPredictions(log)
    if session is not None and isinstance(past.navigator, TrialNavigator):
        past.navigator.session = session
    with tempfile.TemporaryDirectory() as folder:
        head = to_json(scenario.config), scenario.mission.to_json(), scenario.scene.mjcf
        with LogWriter(Path(folder) / "check.mcap", *head) as writer:
            writer.record = "decisions"  # it is discarded
            episode = Episode(scenario, past.navigator, writer)
            traffic = episode.parts.get("traffic")
            change.stack(past.navigator, traffic.states if isinstance(traffic, Traffic) else list)
            for part in change.forget:
                del episode.parts[part]
            if not change.at_once:
                episode.delays.update(_delays(case))
            episode.resume(past.state, past.trajectories, past.decisions, past.truths, past.seen)
            return episode.run()


def _delays(case: Case) -> dict[int, float]:
    """Return the delays of the log, and their median after its end."""
    delays = [one.latency.delay_s for one in case.moments]
    after = dict.fromkeys(range(len(delays), MOST), float(np.median(delays)))
    return {**dict(enumerate(delays)), **after}


def _unperturbed(config: Config, *changes: Changes) -> Config:
    """Return the settings without a perturbation that changes one of these."""
    if config.perturbation is None or config.perturbation.changes not in changes:
        return config
    return replace(config, perturbation=None)


def _exact(mount: Mount) -> Mount:
    """Return a mount with a device without errors."""
    device = mount.device
    exact = replace(device, noise=RangeNoise(), minimum_range=0.0, no_return_is_free=True)
    return replace(mount, device=exact)


class Carried(Controller):
    """Controller that places the body at its setpoint before each physics step."""

    def __init__(self, own: Controller, model: mujoco.MjModel, scenario: Scenario) -> None:
        """Store the joints at rest of the robot's own controller."""
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
        """Reset the robot's own controller."""
        self._own.reset(data, position, heading)

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Place the body at the setpoint, with its velocity."""
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
        """Return the state of the robot's own controller."""
        return self._own.state()

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Restore the state of the robot's own controller."""
        self._own.restore(state)
