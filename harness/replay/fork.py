"""Forks: the episode of a log resumed at a decision with other settings."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.config_document import override, to_json
from wayproof.harness.episode import Episode, arrival_ns
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs
from wayproof.harness.interface.connect import Session
from wayproof.harness.interface.predictors.live import predictions_for
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages, time_of, topic_of
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import Log, before, fork_note, open_log
from wayproof.harness.log.writer import PLUGINS, STDERR, LogWriter, hold_log
from wayproof.harness.recompute.moments import Observer, SegmentedStack, segments_of
from wayproof.harness.recompute.rebuild import rebuild, segment_of
from wayproof.harness.replay.answers import RestartedStack
from wayproof.harness.replay.fork_refusals import (
    refuse_goals,
    refuse_other_task,
    refuse_predictor,
    refuse_stack,
    refuse_unnamed_predictor,
)
from wayproof.harness.replay.what_if import refuse_sensed
from wayproof.harness.result import Result
from wayproof.harness.runner import finish, publishing_failures, settle_log
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.prediction import Predictions
from wayproof.harness.user_code import bounded, plugin_digests
from wayproof.planners import Trajectory

FIXED = ("world", "robot", "seed", "start")
"""Settings that determine the beginning of an episode and cannot change at a fork."""


@dataclass(frozen=True)
class Past:
    """State at a fork.

    Attributes:
        navigator: Stack with the new settings, in the state of the recorded one.
        trajectories: Committed trajectories before the fork, each after its time of arrival, ns.
        decisions: Decisions before it.
        truths: Ground truth of each.
        state: State of the simulator; None at the first decision.
        seen: Inputs of all decisions up to the fork, from which the map of an estimator that
            registers sweeps is made; none for the model of one.
    """

    navigator: Navigator
    trajectories: tuple[tuple[int, Trajectory], ...]
    decisions: tuple[pb.Decision, ...]
    truths: tuple[pb.Truth, ...]
    state: pb.State | None
    seen: tuple[Inputs, ...]


def fork(
    path: Path,
    at: int,
    settings: Sequence[str],
    target: Path,
    allow_plugins: bool = False,
    observe: Observer | None = None,
    restarted: RestartedStack | None = None,
) -> Result:
    """Simulate the episode of a log from one decision on with other settings.

    The new log begins with the inputs and decisions of the old one, so it replays like any other.

    Args:
        path: The log.
        at: Number of the first decision with the new settings.
        settings: Changes as `section.field=value`; with none, the episode ends as recorded.
        target: Name of the new log.
        allow_plugins: Whether code that its config names may be imported.
        observe: Called with each decision from there on after it was made.
        restarted: The stack that continues, where one was on trial, from `restarted_stack`: it is
            queried on all decisions before.

    Raises:
        InputError: There is no such log, decision or setting, no state was kept there, or a stack
            was on trial and none continues.
    """
    log = open_log(path, allow_plugins)
    if target.resolve() == path.resolve():
        raise InputError(f"--log {target}: the log itself, expected another name")
    before = log.as_of(at).config
    config = override(before, settings)
    refuse_unnamed_predictor(before, config, settings)
    if restarted is not None:
        config = replace(config, stack=replace(config.stack, name=restarted.stack))
    return fork_with(log, at, config, target, observe, restarted=restarted)


def fork_with(
    log: Log,
    at: int,
    config: Config,
    target: Path,
    observe: Observer | None = None,
    delays: Mapping[int, float] | None = None,
    record: str | None = None,
    restarted: RestartedStack | None = None,
    session: Session | None = None,
    predictions: Predictions | None = None,
    until: int | None = None,
) -> Result:
    """Simulate the episode of a log from one decision on with another config.

    Args:
        log: The log.
        at: Number of the first decision with the new config.
        config: New config.
        target: Name of the new log.
        observe: Called with each decision from there on after it was made.
        delays: Delay by decision, s, instead of measured ones.
        record: Extent of the new log; by default the config's `record`.
        restarted: The stack that continues, where one was on trial.
        session: Session in its place, such as recorded answers; no stack is queried before.
        predictions: Predictions in place of the predictor from outside that the config names, which
            is run.
        until: Number of the decision after which the episode is abandoned; by default none.

    Raises:
        InputError: A changed setting determines the beginning of the episode, there is no such
            decision, or no state was kept there.
    """
    log = log.as_of(at)
    refuse_sensed(log.config, config, "the episode had begun with it", FIXED)
    refuse_predictor(log.config, config)
    refuse_stack(log, config, goes_on=restarted is not None or session is not None)
    scenario = rebuild(log, config)
    refuse_goals(log, scenario, at)
    if restarted is not None:
        refuse_other_task(log, scenario)
    with hold_log(target) as draft:
        past = live_through(log, at, scenario, restarted)
        if session is not None and isinstance(past.navigator, TrialNavigator):
            past.navigator.session = session
        head = to_json(scenario.config), scenario.mission.to_json(), scenario.scene.mjcf
        with (
            LogWriter(draft, *head) as writer,
            _predictions(scenario, predictions) as past.navigator.predictions,
        ):
            if digests := plugin_digests(scenario.config):
                writer.note(PLUGINS, digests)
            _write_past(writer, log, at, scenario)
            episode = Episode(scenario, past.navigator, writer, observe)
            episode.delays.update(delays or {})
            episode.resume(past.state, past.trajectories, past.decisions, past.truths, past.seen)
            with publishing_failures(draft, writer):
                ended = episode.run(until)
                if restarted is not None and (text := restarted.session.stderr()):
                    writer.attach(STDERR, bounded(text))
                result = finish(episode, writer, ended)
        return settle_log(draft, result, record or config.record)


@contextlib.contextmanager
def _predictions(scenario: Scenario, given: Predictions | None) -> Iterator[Predictions | None]:
    """Yield the given predictions, or those of the predictor that a fork's settings name."""
    if given is not None:
        yield given
        return
    period_s = 1.0 / sensor_info(scenario.scene.casters[0]).rate_hz
    with predictions_for(scenario.config, scenario.mission, period_s) as (live, _):
        yield live


def live_through(
    log: Log, at: int, scenario: Scenario, restarted: RestartedStack | None = None
) -> Past:
    """Run the stacks of a log, and that of a scenario, through all decisions before a fork.

    Args:
        log: The log.
        at: Number of the decision that the fork begins with.
        scenario: Scenario of the fork.
        restarted: A stack that is queried on each of these decisions, and continues at the fork.

    Raises:
        InputError: The log does not replay, has no such decision, or no state there.
    """
    stack = SegmentedStack([*segments_of(log), segment_of(scenario, at)])
    if restarted is not None and isinstance(stack.navigator, TrialNavigator):
        stack.navigator.session = restarted.session
    trajectories, decisions, seen = [], [], []
    state, reached = None, False
    for record in log.records():
        if scenario.config.estimate.kind == "lidar":
            seen.append(record.inputs)
        if record.decision.sequence == at:
            state, reached = record.state, True
            break
        navigator = stack.go_to(record.decision.sequence)
        if restarted is not None and isinstance(navigator, TrialNavigator):
            restarted.query(navigator, record)
        recorded = stack.step(record)
        if recorded.chain != record.decision.chain:
            raise InputError(
                f"log '{log.path}': decision {recorded.sequence} is recomputed otherwise, so no "
                "fork would go on from it; expected a log that replays"
            )
        if not recorded.deadline_missed:
            trajectory = stack.navigator.trajectory
            trajectories.append((arrival_ns(recorded, trajectory), trajectory))
        decisions.append(recorded)
    if not reached:
        raise InputError(f"N: got {at}, expected a decision from 0 to {len(decisions) - 1}")
    if state is None and at > 0:
        raise InputError(
            f"log '{log.path}': no state kept at decision {at} (record = '{log.config.record}'); "
            "replay simulate --log FILE writes it in full"
        )
    truths = [truth for truth in log.truth() if truth.sequence < at]
    if len(truths) != len(decisions):
        raise InputError(f"log '{log.path}': {len(truths)} truths before decision {at}")
    return Past(
        navigator=stack.go_to(at),
        trajectories=tuple(trajectories),
        decisions=tuple(decisions),
        truths=tuple(truths),
        state=state,
        seen=tuple(seen),
    )


def _write_past(writer: LogWriter, log: Log, at: int, scenario: Scenario) -> None:
    """Write all forks, all beam tables, and every message before the fork."""
    runs = segments_of(log)
    for number, (run, after) in enumerate(zip(runs, [*runs[1:], None], strict=True), 1):
        fields = {
            "at": str(at if after is None else after.begin),
            "config": to_json(run.config).decode(),
            "mission": run.mission.to_json().decode(),
        }
        writer.note(fork_note(number), fields)
    for caster in scenario.scene.casters:
        info = sensor_info(caster)
        writer.write(f"/sensor/{info.name}/info", info, 0)
    head = read_head(walk(log.path, head_only=True), log.path, allow_plugins=True)
    groups = [before(number) for number in range(1, len(runs))]
    own = before(len(runs)) if before(len(runs)) in head.before else "/sensor/"
    for topic, info in head.tables:
        if topic.startswith(own):
            writer.write(f"{before(len(runs))}{info.name}", info, 0)
        elif topic.removesuffix(info.name) in groups:
            writer.write(topic, info, 0)
    for message in read_messages(log.path):
        if not isinstance(message, pb.SensorInfo) and message.sequence < at:  # type: ignore[attr-defined]
            writer.write(topic_of(message), message, time_of(message))


def fork_name(path: Path, at: int, config: Config) -> Path:
    """Return the default path of the log of a fork, beside the log that it is forked from."""
    import hashlib

    digest = hashlib.sha256(to_json(config)).hexdigest()[:8]
    return path.with_name(f"{path.stem}-from-{at}-{digest}.mcap")
