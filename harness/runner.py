"""Run one episode into a log: head, loop, cause of a failure, result."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from wayproof.harness.attribution.attribution import with_cause
from wayproof.harness.config import to_json
from wayproof.harness.episode import Episode, Observer
from wayproof.harness.inputs import beams_from_info
from wayproof.harness.log.copy import thin
from wayproof.harness.log.writer import PLUGINS, LogWriter, hold_log
from wayproof.harness.outputs import Draft
from wayproof.harness.result import Result
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.supervision import announce
from wayproof.harness.user_code import plugin_digests


def run_episode(
    scenario: Scenario,
    log_path: Path | Draft,
    observe: Observer | None = None,
    delays: Mapping[int, float] | None = None,
    record: str | None = None,
    stack: type[Navigator] | None = None,
) -> Result:
    """Run one episode and write its log.

    Args:
        scenario: What to run.
        log_path: Final name of the log, or a draft that holds it; a log of that name is replaced.
        observe: Called after each decision, for display.
        delays: Of each decision, s, to live through those of a log instead of measured ones.
        record: What to keep in place of the config's `record`.
        stack: In place of the built-in one.

    Raises:
        InputError: No map can be made for the mission, or the log cannot be written.
        Exception: A fault of Wayproof's own ended the episode; its log is finished as `error`.
    """
    redirect_mujoco_warnings()
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    beams = {info.name: beams_from_info(info) for info in infos}
    navigator = (stack or build_navigator)(scenario.config, scenario.mission, beams)
    config, mission = to_json(scenario.config), scenario.mission.to_json()
    with log_path if isinstance(log_path, Draft) else hold_log(log_path) as draft:
        with LogWriter(draft, config, mission, scenario.scene.mjcf) as log:
            if digests := plugin_digests(scenario.config):
                log.note(PLUGINS, digests)
                announce(log.path)
            for info in infos:
                log.write(f"/sensor/{info.name}/info", info, 0)
            episode = Episode(scenario, navigator, log, observe)
            episode.delays.update(delays or {})
            with publishing_failures(draft, log):
                result = finish(episode, log, with_cause(episode.run(), scenario, log))
        return settle_log(draft, result, record or scenario.config.record)


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
    """Leave out of a finished log what `Config.record` does not keep, and give it its name.

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
