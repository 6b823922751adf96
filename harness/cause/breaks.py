"""Ways to break one assumption of an episode that succeeds: the cause of its failure is then known.

Each kind takes an episode that reached its goal and changes one thing. If the changed episode
fails, that one thing is what, taken away, makes the failure go away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from harness.cause.reckless import Reckless
from harness.cause.ways import rest_to_rest
from harness.config import override
from harness.perturbations import perturbation_from
from harness.result import Result
from harness.scenario import Scenario, build
from harness.stack.navigator import Navigator
from models.robots import ROBOTS
from models.scene import PREFIX, bind
from models.worlds import Box, Mover, World

MOST = 4000
"""No broken episode has more decisions."""

CLEAR_OF_ENDS = 1.6
"""A wall that is added keeps this from start and goal, m."""

Rng = np.random.Generator
Edit = Callable[[mujoco.MjSpec], None]


@dataclass(frozen=True)
class Broken:
    """What differs from the episode that succeeds.

    Attributes:
        settings: As `section.field=value`.
        perturbation: As `KIND:SEVERITY[:MODE]`; none if empty.
        told: What the stack is told wrongly of the body, by the mission's fields.
        world: In place of the world, if it is another one.
        edit: Changes the compiled scene.
        delay: Of every decision, s, unknown to the stack.
        stack: In place of the built-in one.
    """

    settings: tuple[str, ...] = ()
    perturbation: str = ""
    told: dict[str, Any] = field(default_factory=dict)
    world: World | None = None
    edit: Edit | None = None
    delay: float | None = None
    stack: type[Navigator] = Navigator

    def scenario(self, sound: Scenario) -> Scenario:
        """The sound scenario with this one thing changed."""
        config = override(sound.config, self.settings)
        if self.perturbation:
            config = replace(config, perturbation=perturbation_from(self.perturbation))
        scenario = build(config, self.world)
        scenario = replace(scenario, mission=replace(scenario.mission, **self.told))
        return scenario if self.edit is None else _edited(scenario, self.edit)

    @property
    def delays(self) -> dict[int, float]:
        """Delay by decision, s."""
        return {} if self.delay is None else dict.fromkeys(range(MOST), self.delay)


def _edited(scenario: Scenario, edit: Edit) -> Scenario:
    spec = mujoco.MjSpec.from_string(scenario.scene.mjcf)
    edit(spec)
    spec.compile()
    config = scenario.config
    scene = bind(spec.to_xml(), ROBOTS[config.robot], config.sensors, config.threads)
    return replace(scenario, scene=scene)


Kind = Callable[[Scenario, Result, Rng], Broken]


def _jump(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The pose jumps by a decimetre or a metre."""
    return Broken(perturbation=f"pose_jump:{rng.uniform(3.0, 5.0):.2f}")


def _drift(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The pose drifts away with the distance travelled."""
    return Broken(perturbation=f"pose_drift:{rng.uniform(3.5, 5.0):.2f}")


def _heading_drift(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Dead reckoning whose turns are off by a share."""
    return Broken(settings=(f"odometry.turn_scale={rng.uniform(0.1, 0.4):.3f}",))


def _dead_reckoning(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Dead reckoning whose distances are off by a share, and that states so."""
    return Broken(settings=(f"odometry.scale={rng.uniform(0.05, 0.2):.3f}",))


def _dropout(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Echoes are lost."""
    mode = ("ray", "patch", "sweep")[int(rng.integers(3))]
    return Broken(perturbation=f"depth_dropout:{rng.uniform(2.0, 5.0):.2f}:{mode}")


def _scale(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Ranges are too long by a factor."""
    return Broken(perturbation=f"depth_scale:{rng.uniform(4.0, 5.0):.2f}")


def _noise(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Ranges are noisier than the device states."""
    return Broken(perturbation=f"depth_noise:{rng.uniform(2.5, 5.0):.2f}")


def _occlusion(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A sector of the view is blocked."""
    return Broken(perturbation=f"occlusion:{rng.uniform(3.0, 5.0):.2f}")


def _calibration(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The sensor is turned against where it is stated to sit."""
    return Broken(perturbation=f"calibration:{rng.uniform(3.0, 5.0):.2f}:rotation")


def _blind(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """What is near is not seen."""
    return Broken(settings=(f"map.minimum_range={rng.uniform(1.5, 4.0):.2f}",))


def _glass(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """What stands about is transparent to every beam."""

    def vanish(spec: mujoco.MjSpec) -> None:
        for geom in spec.geoms:
            of_robot = geom.name.startswith(PREFIX) or geom.group == 3
            floor = geom.type == mujoco.mjtGeom.mjGEOM_PLANE or geom.name.startswith("floor")
            if not of_robot and not floor and not geom.name.startswith("wall"):
                geom.rgba = [0.8, 0.9, 1.0, 0.0]

    return Broken(edit=vanish)


def _late(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Decisions take longer than their deadline allows."""
    return Broken(perturbation="latency:5")


def _slow(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Decisions take effect later than the stack reckons with, all within the deadline."""
    return Broken(delay=round(float(rng.uniform(0.2, 0.25)), 3))


def _planning(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Planning alone takes longer than the deadline."""
    return Broken(settings=(f"latency.plan={rng.uniform(0.25, 0.6):.3f}",))


def _rate(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Most sweeps never arrive."""
    return Broken(perturbation=f"rate:{rng.uniform(4.0, 5.0):.2f}")


def _detour(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Less time than the shortest way takes, though more than the straight one would."""
    mission = sound.mission
    straight = float(np.linalg.norm(np.subtract(mission.goal, mission.start)[:2]))
    way = sound.route_length() or straight
    limit = (straight + rng.uniform(0.3, 0.9) * (way - straight)) / mission.max_speed
    return Broken(settings=(f"episode.time_limit={limit:.1f}",))


def _hurry(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Less time than the shortest way takes from rest to rest."""
    mission = sound.mission
    straight = float(np.linalg.norm(np.subtract(mission.goal, mission.start)[:2]))
    limit = rng.uniform(0.4, 0.8) * rest_to_rest(sound.route_length() or straight, mission)
    return Broken(settings=(f"episode.time_limit={limit:.1f}",))


def _wide(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A margin that no passage is wide enough for."""
    return Broken(settings=(f"map.inflation_margin={rng.uniform(0.3, 0.7):.2f}",))


def _closed(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A wall from side to side, in between."""
    world, (x0, y0, _), (x1, y1, _) = sound.world, sound.mission.start, sound.mission.goal
    axis = 0 if abs(x1 - x0) > abs(y1 - y0) else 1
    a, b = sorted((sound.mission.start[axis], sound.mission.goal[axis]))
    at = rng.uniform(a + CLEAR_OF_ENDS, max(b - CLEAR_OF_ENDS, a + CLEAR_OF_ENDS + 0.1))
    low, high = list(world.low), list(world.high)
    low[axis], high[axis], low[2], high[2] = at - 0.1, at + 0.1, 0.0, 3.0
    (a, b, c), (d, e, f) = low, high
    wall = Box.between((a, b, c), (d, e, f), "partition")
    return Broken(world=replace(world, solids=(*world.solids, wall), movers=()))


def _slim(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The stack is told a body that is smaller than the one that moves, and passes close by."""
    told: dict[str, Any] = {"radius": 0.01, "discs": ()}
    return Broken(told=told, settings=("map.inflation_margin=0.02", "planner.clearance_weight=0"))


def _bold(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Unknown space is entered like free space."""
    return Broken(settings=("map.unknown_policy=allow",))


def _groping(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Unknown space is entered like free space, and what is near stays unknown."""
    return Broken(settings=("map.unknown_policy=allow", "map.minimum_range=5"))


def _retentive(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A wall before the start vanishes, and the map hardly unlearns it."""
    world, (x0, y0, _), (x1, y1, _) = sound.world, sound.mission.start, sound.mission.goal
    axis = 0 if abs(x1 - x0) > abs(y1 - y0) else 1
    ahead = 1.0 if (x1, y1)[axis] > (x0, y0)[axis] else -1.0
    at = (x0, y0)[axis] + ahead * (CLEAR_OF_ENDS + rng.uniform(0.2, 0.6))
    low, high = list(world.low), list(world.high)
    low[axis], high[axis], low[2], high[2] = at - 0.1, at + 0.1, 0.0, 3.0
    (a, b, c), (d, e, f) = low, high
    wall = Box.between((a, b, c), (d, e, f), "ghost")
    still = ((0.0, 0.0, 0.0),)
    gone = Mover("gone", (wall,), still, vanishes=round(float(rng.uniform(0.6, 1.2)), 1))
    settings = ("map.miss=0.02", "map.half_life=0")
    return Broken(world=replace(world, movers=(*world.movers, gone)), settings=settings)


def _crowd(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """People walk to and fro across the way."""
    return Broken(perturbation=f"motion:{rng.uniform(3.0, 5.0):.2f}")


def _truck(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A truck comes along the way and stops for nobody."""
    world, mission = sound.world, sound.mission
    (x0, y0, _), (x1, y1, _) = mission.goal, mission.start
    body = Box((0.0, 0.0, 1.4), (0.4, rng.uniform(0.6, 1.2), 1.2), 0.0, "vehicle")
    ways = ((float(x0), float(y0), 0.0), (float(x1), float(y1), 0.0))
    truck = Mover("truck", (body,), ways, rng.uniform(1.5, 3.0), returns=False, stands_off=0.0)
    return Broken(world=replace(world, movers=(*world.movers, truck)))


def _hasty_search(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The search gives up at once."""
    few = ("planner.iterations=1", "planner.restarts=1", "planner.shortcuts=0")
    return Broken(settings=("planner.name=rrtconnect", *few))


def _strict(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The body should keep to its path more closely than any does."""
    return Broken(settings=(f"behaviour.tracking_tolerance={rng.uniform(0.01, 0.04):.3f}",))


def _overrated(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The stack is told that the body is faster than it is."""
    share = rng.uniform(2.0, 3.0)
    mission = sound.mission
    told = {
        "max_speed": share * mission.max_speed,
        "max_acceleration": share * share * mission.max_acceleration,
        "max_jerk": 10.0 * share * mission.max_jerk,
    }
    return Broken(told=told)


def _laden(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The body carries more than its controller knows."""
    share = rng.uniform(0.6, 1.2)

    def load(spec: mujoco.MjSpec) -> None:
        base = spec.body(PREFIX + "base")
        side = 0.12 if sound.mission.motion == "air" else 0.25
        kilograms = share * (1.3 if sound.mission.motion == "air" else 15.0)
        base.add_geom(
            name=PREFIX + "load", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0],
            pos=[side, 0.3 * side, 0.0], mass=kilograms, contype=0, conaffinity=0, group=3,
        )  # fmt: skip

    return Broken(edit=load)


def _icy(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """The floor is slippery."""
    grip = rng.uniform(0.05, 0.15)

    def ice(spec: mujoco.MjSpec) -> None:
        for geom in spec.geoms:
            geom.friction = [grip, 0.005, 0.0001]

    return Broken(edit=ice)


def _reckless(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """A stack that does not look into its map."""
    return Broken(stack=Reckless)


KINDS: dict[str, tuple[str, Kind]] = {
    "pose_jump": ("localization", _jump),
    "pose_drift": ("localization", _drift),
    "heading_drift": ("localization", _heading_drift),
    "dead_reckoning": ("localization", _dead_reckoning),
    "dropout": ("perception", _dropout),
    "scale": ("perception", _scale),
    "noise": ("perception", _noise),
    "occlusion": ("perception", _occlusion),
    "calibration": ("perception", _calibration),
    "blind": ("perception", _blind),
    "reckless": ("disregarded_obstacle", _reckless),
    "glass": ("missed_obstacle", _glass),
    "bold": ("unseen_obstacle", _bold),
    "groping": ("unseen_obstacle", _groping),
    "slim": ("margin_too_small", _slim),
    "crowd": ("moved_obstacle", _crowd),
    "truck": ("moved_obstacle", _truck),
    "retentive": ("ghost_obstacle", _retentive),
    "strict": ("tracking", _strict),
    "overrated": ("tracking", _overrated),
    "laden": ("tracking", _laden),
    "icy": ("tracking", _icy),
    "late": ("latency", _late),
    "slow": ("latency", _slow),
    "planning": ("latency", _planning),
    "rate": ("latency", _rate),
    "hasty_search": ("planner", _hasty_search),
    "detour": ("impossible", _detour),
    "hurry": ("impossible", _hurry),
    "wide": ("impossible", _wide),
    "closed": ("impossible", _closed),
}
"""The cause that each kind builds in, and how."""

WHERE: dict[str, tuple[tuple[str, str], ...]] = {
    "groping": (("office", "drone"), ("maze", "drone")),
    "slim": (("forest", "drone"), ("cylinders", "drone"), ("office", "drone")),
    "truck": (("corridor", "drone"), ("empty", "drone"), ("office", "drone")),
    "retentive": (("empty", "drone"), ("corridor", "drone"), ("cylinders", "drone")),
    "hasty_search": (("maze", "drone"), ("office", "drone"), ("maze", "quadruped")),
}
"""Worlds and robots that a kind is tried in, for those that fail in few."""
