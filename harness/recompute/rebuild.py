"""Scenario of a log, with the logged scene, to simulate it again."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, replace

import mujoco

from wayproof.harness.config import Config
from wayproof.harness.config_document import as_asked
from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.moments import Segment
from wayproof.harness.recompute.side_by_side import changed_mission
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.robots import built_in, find_logged_robot
from wayproof.harness.scenario.scenario import Scenario, sensor_info
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.scenario.worlds import (
    apply_world_perturbation,
    bare_world,
    forget_worlds,
    generate,
)
from wayproof.models.robots import ROBOTS
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import bind, compose, resolve
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED, movers_in
from wayproof.models.worlds import WORLDS, World


def rebuild(log: Log, config: Config | None = None) -> Scenario:
    """Return the scenario of a log.

    The simulated scene is compiled from the one in the log, so a world that is a file, or that this
    version would generate differently, is simulated as it was.

    Args:
        log: The log.
        config: Settings; by default those of the log.

    Raises:
        InputError: The log is of a recording, the robot is unknown, or the scene is not one of
            this robot, or refers to other files.
    """
    config = config or log.config
    if config.recording is not None:
        raise InputError(f"log '{log.path}': of a recording, which nothing can simulate again")
    redirect_mujoco_warnings()
    text = safe_scene(log.scene)
    robot = find_logged_robot(config, text)
    try:
        config = replace(config, sensors=resolve(robot.spec.mounts, config.sensors))
        scene = bind(text, robot, config.sensors)
        world = _world(log, scene.model)
    except (KeyError, TypeError, *NOT_COMPILED) as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene with '{config.robot}': {line}") from None
    return Scenario(
        config=config,
        world=world,
        scene=replace(scene, mjcf=log.scene),
        mission=changed_mission(log.mission, log.config, config),
        spec=robot.spec,
        warnings=(),
    )


def is_made_from_seed(log: Log) -> bool:
    """Return whether world and robot are registered names, so that a seed makes the scene."""
    return log.config.world in WORLDS and log.config.robot in ROBOTS


def made_otherwise(log: Log) -> list[Difference]:
    """Return the parts that this version generates differently: scene, mission or config.

    If the world or the robot is a file, only the other's part of the scene is compared.
    """
    from wayproof.harness.scenario.scenario import build

    log = log.as_of(-1)
    forget_worlds()  # that of the recording may be this process's
    if not is_made_from_seed(log):
        return _part_made_otherwise(log)
    try:
        built = build(as_asked(log.config, log.asked) if log.asked else log.config)
    except InputError as error:
        return [Difference("scene.xml", "as logged", f"none can be made: {error}")]
    found = [] if built.scene.mjcf == log.scene else [_scene_difference(log.scene, built)]
    if built.config != log.config:
        found.append(Difference("config", "as logged", "as resolved now, which is another"))
    for name, made in asdict(built.mission).items():
        if made != getattr(log.mission, name):
            found.append(Difference(f"mission.{name}", str(getattr(log.mission, name)), str(made)))
    return found


def _part_made_otherwise(log: Log) -> list[Difference]:
    """Compare the part of the scene that is no file's, beside any other world or robot."""
    config = log.config
    seeded, ours = config.world in WORLDS, config.robot in ROBOTS
    if not seeded and not ours:
        return []
    name = config.robot if ours else next(iter(ROBOTS))
    robot = built_in(config)[name]
    if seeded:
        world = apply_world_perturbation(generate(config), config)
    else:
        world = generate(Config("empty", name, seed=0))
    made = _parts(compose(world, robot).mjcf, of_robot=ours)
    pairs = itertools.zip_longest(_parts(log.scene, of_robot=ours), made, fillvalue="nothing")
    which = f"robot {config.robot}" if ours else f"world {config.world}"
    found = next(((old, new) for old, new in pairs if old != new), None)
    return (
        [] if found is None else [Difference(f"scene.xml, {which}", found[0][:120], found[1][:120])]
    )


def _parts(mjcf: str, of_robot: bool) -> list[str]:
    """Return the elements of a scene that name a part of the robot, or the others, as texts.

    Sizes and statistics of the whole, and the settings of physics, are left out: a robot may set
    them.
    """
    found = []
    ahead = [(element, False) for element in reversed(ElementTree.fromstring(mjcf))]
    while ahead:
        element, inside = ahead.pop()
        if element.tag in ("compiler", "option", "size", "statistic", "visual", "keyframe"):
            continue
        inside = inside or any(text.startswith(ROBOT_PREFIX) for text in element.attrib.values())
        if inside == of_robot and element.attrib:
            fields = " ".join(f'{name}="{text}"' for name, text in element.attrib.items())
            found.append(f"<{element.tag} {fields}>")
        ahead += [(one, inside) for one in reversed(element)]
    return found


def _scene_difference(scene: str, built: Scenario) -> Difference:
    """Return the first line that differs between two scenes."""
    pairs = itertools.zip_longest(scene.splitlines(), built.scene.mjcf.splitlines(), fillvalue="")
    number, (old, new) = next((n, pair) for n, pair in enumerate(pairs, 1) if pair[0] != pair[1])
    return Difference(f"scene.xml, line {number}", old.strip()[:120], new.strip()[:120])


def _world(log: Log, model: mujoco.MjModel) -> World:
    """Return the generated world; of one that is a file, only bounds, start, goal and movers.

    Raises:
        ValueError: A mover of a file that the scene does not hold as it was written.
    """
    if log.config.world in WORLDS:
        return apply_world_perturbation(generate(log.config), log.config)
    return bare_world(log.config, log.mission, movers_in(model))


def segment_of(scenario: Scenario, begin: int = 0) -> Segment:
    """Return the segment of a scenario from a decision on."""
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    beams = {info.name: beams_from_info(info) for info in infos}
    return Segment(begin, scenario.config, scenario.mission, beams)
