"""Construction of the navigator that a config names: the built-in stack, or a stack on trial."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Beams
from wayproof.harness.interface.connect import Session, ShowsReferee, connect, start_session
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.trial import ShadowTrialNavigator, TrialNavigator
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator, reported
from wayproof.harness.stack.pipeline import Navigator


def navigator_for(
    config: Config,
    mission: Mission,
    beams: Mapping[str, Beams],
    session: Session | None = None,
) -> Navigator:
    """Build the navigator of a mission.

    Args:
        config: Settings; `stack.name` is the stack.
        mission: Mission of the episode.
        beams: Sensor geometry by sensor name.
        session: The stack on trial; none where its answers come from a log.

    Raises:
        InputError: The map or the costmap cannot be made for this mission with these settings.
    """
    if config.stack.name == BUILTIN:
        return build_navigator(config, mission, beams)
    kind = TrialNavigator if config.recording is None else ShadowTrialNavigator
    return reported(config, lambda: kind(config, mission, beams, session))


@contextlib.contextmanager
def live_navigator(
    config: Config,
    mission: Mission,
    infos: Mapping[str, pb.SensorInfo],
    session: Session | None = None,
) -> Iterator[tuple[Navigator, Session | None]]:
    """Yield a navigator and the stack behind it, which is closed in the end.

    A predictor from outside is no part of it: see `predictions_for`.

    Args:
        config: Settings; `stack.name` is the stack.
        mission: Mission of the episode.
        infos: Sensors by name.
        session: Session in place of the stack that the config names; that one is run.

    Raises:
        NotStarted: The stack fails in its start.
        InputError: There is no such stack, or no map can be made for this mission.
    """
    beams = {name: beams_from_info(info) for name, info in infos.items()}
    if config.stack.name == BUILTIN:
        yield build_navigator(config, mission, beams), None
        return
    session = session or connect(config.stack.name, config.plugins.wall_s)
    try:
        navigator = navigator_for(config, mission, beams, session)
        if isinstance(session, ShowsReferee):
            session.show(navigator.costmap)
        start_session(session, task_of(config, mission, infos))
        yield navigator, session
    finally:
        session.close()
