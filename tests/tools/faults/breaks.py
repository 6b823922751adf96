"""Single changes that make a successful episode fail, so that the cause is known.

Each kind takes an episode that reached its goal and changes one thing. If the changed episode
fails, undoing that one thing makes the failure go away.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from tests.tools.faults.reckless import Reckless, Uninflated
from tests.tools.faults.scene_edits import GLASS_RGBA, edit_scene, transparent
from wayproof.harness.attribution.ways import rest_to_rest
from wayproof.harness.config_document import override
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.worlds import Box, Capsule, Mover, World

CLEAR_OF_ENDS = 1.6
"""Distance of an added wall from start and goal, m."""

HALF_THICK = 0.1
"""Half the thickness of an added wall, m."""

WIRE, FENCE, SPACING = 0.001, 1.5, 0.35
"""Half the thickness of a wire, half the length of a fence, distance of its wires, m."""

PANELS = 6
"""Number of panels of an appearing wall: each keeps its own distance from the robot."""

ROUND_THE_GOAL = 0.9
"""Half the edge of the pen around the goal, m."""

UNLEARNS_SLOWLY = ("map.log_odds_miss=0.01", "map.half_life=0")
RESIGNED = ("behaviour.max_recoveries=1",)
"""Settings for a single exploration before the stack gives up."""

UNFITTED = ("map.filters=false_returns,lost_patches,lost_echoes,grazing",)
"""The floor as each beam has it: a fitted one bears most of these faults."""

BRIEF = ("episode.time_limit=20",)

SHORT = ("planner.clearance_weight=0",)
"""Settings for the shortest paths, which pass close to obstacles."""

HASTY = ("planner.iterations=1", "planner.restarts=1", "planner.shortcuts=0")

Rng = np.random.Generator
Edit = Callable[[mujoco.MjSpec], None]


@dataclass(frozen=True)
class Broken:
    """Change to a successful episode."""

    settings: tuple[str, ...] = ()
    perturbation: str = ""
    mission: dict[str, Any] = field(default_factory=dict)
    world: World | None = None
    edit: Edit | None = None
    stack: type[Navigator] = Navigator

    def scenario(self, sound: Scenario) -> Scenario:
        """Return the successful scenario with this change."""
        config = override(sound.config, self.settings)
        if self.perturbation:
            config = replace(config, perturbation=perturbation_from(self.perturbation))
        scenario = build(config, self.world)
        scenario = replace(scenario, mission=replace(scenario.mission, **self.mission))
        return scenario if self.edit is None else edit_scene(scenario, self.edit)


Break = Callable[[Scenario, Rng], Broken]
"""Function of the successful scenario and a random generator that returns a change."""


@dataclass(frozen=True)
class Kind:
    """One kind of change: its cause, worlds and robots (all if empty), settings of both runs."""

    cause: str
    breaks: Break
    where: tuple[tuple[str, str], ...] = ()
    base: tuple[str, ...] = ()


def _always(**change: Any) -> Break:
    """Return the same change to every episode."""
    return lambda sound, rng: Broken(**change)


def _set(name: str, low: float, high: float, digits: int = 3) -> Break:
    """Return a change of one setting to a drawn value."""
    return lambda sound, rng: Broken((f"{name}={rng.uniform(low, high):.{digits}f}",))


def _perturb(kind: str, low: float, settings: tuple[str, ...] = (), mode: str = "") -> Break:
    """Return a perturbation of a drawn severity up to 5."""
    return lambda sound, rng: Broken(settings, f"{kind}:{rng.uniform(low, 5.0):.2f}{mode}")


def _fault(kind: str, **mode: str) -> Break:
    """Return a perturbation of a stream at its greatest severity, from a drawn time on."""

    def fault(sound: Scenario, rng: Rng) -> Broken:
        window = [round(rng.uniform(0.8, 2.0), 1), 100.0]
        document = {"kind": kind, "severity": 5, "window": window, **mode}
        return Broken((f"perturbation={json.dumps(document)}",))

    return fault


def _dropout(sound: Scenario, rng: Rng) -> Broken:
    """Lose returns."""
    mode = ("ray", "patch", "sweep")[int(rng.integers(3))]
    return Broken(UNFITTED, f"depth_dropout:{rng.uniform(2.0, 5.0):.2f}:{mode}")


def _glass(sound: Scenario, rng: Rng) -> Broken:
    """Make obstacles transparent to every beam."""

    def is_obstacle(geom: mujoco.MjsGeom) -> bool:
        of_robot = geom.name.startswith(ROBOT_PREFIX) or geom.group == ROBOT_GROUP
        floor = geom.type == mujoco.mjtGeom.mjGEOM_PLANE or geom.name.startswith("floor")
        return not (of_robot or floor or geom.name.startswith("wall"))

    return Broken(edit=transparent(is_obstacle))


def _pane(sound: Scenario, rng: Rng) -> Broken:
    """Put a pane of glass across the path."""
    axis, at = _axis(sound), _between(sound, rng)
    middle = [0.5 * (a + b) for a, b in zip(sound.world.low, sound.world.high, strict=True)]
    half = [0.5 * (b - a) for a, b in zip(sound.world.low, sound.world.high, strict=True)]
    middle[axis], half[axis], middle[2], half[2] = at, 0.02, 1.5, 1.5

    def glaze(spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_geom(
            name="pane", type=mujoco.mjtGeom.mjGEOM_BOX, pos=middle, size=half, rgba=GLASS_RGBA
        )

    return Broken(edit=glaze)


def _wires(sound: Scenario, rng: Rng) -> Broken:
    """Put a fence of wires, thinner than the gaps between beams, on the straight line."""
    axis, at = _axis(sound), _between(sound, rng)
    start, goal = sound.mission.start, sound.mission.goal
    share = (at - start[axis]) / (goal[axis] - start[axis])
    middle = start[1 - axis] + share * (goal[1 - axis] - start[1 - axis])
    wires = []
    for z in np.arange(SPACING, 3.0, SPACING).round(3).tolist():
        low, high = [z, z, z], [z, z, z]
        low[axis] = high[axis] = at
        low[1 - axis], high[1 - axis] = middle - FENCE, middle + FENCE
        (a, b, c), (d, e, f) = low, high
        wires.append(Capsule((a, b, c), (d, e, f), WIRE, "wire"))
    return _with_solids(sound, *wires)


def _truck(sound: Scenario, rng: Rng) -> Broken:
    """Let a truck drive along the path and never stop."""
    (x0, y0, _), (x1, y1, _) = sound.mission.goal, sound.mission.start
    body = Box((0.0, 0.0, 1.4), (0.4, rng.uniform(0.6, 1.2), 1.2), 0.0, "vehicle")
    ways = ((float(x0), float(y0), 0.0), (float(x1), float(y1), 0.0))
    truck = Mover("truck", (body,), ways, rng.uniform(1.5, 3.0), returns=False, stands_off=0.0)
    return _with_movers(sound, truck)


def _shut(sound: Scenario, rng: Rng) -> Broken:
    """Shut a gate across the path while the robot is under way."""
    at, when = _between(sound, rng), float(rng.uniform(0.5, 2.0))
    return _with_movers(sound, *_appearing(sound, at, when))


def _drop(sound: Scenario, rng: Rng) -> Broken:
    """Drop a curtain close in front of the robot at its full speed."""
    mission = sound.mission
    speed, push = mission.max_speed, mission.max_acceleration
    when = float(rng.uniform(1.0, 1.6)) * (speed / push + push / mission.max_jerk)
    gone = speed * when - 0.5 * speed * speed / push
    at = _ahead(sound, gone + mission.radius + float(rng.uniform(0.3, 0.6)))
    return _with_movers(sound, *_appearing(sound, at, when))


def _appearing(sound: Scenario, at: float, when: float) -> list[Mover]:
    """Return the panels of a wall across the path that appears at a time, s."""
    axis = _axis(sound)
    low, high = sound.world.low[1 - axis], sound.world.high[1 - axis]
    ends = [low + (high - low) * k / PANELS for k in range(PANELS + 1)]
    movers = []
    for k in range(PANELS):
        panel = _wall(sound, at, kind="curtain", low=ends[k], high=ends[k + 1])
        x, y, z = panel.centre
        panel = replace(panel, centre=(0.0, 0.0, z))
        name, route = f"panel_{k}", ((x, y, 0.0),)
        movers.append(Mover(name, (panel,), route, stands_off=0.0, appears=round(when, 2)))
    return movers


def _retentive(sound: Scenario, rng: Rng) -> Broken:
    """Remove a wall before the start, in a map that hardly forgets it."""
    at = _ahead(sound, CLEAR_OF_ENDS + float(rng.uniform(0.2, 0.6)))
    wall, when = _wall(sound, at, "ghost"), round(float(rng.uniform(0.6, 1.2)), 1)
    gone = Mover("gone", (wall,), ((0.0, 0.0, 0.0),), vanishes=when)
    return replace(_with_movers(sound, gone), settings=UNLEARNS_SLOWLY)


def _slim(sound: Scenario, rng: Rng) -> Broken:
    """Let the stack plan for a smaller body."""
    share = float(rng.uniform(0.1, 0.4))
    discs = tuple((offset, share * radius) for offset, radius in sound.mission.discs)
    return Broken(mission={"radius": share * sound.mission.radius, "discs": discs})


def _bulky(sound: Scenario, rng: Rng) -> Broken:
    """Let the body carry a pole across, which the stack does not model."""
    half = sound.mission.radius + float(rng.uniform(0.15, 0.35))

    def load(spec: mujoco.MjSpec) -> None:
        spec.body(ROBOT_PREFIX + "base").add_geom(
            name=ROBOT_PREFIX + "load", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, half, 0.02],
            pos=[0, 0, 0], mass=0.01, contype=1, conaffinity=1, group=ROBOT_GROUP,
        )  # fmt: skip

    return Broken(edit=load)


def _overrated(sound: Scenario, rng: Rng) -> Broken:
    """Let the stack plan for a faster body."""
    share = rng.uniform(2.0, 3.0)
    mission = {
        "max_speed": share * sound.mission.max_speed,
        "max_acceleration": share * share * sound.mission.max_acceleration,
        "max_jerk": 10.0 * share * sound.mission.max_jerk,
    }
    return Broken(mission=mission)


def _detour(sound: Scenario, rng: Rng) -> Broken:
    """Grant less time than the shortest path takes, but more than the straight line would."""
    straight, way = _straight(sound), _way(sound)
    limit = (straight + rng.uniform(0.3, 0.9) * (way - straight)) / sound.mission.max_speed
    return Broken((f"episode.time_limit={limit:.1f}",))


def _hurry(sound: Scenario, rng: Rng) -> Broken:
    """Grant less time than the shortest path takes from rest to rest."""
    limit = rng.uniform(0.4, 0.8) * rest_to_rest(
        _way(sound), sound.mission.max_speed, sound.mission.max_acceleration
    )
    return Broken((f"episode.time_limit={limit:.1f}",))


def _straight(sound: Scenario) -> float:
    return float(np.linalg.norm(np.subtract(sound.mission.goal, sound.mission.start)[:2]))


def _way(sound: Scenario) -> float:
    return sound.route_length() or _straight(sound)


def _closed(sound: Scenario, rng: Rng) -> Broken:
    """Put a wall from side to side between start and goal."""
    return _with_solids(sound, _wall(sound, _between(sound, rng), "partition"))


def _gap(sound: Scenario, rng: Rng) -> Broken:
    """Put up a wall with a gap in it that is narrower than the body."""
    at, axis = _between(sound, rng), _axis(sound)
    middle = float(rng.uniform(sound.world.low[1 - axis] + 1.0, sound.world.high[1 - axis] - 1.0))
    widest = min([sound.mission.radius, *(radius for _, radius in sound.mission.discs)])
    half = float(rng.uniform(0.5, 0.9)) * widest
    return _with_solids(
        sound,
        _wall(sound, at, "partition", high=middle - half),
        _wall(sound, at, "partition", low=middle + half),
    )


def _pen(sound: Scenario, rng: Rng) -> Broken:
    """Fence the goal in on all sides."""
    x, y, _ = sound.mission.goal
    r, t = ROUND_THE_GOAL, 0.08
    sides = (
        ((x - r, y - r), (x - r + t, y + r)),
        ((x + r - t, y - r), (x + r, y + r)),
        ((x - r, y - r), (x + r, y - r + t)),
        ((x - r, y + r - t), (x + r, y + r)),
    )
    fence = [Box.between((a, b, 0.0), (c, d, 3.0), "fence") for (a, b), (c, d) in sides]
    return _with_solids(sound, *fence)


def _axis(sound: Scenario) -> int:
    """Return the axis along which start and goal are farther apart: 0 for x, 1 for y."""
    (x0, y0, _), (x1, y1, _) = sound.mission.start, sound.mission.goal
    return 0 if abs(x1 - x0) > abs(y1 - y0) else 1


def _between(sound: Scenario, rng: Rng) -> float:
    """Return a random coordinate between start and goal on that axis, clear of both, m."""
    axis = _axis(sound)
    low, high = sorted((sound.mission.start[axis], sound.mission.goal[axis]))
    low += CLEAR_OF_ENDS
    return float(rng.uniform(low, max(high - CLEAR_OF_ENDS, low + 0.1)))


def _ahead(sound: Scenario, distance: float) -> float:
    """Return the coordinate on that axis at a distance from the start, towards the goal, m."""
    axis = _axis(sound)
    start, goal = sound.mission.start[axis], sound.mission.goal[axis]
    return start + (distance if goal > start else -distance)


def _wall(
    sound: Scenario, at: float, kind: str, low: float | None = None, high: float | None = None
) -> Box:
    """Return a wall from floor to ceiling at a coordinate on that axis, m."""
    axis, corners = _axis(sound), (list(sound.world.low), list(sound.world.high))
    for corner, side, end, z in zip(corners, (-1, 1), (low, high), (0.0, 3.0), strict=True):
        corner[axis] = at + side * HALF_THICK
        corner[1 - axis] = corner[1 - axis] if end is None else end
        corner[2] = z
    (a, b, c), (d, e, f) = corners
    return Box.between((a, b, c), (d, e, f), kind)


def _with_solids(sound: Scenario, *solids: Any) -> Broken:
    return Broken(world=replace(sound.world, solids=(*sound.world.solids, *solids)))


def _with_movers(sound: Scenario, *movers: Mover) -> Broken:
    return Broken(world=replace(sound.world, movers=(*sound.world.movers, *movers)))


STILL = (
    ("office", "drone"), ("maze", "drone"), ("office", "quadruped"), ("maze", "quadruped"),
    ("cylinders", "drone"), ("corridor", "drone"), ("forest", "drone"), ("warehouse", "drone"),
)  # fmt: skip
"""Worlds and robots without movers, which would enter space seen free before."""

ROUND = (
    ("empty", "drone"), ("ghosts", "drone"), ("empty", "quadruped"), ("warehouse", "drone"),
    ("crossing", "drone"), ("ghosts", "quadruped"),
)  # fmt: skip
"""Worlds and robots with a path around a fence on the straight line."""

HALLS = (("crossing", "drone"), ("ghosts", "quadruped"), ("crossing", "quadruped"))
STRAIGHT = (("corridor", "drone"), ("empty", "drone"), ("empty", "quadruped"))
OPEN = (("empty", "drone"), ("empty", "quadruped"), ("cylinders", "drone"), ("ghosts", "drone"))

NARROW = (
    ("forest", "drone"), ("maze", "drone"), ("office", "drone"), ("cylinders", "drone"),
    ("construction", "drone"), ("maze", "quadruped"), ("office", "quadruped"),
)  # fmt: skip
"""Worlds and robots whose paths pass close to obstacles."""

BENDS = (
    ("maze", "drone"), ("office", "drone"), ("maze", "quadruped"), ("corridor", "drone"),
    ("office", "quadruped"), ("cylinders", "quadruped"), ("corridor", "quadruped"),
)  # fmt: skip

GROPING = ("costmap.unknown_policy=allow", "map.minimum_range=5")

KINDS = {
    "pose_jump": Kind("localization", _perturb("pose_jump", 3.0)),
    "pose_drift": Kind("localization", _perturb("pose_drift", 3.5)),
    "heading_drift": Kind("localization", _set("pose_model.yaw_scale_sigma", 0.1, 0.4)),
    "dead_reckoning": Kind("localization", _set("pose_model.scale_sigma", 0.05, 0.2)),
    "dropout": Kind("perception", _dropout),
    "noise": Kind("perception", _perturb("depth_noise", 2.5, UNFITTED)),
    "occlusion": Kind("perception", _perturb("occlusion", 3.0)),
    "calibration": Kind("perception", _perturb("calibration", 3.0, UNFITTED, ":rotation")),
    "blind": Kind("perception", _set("map.minimum_range", 1.5, 4.0, 2)),
    "glass": Kind("missed_obstacle", _glass),
    "pane": Kind("missed_obstacle", _pane),
    "wires": Kind("missed_obstacle", _wires, ROUND),
    "groping": Kind("unseen_obstacle", _always(settings=GROPING), STILL),
    "crowd": Kind("moved_obstacle", _perturb("motion", 3.0)),
    "truck": Kind("moved_obstacle", _truck, (*STRAIGHT, ("office", "drone"), ("ghosts", "drone"))),
    "shut": Kind("moved_obstacle", _shut),
    "drop": Kind("moved_obstacle", _drop, OPEN),
    "retentive": Kind("ghost_obstacle", _retentive, (*OPEN, STRAIGHT[0]), RESIGNED),
    "trails": Kind(
        "ghost_obstacle", _always(settings=UNLEARNS_SLOWLY), HALLS, (*RESIGNED, "difficulty=1")
    ),
    "slim": Kind("margin_too_small", _slim, NARROW, (*SHORT, "costmap.localization_margin=0.05")),
    "bulky": Kind("margin_too_small", _bulky, NARROW, SHORT),
    "strict": Kind("tracking", _set("behaviour.tracking_tolerance", 0.01, 0.04)),
    "overrated": Kind("tracking", _overrated),
    "stopped": Kind("stale_evidence", _fault("sensor_stop"), OPEN, BRIEF),
    "frozen": Kind("frozen_evidence", _fault("sensor_freeze"), OPEN, BRIEF),
    "pose_stopped": Kind("stale_evidence", _fault("pose_stop"), OPEN, BRIEF),
    "pose_frozen": Kind("frozen_evidence", _fault("pose_freeze"), OPEN, BRIEF),
    "skewed": Kind("frozen_evidence", _fault("clock_skew", stream="pose"), OPEN, BRIEF),
    "stalled": Kind("latency", _fault("stack_stall"), OPEN, BRIEF),
    "late": Kind("latency", _always(perturbation="latency:5")),
    "planning": Kind("latency", _set("latency.plan", 0.25, 0.6)),
    "hasty_search": Kind("planner", _always(settings=HASTY), BENDS, ("planner.name=rrtconnect",)),
    "hasty_tree": Kind("planner", _always(settings=HASTY), BENDS, ("planner.name=rrtstar",)),
    "hasty_batch": Kind("planner", _always(settings=HASTY), BENDS, ("planner.name=bitstar",)),
    "reckless": Kind("disregarded_obstacle", _always(stack=Reckless)),
    "uninflated": Kind("disregarded_obstacle", _always(stack=Uninflated), NARROW, SHORT),
    "detour": Kind("impossible", _detour),
    "hurry": Kind("impossible", _hurry),
    "wide": Kind("impossible", _set("costmap.localization_margin", 0.3, 0.7, 2)),
    "closed": Kind("impossible", _closed),
    "gap": Kind("impossible", _gap),
    "pen": Kind("impossible", _pen),
}
"""Kinds of changes by name."""
