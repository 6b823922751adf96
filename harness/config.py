"""One episode's settings: frozen dataclasses, every default in sight, every value in the log."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

import msgspec

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.stack.labels import check_margins
from wayproof.harness.stack.types import BehaviourConfig
from wayproof.maps import MAPS, MapConfig
from wayproof.models.odometry import OdometryConfig
from wayproof.models.sensors.devices import DEVICES, OWN, SensorConfig
from wayproof.planners import PLANNERS, PlannerConfig

MOST_THREADS = 64


@dataclass(frozen=True)
class LatencyConfig:
    """The pipeline's delay, in simulated time, as the robot experiences it.

    Attributes:
        mode: `modelled` takes the stages below; `measured` takes the wall time of this machine,
            rounded up to milliseconds and logged as an input.
        sense: From the sweep's instant to its arrival at the map, s.
        map: Integration and costmap, s.
        plan: Decision and trajectory, s.
        deadline: A decision later than this is discarded and the last trajectory, which ends at
            rest in known space, stands, s.
    """

    mode: Literal["modelled", "measured"] = "modelled"
    sense: float = 0.01
    map: float = 0.02
    plan: float = 0.02
    deadline: float = 0.25

    def __post_init__(self) -> None:
        """Refuse delays that are not lengths of time."""
        for name in ("sense", "map", "plan"):
            _expect(f"latency.{name}", getattr(self, name), 0.0, 10.0, "s")
        _expect("latency.deadline", self.deadline, 0.001, 10.0, "s")

    @property
    def expected(self) -> float:
        """How far ahead a decision is made for, s: the delay if modelled, else the deadline."""
        return self.deadline if self.mode == "measured" else self.sense + self.map + self.plan


@dataclass(frozen=True)
class EpisodeConfig:
    """When an episode ends.

    Attributes:
        time_limit: Simulated time after which the outcome is `timeout`, s.
        goal_tolerance: The base comes to rest within this distance of the goal, m.
        stuck_after: Without 0.3 m of movement for this long the outcome is `stuck`, s.
        start_clear_radius: Space about the start that the operator declares free, m beyond the
            body's radius and the localization margin. Sensors look past what stands this near.
    """

    time_limit: float = 120.0
    goal_tolerance: float = 0.25
    stuck_after: float = 30.0
    start_clear_radius: float = 0.25

    def __post_init__(self) -> None:
        """Refuse limits that would end or never end every episode."""
        _expect("episode.time_limit", self.time_limit, 0.1, 3600.0, "s")
        _expect("episode.goal_tolerance", self.goal_tolerance, 0.05, 5.0, "m")
        _expect("episode.stuck_after", self.stuck_after, 1.0, 3600.0, "s")
        _expect("episode.start_clear_radius", self.start_clear_radius, 0.0, 5.0, "m")


@dataclass(frozen=True)
class MotionConfig:
    """How the stack asks the body to move; the body's own limits stand in its spec.

    Attributes:
        speed_fraction: Share of the body's greatest speed that navigation asks for.
        altitude_low: Lowest altitude that any part of a flying robot may take, m.
        altitude_high: Highest, m.
    """

    speed_fraction: float = 1.0
    altitude_low: float = 0.2
    altitude_high: float = 2.8

    def __post_init__(self) -> None:
        """Refuse a standstill and an empty altitude window."""
        _expect("motion.speed_fraction", self.speed_fraction, 0.05, 1.0, "")
        _expect("motion.altitude_low", self.altitude_low, 0.0, 100.0, "m")
        _expect("motion.altitude_high", self.altitude_high, self.altitude_low, 100.0, "m")


@dataclass(frozen=True)
class PluginConfig:
    """What a planner or controller of the user's own may take before the episode ends as `error`.

    No decision depends on it: wall time and memory are this machine's.

    Attributes:
        wall_s: Wall time of one decision and its following, s.
        memory_mib: Memory of the whole process of `wayproof run`, MiB.
    """

    wall_s: float = 60.0
    memory_mib: int = 6144

    def __post_init__(self) -> None:
        """Refuse bounds that nothing could keep."""
        _expect("plugins.wall_s", self.wall_s, 0.1, 86400.0, "s")
        _expect("plugins.memory_mib", self.memory_mib, 512, 2**24, "MiB")


@dataclass(frozen=True)
class Config:
    """Everything that an episode follows from, with the versions of the installed packages.

    Attributes:
        world: Name in `models.worlds.WORLDS`, or the path of a world file; a log tells the name and
            hash of that file.
        robot: Name in `models.robots.ROBOTS`, or the path of a spec file; a log tells the name and
            hash of that robot.
        seed: Seed of the world and of every random stream; never random itself.
        difficulty: Of the world, 0 to 1, as its generator understands it.
        goal: (x, y) or (x, y, z) in place of the world's own goal, m.
        start: Likewise.
        threads: That rays, map and costmap share; decisions are the same on any number.
        record: `full` logs all; `decisions` leaves sweeps and states out, which the seed gives
            again; `failures` is full where the episode failed, and decisions where it succeeded.
        odometry: How good the pose is that the stack and the controller get.
        perturbation: The one assumption that is off, as `{"kind": ..., "severity": ...}`; or none.
        robot_file: Text of the robot's spec file, in a log; set by the run.
    """

    world: str
    robot: str
    seed: int
    goal: tuple[float, ...] | None = None
    start: tuple[float, ...] | None = None
    threads: int = 1
    difficulty: float = 0.5
    record: Literal["full", "decisions", "failures"] = "full"
    sensors: SensorConfig = field(default_factory=SensorConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    map: MapConfig = field(default_factory=MapConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    behaviour: BehaviourConfig = field(default_factory=BehaviourConfig)
    latency: LatencyConfig = field(default_factory=LatencyConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    plugins: PluginConfig = field(default_factory=PluginConfig)
    perturbation: AnyPerturbation | None = None
    robot_file: str = ""

    def __post_init__(self) -> None:
        """Refuse points that are not 2 or 3 numbers and seeds that a generator would refuse."""
        for name in ("goal", "start"):
            point = getattr(self, name)
            if point is not None and len(point) not in (2, 3):
                raise ValueError(f"{name}: got {len(point)} numbers, expected x,y or x,y,z in m")
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"seed: got {self.seed}, expected 0 to 2^63 - 1")
        _expect("difficulty", self.difficulty, 0.0, 1.0, "")
        if not 1 <= self.threads <= MOST_THREADS:
            raise ValueError(f"threads: got {self.threads}, expected 1 to {MOST_THREADS}")
        check_margins(self.map.class_margins, self.sensors.semantics)


def _expect(name: str, got: float, low: float, high: float, unit: str) -> None:
    if not low <= got <= high:
        raise ValueError(f"{name}: got {got:g}, expected {low:g} to {high:g} {unit}".rstrip())


NAMED: dict[str, Iterable[str]] = {
    "map.kind": MAPS,
    "planner.name": PLANNERS,
    "sensors.lidar": (OWN, *DEVICES),
    "sensors.depth": (OWN, *DEVICES),
}
"""Settings whose values are names in a registry."""

NUMBERS = ("int", "float")
"""Types of settings that are numbers; a switch is none."""

CODE = ("planner.name",)
"""Settings that may name code of the user's own."""

PLUGIN = ":"
"""In the name of a planner or a robot's controller: `module:Class` of the user's own."""


def override(config: Config, settings: Iterable[str]) -> Config:
    """Apply `section.field=value` settings, each checked for its name and its type.

    Raises:
        InputError: A setting has no '=', an unknown name, a wrong type or a refused value.
    """
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise InputError(f"--set {setting}: expected section.field=value")
        document = msgspec.to_builtins(config)
        section, name = _locate(document, key)
        before: Any = functools.reduce(getattr, key.split("."), config)
        section[name] = value = _parse(text)
        if isinstance(value, str) and type(before).__name__ in NUMBERS:
            number = "a whole number" if isinstance(before, int) else "a finite number"
            raise InputError(f"--set {setting}: expected {number}, such as {before}")
        plugin = key == "planner.name" and PLUGIN in str(value)
        if key in NAMED and value not in NAMED[key] and not plugin:
            raise unknown_name(key, str(value), NAMED[key])
        try:
            config = from_document(document)
        except InputError as error:
            raise InputError(f"--set {setting}: {error}") from None
    return config


def from_document(document: Any) -> Config:
    """Build the config from plain JSON values.

    Raises:
        InputError: Naming the field, what was got and what was expected.
    """
    try:
        return msgspec.convert(document, Config)
    except msgspec.ValidationError as error:
        raise InputError(_one_line(error)) from None


def to_json(config: Config) -> bytes:
    """The resolved config as JSON, fields in their declared order."""
    return msgspec.json.format(msgspec.json.encode(config), indent=1)


def from_json(data: bytes, allow_plugins: bool = False) -> Config:
    """Read back what `to_json` wrote; floats come back bit by bit.

    Args:
        data: The text.
        allow_plugins: Whether a planner or a robot's controller named `module:Class` may be
            imported: whoever wrote the text then chooses code that is run here.

    Raises:
        InputError: The text is no JSON or no config, or names a plugin that is not allowed.
    """
    try:
        document = msgspec.json.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"config: {error}") from None
    planner = document.get("planner") if isinstance(document, dict) else None
    if isinstance(planner, dict):
        planner.setdefault("grain", 0.0)  # recorded before there was one
    name = planner.get("name") if isinstance(planner, dict) else None
    if not allow_plugins and isinstance(name, str) and PLUGIN in name:
        raise InputError(
            f"config names the planner '{name}', which is code outside Wayproof; "
            "expected --allow-plugins to load it"
        )
    config = from_document(document)
    _check_controller(config, allow_plugins)
    for key, available in NAMED.items():
        section, _, field_name = key.partition(".")
        value = str(getattr(getattr(config, section), field_name))
        if value not in available and not (key == "planner.name" and PLUGIN in value):
            raise unknown_name(key, value, available)
    return config


def _check_controller(config: Config, allow_plugins: bool) -> None:
    if not config.robot_file:
        return
    from wayproof.models.robots.custom import RobotSpecError, parse_spec  # it loads the simulator

    try:
        name = parse_spec(config.robot_file).controller
    except RobotSpecError as error:
        raise InputError(f"config: robot_file: {error}") from None
    if PLUGIN in name and not allow_plugins:
        raise InputError(
            f"config names the controller '{name}', which is code outside Wayproof; "
            "expected --allow-plugins to load it"
        )


def setting_names() -> list[str]:
    """Every `section.field` that `--set` accepts."""
    names = []
    for entry in dataclasses.fields(Config):
        if dataclasses.is_dataclass(entry.default_factory):
            inner = dataclasses.fields(entry.default_factory)
            names += [f"{entry.name}.{field_.name}" for field_ in inner]
        else:
            names.append(entry.name)
    return names


def _locate(document: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    names = setting_names()
    if key not in names:
        section = key.partition(".")[0]
        siblings = [name for name in names if name.startswith(f"{section}.")]
        raise unknown_name("setting", key, siblings or names)
    *path, name = key.split(".")
    for part in path:
        document = document[part]
    return document, name


def _parse(text: str) -> Any:
    """A JSON value where the text is one, the text itself where not; no guessing beyond that."""
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except ValueError:
        return text


def _refuse_constant(name: str) -> Any:
    raise ValueError(name)  # NaN and infinities stay text, which no number field takes


def _one_line(error: msgspec.ValidationError) -> str:
    """Turn msgspec's `Expected ... - at `$.a.b`` around: the field comes first."""
    message, _, place = str(error).partition(" - at `$")
    field_name = place.rstrip("`").lstrip(".")
    if not field_name or message.startswith(field_name):
        return message
    text = message[0].lower() + message[1:]
    return text if field_name in text else f"{field_name}: {text}"
