"""One episode's settings: frozen dataclasses, every default in sight, every value in the log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from wayproof.bounds import Bounds, check_fields
from wayproof.harness.behaviour_config import BehaviourConfig
from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.perturbations.perturbation import LATE
from wayproof.harness.prediction_config import NO_PREDICTOR, PredictionConfig, is_outside
from wayproof.harness.prior_config import NO_PRIOR, PriorConfig
from wayproof.harness.recording_config import RecordingConfig
from wayproof.maps import CostmapConfig, MapConfig
from wayproof.models.classes import CLASSES
from wayproof.models.pose_model import PoseModelConfig
from wayproof.models.sensors.devices import SensorConfig
from wayproof.models.world_parameters import PLACES, WorldParameters
from wayproof.planners import PlannerConfig

MOST_WAYPOINTS = 100

BUILTIN = "builtin"
"""Name of the stack in `harness/stack`, whose map is the referee's."""


@dataclass(frozen=True)
class LatencyConfig:
    """The pipeline's delay, in simulated time, as the robot experiences it.

    Attributes:
        mode: `modelled` takes the stages below; `measured` takes the wall time of this machine,
            rounded up to milliseconds and logged as an input.
        sense: Delay from the sweep's instant to its arrival at the map, s.
        map: Integration and costmap, s.
        plan: Decision and trajectory, s.
        deadline: A decision later than this is discarded and the last trajectory, which ends at
            rest in known space, stands, s.
    """

    mode: Literal["modelled", "measured"] = "modelled"
    sense: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.01
    map: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.02
    plan: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.02
    deadline: Annotated[float, Bounds(0.001, 10.0, "s")] = 0.25

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "latency.")

    @property
    def expected(self) -> float:
        """Time ahead for which a decision is made, s: the delay if modelled, else the deadline."""
        return self.deadline if self.mode == "measured" else self.sense + self.map + self.plan

    @property
    def expected_ns(self) -> int:
        """Time ahead for which a decision is made, ns."""
        return round(self.expected * 1e9)


@dataclass(frozen=True)
class EpisodeConfig:
    """Conditions that end an episode.

    Attributes:
        time_limit: Simulated time after which the outcome is `timeout`, s.
        goal_tolerance: Distance from the goal within which the base has to come to rest, m.
        stuck_after: Time without 0.3 m of movement after which the outcome is `stuck`, s.
        start_clear_radius: Space about the start that the operator declares free, m beyond the
            body's radius and the localization margin. Sensors look past what stands this near.
    """

    time_limit: Annotated[float, Bounds(0.1, 3600.0, "s")] = 120.0
    goal_tolerance: Annotated[float, Bounds(0.05, 5.0, "m")] = 0.25
    stuck_after: Annotated[float, Bounds(1.0, 3600.0, "s")] = 30.0
    start_clear_radius: Annotated[float, Bounds(0.0, 5.0, "m")] = 0.25

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "episode.")


@dataclass(frozen=True)
class MotionConfig:
    """Motion that the stack commands; the body's own limits stand in its spec.

    Attributes:
        limits: Limits of a built-in robot's speed, acceleration and turning: those of its trials
            (`full`), lower ones (`cautious`), those for slopes (`sloping`), or `auto`. `auto` takes
            `sloping` with `costmap.max_slope`, `cautious` where things are known to move or appear
            and on recordings, else `full`. A log says which.
        speed_fraction: Share of the body's greatest speed that navigation commands.
        altitude_low: Lowest altitude that any part of a flying robot may take, m.
        altitude_high: Highest, m.
    """

    limits: Literal["auto", "full", "cautious", "sloping"] = "auto"
    speed_fraction: Annotated[float, Bounds(0.05, 1.0)] = 1.0
    altitude_low: Annotated[float, Bounds(-1e4, 1e4, "m")] = 0.2
    altitude_high: Annotated[float, Bounds(-1e4, 1e4, "m")] = 2.8

    def __post_init__(self) -> None:
        """Check every field, and refuse an empty altitude band."""
        check_fields(self, "motion.")
        if self.altitude_high < self.altitude_low:
            raise ValueError(
                f"motion.altitude_high: got {self.altitude_high:g}, expected "
                f"{self.altitude_low:g} to 10000 m"
            )


@dataclass(frozen=True)
class PluginConfig:
    """Limits of a planner or controller of the user's own, past which the episode ends as `error`.

    No decision depends on it: wall time and memory are this machine's.

    Attributes:
        wall_s: Wall time of one decision and its following, s.
        memory_mib: Memory of the whole process of `wayproof run`, MiB.
    """

    wall_s: Annotated[float, Bounds(0.1, 86400.0, "s")] = 60.0
    memory_mib: Annotated[int, Bounds(512, 2**24, "MiB")] = 6144

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "plugins.")


@dataclass(frozen=True)
class StackConfig:
    """Stack on trial, and whether the referee may brake in its place.

    Attributes:
        name: `builtin`, a reference stack, `module:Class` or `path/to/file.py:Class` of the user's
            own, `policy:FILE.onnx`, `exec:COMMAND`, `unix:PATH` or `tcp:HOST:PORT` of one that
            listens, or `ros2` with options.
        guard: Whether the referee brakes in the stack's place where its map does not admit the
            space that a command can sweep.
        version: Version of a stack whose code Wayproof cannot read, such as a container or ROS 2
            nodes: in a study, episodes of another version run again.
    """

    name: str = BUILTIN
    guard: bool = False
    version: str = ""


@dataclass(frozen=True)
class Config:
    """Everything that an episode follows from, with the versions of the installed packages.

    Attributes:
        world: Name in `models.worlds.WORLDS`, or the path of a world file; a log holds the name and
            hash of that file.
        robot: Name in `models.robots.ROBOTS`, or the path of a spec file; a log holds the name and
            hash of that robot.
        seed: Seed of the world and of every random stream; never random itself.
        difficulty: Difficulty of the world, 0 to 1, as its generator understands it.
        world_parameters: Parameters of the generated worlds; `--set world.PARAMETER`.
        goal: (x, y) or (x, y, z) in place of the world's own goal, m; or the name of a place, as in
            `models.places.PLACES`.
        start: (x, y) or (x, y, z) in place of the world's own start, m.
        waypoints: Goals before that one, in their order; the robot comes to rest at each.
        record: `full` logs all; `decisions` leaves sweeps and states out, which the seed gives
            again; `failures` is full where the episode failed, and decisions where it succeeded.
        keyframe_period: Simulated time between the maps in the log from which a replay can start,
            s; 0 for none.
        estimate: Source of the pose that the stack and the controller get.
        pose_model: Errors of the pose by `estimate.kind=model`.
        prior: A prior map, and what it may do.
        prediction: A predictor of unmeasured space, and what it may do.
        perturbation: The one assumption that is off, as `{"kind": ..., "severity": ...}`; or none.
        robot_file: Text of the robot's spec file, in a log; set by the run.
        prior_map: Cells of the prior map, in a log; set by the run.
        recording: The recording that the inputs come from, and how it is judged; none of a
            simulated episode.
    """

    world: str
    robot: str
    seed: int
    goal: tuple[float, ...] | str | None = None
    start: tuple[float, ...] | None = None
    waypoints: tuple[tuple[float, ...] | str, ...] = ()
    difficulty: Annotated[float, Bounds(0.0, 1.0)] = 0.5
    world_parameters: WorldParameters = field(default_factory=WorldParameters)
    record: Literal["full", "decisions", "failures"] = "full"
    keyframe_period: Annotated[float, Bounds(0.0, 3600.0, "s")] = 10.0
    sensors: SensorConfig = field(default_factory=SensorConfig)
    estimate: EstimateConfig = field(default_factory=EstimateConfig)
    pose_model: PoseModelConfig = field(default_factory=PoseModelConfig)
    map: MapConfig = field(default_factory=MapConfig)
    costmap: CostmapConfig = field(default_factory=CostmapConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    prior: PriorConfig = field(default_factory=PriorConfig)
    prediction: PredictionConfig = field(default_factory=PredictionConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    behaviour: BehaviourConfig = field(default_factory=BehaviourConfig)
    latency: LatencyConfig = field(default_factory=LatencyConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)
    plugins: PluginConfig = field(default_factory=PluginConfig)
    stack: StackConfig = field(default_factory=StackConfig)
    perturbation: AnyPerturbation | None = None
    robot_file: str = ""
    prior_map: bytes = field(default=b"", repr=False)
    recording: RecordingConfig | None = None

    def __post_init__(self) -> None:
        """Refuse points that are not 2 or 3 numbers and seeds that a generator would refuse."""
        _check_places(self)
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"seed: got {self.seed}, expected 0 to 2^63 - 1")
        check_fields(self, "")
        _check_estimate(self.estimate.kind, self.perturbation)
        _check_class_margins(self.costmap.class_margins, self.sensors.semantics)

    @property
    def sweeps_come_late(self) -> bool:
        """Whether sweeps may come later than the poses of their time, or out of order."""
        return self.perturbation is not None and self.perturbation.changes in LATE

    @property
    def has_layers(self) -> bool:
        """Whether decisions have other evidence than what was measured: a prior or predictions."""
        prior = self.prior.source != NO_PRIOR and self.prior.policy != "ignore"
        predicted = self.prediction.source != NO_PREDICTOR and self.prediction.policy != "ignore"
        return prior or predicted

    @property
    def runs_predictor(self) -> bool:
        """Whether a predictor from outside is run, whose predictions are inputs of decisions."""
        return is_outside(self.prediction.source) and self.prediction.policy != "ignore"


def _check_places(config: Config) -> None:
    """Raise a ValueError unless start and goals are 2 or 3 numbers, or goals names of places."""
    count = len(config.waypoints)
    if count > MOST_WAYPOINTS:
        raise ValueError(f"waypoints: got {count}, expected at most {MOST_WAYPOINTS}")
    if count and config.recording is not None:
        raise ValueError(f"waypoints: got {count} for a recording, expected none")
    waypoints = [("waypoints", point) for point in config.waypoints]
    for name, point in (("start", config.start), ("goal", config.goal), *waypoints):
        if isinstance(point, str):
            if point not in PLACES:
                raise ValueError(f"{name}: got '{point}', expected x,y, x,y,z or {_places()}")
        elif point is not None and len(point) not in (2, 3):
            raise ValueError(f"{name}: got {len(point)} numbers, expected x,y or x,y,z in m")


def _places() -> str:
    *names, last = PLACES
    return f"{', '.join(names)} or {last}"


def _check_estimate(kind: str, perturbation: AnyPerturbation | None) -> None:
    """Refuse a perturbation that acts on what the estimator does not have."""
    changes = getattr(perturbation, "changes", "")
    if kind == "lidar" and changes == "pose":
        raise ValueError(
            "estimate.kind: got 'lidar' with a perturbation of the pose, which is an error of "
            "the model; expected 'model' or a perturbation of the sensors"
        )
    if kind != "lidar" and changes == "motion_sensors":
        raise ValueError(
            f"estimate.kind: got '{kind}' with a perturbation of the inertial sensors, which only "
            "an odometry reads; expected 'lidar'"
        )


CODE = ("planner.name", "stack.name", "prediction.source")
"""Settings that may name code of the user's own."""


HASH_SEPARATOR = "@"
"""Separator in `name@hash`, the name of a world or robot that was read from a file."""

PLUGIN = ":"
"""Mark of the user's own code in the name of a planner or a robot's controller: `module:Class`."""


def _check_class_margins(margins: Mapping[str, float], semantics: bool) -> None:
    """Raise a ValueError unless every name is a class and the sweeps have classes."""
    for name in margins:
        if name not in CLASSES:
            raise ValueError(
                f"costmap.class_margins: got '{name}', expected one of {', '.join(CLASSES)}"
            )
    if margins and not semantics:
        raise ValueError(
            "costmap.class_margins: got margins without classes, expected sensors.semantics=true"
        )
