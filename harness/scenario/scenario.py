"""Scenario of an episode, built from its config: world, scene, mission."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import mujoco
import numpy as np

from wayproof.harness.config import HASH_SEPARATOR, Config
from wayproof.harness.errors import InputError
from wayproof.harness.mission import Mission
from wayproof.harness.scenario.ground import check_climb, warn_of_blind_start
from wayproof.harness.scenario.places import goals_of, known_route, refuse_no_way
from wayproof.harness.scenario.prior_maps import with_prior
from wayproof.harness.scenario.robots import (
    find_robot,
    log_robot_identity,
    resolve_limits,
)
from wayproof.harness.scenario.worlds import (
    apply_world_perturbation,
    find_world,
    log_world_identity,
)
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.checks import check
from wayproof.models.robots import Robot, RobotSpec
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import Scene, compose, device_name, resolve
from wayproof.models.sensors.caster import Caster
from wayproof.models.world_files import WorldFileError, world_in_scene
from wayproof.models.worlds import World
from wayproof.models.worlds.solvability import AIR_BANDS

Point = tuple[float, float, float]

LEVEL = 0.15
"""Height of a start or goal above a floor at which it is still that floor's, m."""


@dataclass(frozen=True)
class Scenario:
    """One episode, ready to run.

    Attributes:
        config: Config with start and goal resolved.
        world: The generated world.
        scene: World and robot, compiled.
        mission: Task of the navigation stack.
        spec: The robot's body.
        warnings: Findings of the model check that do not prevent a run.
        asked: Config that it was built from; None of one that a log holds.
    """

    config: Config
    world: World
    scene: Scene
    mission: Mission
    spec: RobotSpec
    warnings: tuple[str, ...]
    asked: Config | None = None

    def route_length(self) -> float | None:
        """Return the length of this body's shortest way by the truth without movers, m; maybe None.

        Of several goals the sum over the ways from each to the next. For a robot that flies, in the
        plane, at one of two altitudes. SPL (Anderson et al. 2018) compares the way travelled with
        it.
        """
        world, mission = self._scored_world(), self.mission
        if world.route_length is not None and not mission.waypoints:
            return world.route_length
        total = 0.0
        for begin, end in pairwise((mission.start, *mission.goals)):
            length = self._leg_length(world, begin, end)
            if length is None:
                return None
            total += length
        return total

    def _scored_world(self) -> World:
        """Return the world; of one from a file the scene's, which is all that a log holds of it.

        Raises:
            InputError: The scene is of no world file.
        """
        if HASH_SEPARATOR not in self.config.world:
            return self.world
        try:
            return world_in_scene(self.scene.model, self.scene.base)
        except WorldFileError as error:
            raise InputError(str(error)) from None

    def _leg_length(self, world: World, begin: Point, end: Point) -> float | None:
        """Return the length of the shortest way between two places, m; None if there is none."""
        spec = self.spec
        bands = AIR_BANDS if spec.motion == "air" else ((spec.step_height, spec.height),)
        ways = [known_route(world, spec.radius, band, begin, end) for band in bands]
        return min((way for way in ways if way is not None), default=None)


def build(config: Config, world: World | None = None) -> Scenario:
    """Generate the world, place start and goal, and compile the scene.

    Args:
        config: Config of the episode.
        world: World in place of the one that the config names.

    Raises:
        InputError: Unknown world or robot; a start or goal outside the geofence or inside an
            obstacle; several goals without a way from one to the next; terrain that a robot which
            walks would have to climb; a scene that cannot be compiled or cast, or whose sensors
            would see wrongly.
    """
    world = find_world(config) if world is None else world
    asked = config
    config = resolve_limits(config, world)
    robot = find_robot(config)
    spec = robot.spec
    world = apply_world_perturbation(world, config)
    start = _place(world.start[:2] if config.start is None else config.start, world, spec)
    *waypoints, goal = (_place(one, world, spec) for one in goals_of(config, world))
    for name, point in (
        ("start", start),
        *(("waypoints", one) for one in waypoints),
        ("goal", goal),
    ):
        _check_point(name, point, world, spec, config)
    refuse_no_way(world, spec, start, (*waypoints, goal))
    warnings: tuple[str, ...] = ()
    if config.costmap.max_slope == 0.0:
        warnings = check_climb(world, spec, (start, *waypoints, goal), config.map.resolution)
    try:
        sensors = resolve(spec.mounts, config.sensors)
    except ValueError as error:
        raise InputError(f"robot '{config.robot}': {error}") from None
    config = replace(config, start=start, goal=goal, waypoints=tuple(waypoints), sensors=sensors)
    config = with_prior(log_robot_identity(robot, log_world_identity(world, config)), world)
    scene = _compose(world, robot, config)
    if config.perturbation is not None:  # it may name a sensor
        config.perturbation.affected([caster.mount.name for caster in scene.casters])
    return Scenario(
        config=config,
        world=world,
        scene=scene,
        mission=_mission(world, spec, config, (start, *waypoints, goal)),
        spec=spec,
        warnings=(
            *warnings,
            *warn_of_blind_start(scene.casters, spec, config),
            *_inspect(scene, world, config),
        ),
        asked=asked,
    )


def _compose(world: World, robot: Robot, config: Config) -> Scene:
    try:
        return compose(world, robot, config.sensors)
    except ValueError as error:  # a scene that the chosen ray engine cannot cast, for one
        raise InputError(f"world '{config.world}' with robot '{config.robot}': {error}") from None


def _inspect(scene: Scene, world: World, config: Config) -> tuple[str, ...]:
    """Check the model with the robot at its start: refuse an error, return the warnings."""
    data = mujoco.MjData(scene.model)
    scene.controller.reset(data, np.array(config.start), world.start_heading)
    mujoco.mj_kinematics(scene.model, data)
    mounts = [caster.mount for caster in scene.casters]
    findings = check(scene.model, data, mounts, scene.base, config.sensors.engine, ROBOT_PREFIX)
    errors = [finding.text for finding in findings if finding.severity == "error"]
    if errors:
        raise InputError(f"world '{config.world}' with robot '{config.robot}': {errors[0]}")
    return tuple(finding.text for finding in findings)


def sensor_info(caster: Caster) -> pb.SensorInfo:
    """Return the sensor's beam tables and its mounting on the base, as the log states them."""
    device, table = caster.mount.device, caster.table
    position, R = caster.mounting
    return pb.SensorInfo(
        name=caster.mount.name,
        kind=device.kind,
        device=device_name(device),
        source=device.source,
        range_m=device.range,
        rate_hz=device.rate,
        measures=table.measures,
        order=table.order,
        beams=table.beams,
        row_step=table.row_step,
        column_step=table.column_step,
        scan_poses=table.scan_poses,
        row_width=table.rows.shape[1],
        rows=table.rows.ravel().tolist(),
        columns=table.columns.ravel().tolist(),
        position_base_sensor=position.tolist(),
        rotation_base_sensor=R.ravel().tolist(),
    )


def _place(point: tuple[float, ...], world: World, spec: RobotSpec) -> Point:
    """Return the base origin at x,y or x,y,z; without z at rest on the floor there."""
    if len(point) == 3:
        z = float(point[2])
    else:
        z = spec.rest_height + world.ground_height(point)
    return float(point[0]), float(point[1]), z


def _check_point(name: str, point: Point, world: World, spec: RobotSpec, config: Config) -> None:
    text = ", ".join(f"{value:g}" for value in point)
    low, high = np.array(world.low), np.array(world.high)
    if not np.isfinite(point).all() or (point < low).any() or (point > high).any():
        fence = " to ".join(
            "(" + ", ".join(f"{v:g}" for v in corner) + ")" for corner in (low, high)
        )
        raise InputError(f"{name}: got ({text}), expected inside the geofence {fence} m")
    if spec.motion == "air":
        body = spec.radius + config.costmap.localization_margin
        window = (config.motion.altitude_low + body, config.motion.altitude_high - body)
        if window[0] >= window[1]:
            raise InputError(
                f"motion.altitude_low, altitude_high: got {config.motion.altitude_low:g} and "
                f"{config.motion.altitude_high:g} m, expected more than {2 * body:g} m between them"
            )
        if not window[0] <= point[2] <= window[1]:
            raise InputError(
                f"{name}: altitude {point[2]:g} m, expected {window[0]:g} to {window[1]:g} m"
            )
    if spec.motion == "ground":
        floor = world.ground_height(point)
        if not floor - LEVEL <= point[2] <= floor + spec.rest_height + LEVEL:
            raise InputError(
                f"{name}: got ({text}), not on the floor there, at {floor:g} m, where "
                f"'{spec.name}' walks; expected z {floor + spec.rest_height:g}, or none"
            )
        ground = point[2] - spec.rest_height
        band = (ground + spec.step_height, ground + spec.height)
        obstacle = world.obstacle_in_band(np.array(point), spec.radius, band)
    else:
        obstacle = world.contains_obstacle(np.array(point), spec.radius)
    if obstacle is not None:
        raise InputError(
            f"{name}: ({text}) is within the body's radius of {spec.radius:g} m of '{obstacle}', "
            "expected free space"
        )


def _mission(world: World, spec: RobotSpec, config: Config, points: Sequence[Point]) -> Mission:
    start, *waypoints, goal = points
    climbs = spec.motion == "ground" and config.costmap.max_slope > 0.0
    # On slopes the last centimetres of a stop would count as motion through what `audit` lacks.
    yaw_acceleration = 0.0 if climbs else spec.max_yaw_acceleration
    return Mission(
        motion=spec.motion,
        radius=spec.radius,
        height=spec.height,
        step_height=spec.step_height,
        max_speed=spec.max_speed,
        max_acceleration=spec.max_acceleration,
        max_jerk=spec.max_jerk,
        max_yaw_rate=spec.max_yaw_rate,
        low=world.low,
        high=world.high,
        start=start,
        start_heading=world.start_heading,
        goal=goal,
        discs=spec.discs,
        waypoints=tuple(waypoints),
        rest_height=spec.rest_height if climbs else 0.0,
        sideways_speed=spec.sideways_speed,
        max_yaw_acceleration=yaw_acceleration,
    )


def decision_period(scenario: Scenario) -> float:
    """Return the period of decisions, s: that of the first sensor."""
    return 1.0 / scenario.scene.casters[0].mount.device.rate
