"""Run one episode into a log: head, loop, cause of a failure, result."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.config_document import left_open, to_json
from wayproof.harness.episode import Episode
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Beams
from wayproof.harness.interface.build import live_navigator
from wayproof.harness.interface.connect import PredictorSession, Session
from wayproof.harness.interface.predictors.live import predictions_for
from wayproof.harness.log.copy import thin
from wayproof.harness.log.writer import (
    ASKED,
    PLUGINS,
    PREDICTOR_STDERR,
    STDERR,
    LogWriter,
    hold_log,
)
from wayproof.harness.mission import Mission
from wayproof.harness.outputs import Draft
from wayproof.harness.recompute.moments import Observer
from wayproof.harness.result import Result
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.prediction import Predictions
from wayproof.harness.supervision import announce
from wayproof.harness.user_code import bounded, plugin_digests

NavigatorFactory = Callable[[Config, Mission, Mapping[str, Beams]], Navigator]


def run_episode(
    scenario: Scenario,
    log_path: Path | Draft,
    observe: Observer | None = None,
    delays: Mapping[int, float] | None = None,
    record: str | None = None,
    stack: NavigatorFactory | None = None,
    session: Session | None = None,
    predictions: Predictions | None = None,
    until: int | None = None,
) -> Result:
    """Run one episode and write its log.

    Args:
        scenario: Scenario of the episode.
        log_path: Final name of the log, or a draft that holds it; a log of that name is replaced.
        observe: Called with each decision after it was made.
        delays: Delays of each decision, s, to live through those of a log instead of measured ones.
        record: Extent of the log in place of the config's `record`.
        stack: Stack in place of the built-in one.
        session: Session in place of the stack that the config names, such as a log's recorded
            answers; without one a stack of the user's own is run.
        predictions: Predictions in place of the predictor from outside that the config names, such
            as those of a log; without them it is run.
        until: Number of the decision after which the episode is abandoned; by default none.

    Raises:
        InputError: No map can be made for the mission, or the log cannot be written.
        Exception: A fault of Wayproof's own ended the episode; its log is finished as `error`.
    """
    with open_episode(scenario, log_path, observe, stack, session, predictions) as opened:
        opened.episode.delays.update(delays or {})
        opened.episode.run(until)
        return opened.end(record)


@dataclass(frozen=True)
class OpenEpisode:
    """An episode under way, with its log.

    Attributes:
        episode: The episode.
        scenario: Scenario of the episode.
        navigator: The stack under test, or what stands for one on trial.
        log: Partial until the episode has ended.
        draft: The log's name.
        session: Stack on trial, if it is run.
        predictor: Predictor from outside, if one is run.
    """

    episode: Episode
    scenario: Scenario
    navigator: Navigator
    log: LogWriter
    draft: Draft
    session: Session | None
    predictor: PredictorSession | None = None

    def end(self, record: str | None = None) -> Result:
        """Write the result of the episode, which has ended, and give the log its name.

        Args:
            record: Extent of the log in place of the config's `record`.

        Raises:
            Exception: A fault of Wayproof's own ended the episode; its log is finished as `error`.
        """
        assert self.episode.result is not None
        with publishing_failures(self.draft, self.log):
            if self.session is not None and (text := self.session.stderr()):
                self.log.attach(STDERR, bounded(text))
            if self.predictor is not None and (text := self.predictor.stderr()):
                self.log.attach(PREDICTOR_STDERR, bounded(text))
            result = self.episode.result
            if result.outcome not in ("success", "error") and result.decisions:
                from wayproof.harness.attribution.procedure import with_cause  # slow to load

                result = with_cause(result, self.scenario, self.log)
            result = finish(self.episode, self.log, result)
        return settle_log(self.draft, result, record or self.scenario.config.record)


@contextlib.contextmanager
def open_episode(
    scenario: Scenario,
    log_path: Path | Draft,
    observe: Observer | None = None,
    stack: NavigatorFactory | None = None,
    session: Session | None = None,
    predictions: Predictions | None = None,
) -> Iterator[OpenEpisode]:
    """Begin an episode and its log, which stays partial unless the episode is ended.

    Args:
        scenario: Scenario of the episode.
        log_path: As of `run_episode`.
        observe: As of `run_episode`.
        stack: As of `run_episode`.
        session: As of `run_episode`.
        predictions: As of `run_episode`.

    Raises:
        InputError: No map can be made for the mission, or the log cannot be written.
    """
    redirect_mujoco_warnings()
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    config, mission = to_json(scenario.config), scenario.mission.to_json()
    with (
        _navigator(scenario, infos, stack, session) as (navigator, session),
        _predictions(scenario, infos, predictions) as (navigator.predictions, predictor),
        log_path if isinstance(log_path, Draft) else hold_log(log_path) as draft,
        LogWriter(draft, config, mission, scenario.scene.mjcf) as log,
    ):
        if scenario.asked is not None:
            log.note(ASKED, left_open(scenario.asked))
        if digests := plugin_digests(scenario.config):
            log.note(PLUGINS, digests)
            announce(log.path)
        for info in infos:
            log.write(f"/sensor/{info.name}/info", info, 0)
        episode = Episode(scenario, navigator, log, observe)
        yield OpenEpisode(
            episode=episode,
            scenario=scenario,
            navigator=navigator,
            log=log,
            draft=draft,
            session=session,
            predictor=predictor,
        )


@contextlib.contextmanager
def _navigator(
    scenario: Scenario,
    infos: list[pb.SensorInfo],
    stack: NavigatorFactory | None,
    session: Session | None,
) -> Iterator[tuple[Navigator, Session | None]]:
    """Yield the navigator of a scenario, and the stack on trial behind it."""
    config, mission = scenario.config, scenario.mission
    if stack is not None:
        yield stack(config, mission, {info.name: beams_from_info(info) for info in infos}), None
        return
    sensors = {info.name: info for info in infos}
    with live_navigator(config, mission, sensors, session) as live:
        yield live


@contextlib.contextmanager
def _predictions(
    scenario: Scenario, infos: list[pb.SensorInfo], given: Predictions | None
) -> Iterator[tuple[Predictions | None, PredictorSession | None]]:
    """Yield the given predictions, or those of the predictor that a scenario names."""
    if given is not None:
        yield given, None
        return
    period_s = 1.0 / infos[0].rate_hz
    with predictions_for(scenario.config, scenario.mission, period_s) as found:
        yield found


def finish(episode: Episode, log: LogWriter, result: Result) -> Result:
    """Write the result of an episode that has been run.

    Raises:
        Exception: What Wayproof's own code raised in it.
    """
    log.finish(result.to_metadata())
    if episode.fault is not None:
        raise episode.fault
    return result


@contextlib.contextmanager
def publishing_failures(draft: Draft, log: LogWriter) -> Iterator[None]:
    """Give a log its name although the block raised, if it was finished before that."""
    try:
        yield
    except BaseException:
        if log.finished:
            draft.publish()
        raise


def settle_log(draft: Draft, result: Result, kept: str) -> Result:
    """Drop the parts of a finished log that `Config.record` does not keep, and name it.

    Returns:
        The result with the log's size.
    """
    thinned = None
    if kept == "decisions" or (kept == "failures" and result.outcome == "success"):
        thinned = draft.path.with_name(f"{draft.path.name}.thin")
        thin(draft.partial, thinned)
    draft.publish(thinned)
    size = draft.path.stat().st_size
    minutes = result.sim_time_s / 60.0
    return replace(result, log_mb_per_min=1e-6 * size / minutes if minutes else 0.0)
