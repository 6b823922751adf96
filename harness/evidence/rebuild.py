"""From a log back to a scenario that can be simulated: its own scene, not one made anew."""

from __future__ import annotations

from dataclasses import replace

from harness.config import Config
from harness.errors import InputError
from harness.evidence.twin import changed_mission
from harness.logs.reader import Log
from harness.mujoco_warnings import tell_warnings
from harness.robots import find_logged_robot
from harness.scenario import Scenario
from harness.scene_text import safe_scene
from harness.worlds import perturbed
from models.robots import ROBOTS
from models.scene import bind, resolve
from models.worlds import WORLDS, World


def rebuild(log: Log, config: Config | None = None) -> Scenario:
    """The scenario of a log.

    What is simulated is compiled from the scene in the log, so a world that is a file, or that this
    version would generate otherwise, is simulated as it was.

    Args:
        log: The log.
        config: In place of the log's own.

    Raises:
        InputError: The robot is unknown, or the scene is not one of this robot, or reaches outside
            itself.
    """
    config = config or log.config
    tell_warnings()
    text = safe_scene(log.scene)
    robot = find_logged_robot(config, text)
    try:
        config = replace(config, sensors=resolve(robot.spec.mounts, config.sensors))
        scene = bind(text, robot, config.sensors, config.threads)
    except (ValueError, KeyError, TypeError) as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene with '{config.robot}': {line}") from None
    return Scenario(
        config=config,
        world=_world(log),
        scene=replace(scene, mjcf=log.scene),
        mission=changed_mission(log.mission, log.config, config),
        spec=robot.spec,
        warnings=(),
    )


def scene_is_ours(log: Log) -> bool | None:
    """Whether this version makes the log's scene from its seed; none if part of it is a file."""
    from harness.scenario import build

    if log.config.world not in WORLDS or log.config.robot not in ROBOTS:
        return None
    return build(log.config).scene.mjcf == log.scene


def _world(log: Log) -> World:
    """The world as its seed makes it; of a world that is a file, what the mission tells."""
    if log.config.world in WORLDS:
        world = WORLDS[log.config.world](log.config.seed, log.config.difficulty)
        return perturbed(world, log.config)
    mission = log.mission
    return World(
        name=log.config.world,
        seed=log.config.seed,
        solids=(),
        low=mission.low,
        high=mission.high,
        start=mission.start,
        start_heading=mission.start_heading,
        goal=mission.goal,
    )
