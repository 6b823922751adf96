from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ToStack(_message.Message):
    __slots__ = ("hello", "task", "observation", "close", "map_box")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    TASK_FIELD_NUMBER: _ClassVar[int]
    OBSERVATION_FIELD_NUMBER: _ClassVar[int]
    CLOSE_FIELD_NUMBER: _ClassVar[int]
    MAP_BOX_FIELD_NUMBER: _ClassVar[int]
    hello: Hello
    task: Task
    observation: Observation
    close: Close
    map_box: MapBox
    def __init__(self, hello: _Optional[_Union[Hello, _Mapping]] = ..., task: _Optional[_Union[Task, _Mapping]] = ..., observation: _Optional[_Union[Observation, _Mapping]] = ..., close: _Optional[_Union[Close, _Mapping]] = ..., map_box: _Optional[_Union[MapBox, _Mapping]] = ...) -> None: ...

class FromStack(_message.Message):
    __slots__ = ("hello", "command", "failure", "prediction")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    FAILURE_FIELD_NUMBER: _ClassVar[int]
    PREDICTION_FIELD_NUMBER: _ClassVar[int]
    hello: Hello
    command: Command
    failure: Failure
    prediction: Prediction
    def __init__(self, hello: _Optional[_Union[Hello, _Mapping]] = ..., command: _Optional[_Union[Command, _Mapping]] = ..., failure: _Optional[_Union[Failure, _Mapping]] = ..., prediction: _Optional[_Union[Prediction, _Mapping]] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("version", "name", "announced", "role")
    VERSION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    ANNOUNCED_FIELD_NUMBER: _ClassVar[int]
    ROLE_FIELD_NUMBER: _ClassVar[int]
    version: int
    name: str
    announced: bool
    role: str
    def __init__(self, version: _Optional[int] = ..., name: _Optional[str] = ..., announced: _Optional[bool] = ..., role: _Optional[str] = ...) -> None: ...

class Close(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class Failure(_message.Message):
    __slots__ = ("text", "traceback")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    TRACEBACK_FIELD_NUMBER: _ClassVar[int]
    text: str
    traceback: str
    def __init__(self, text: _Optional[str] = ..., traceback: _Optional[str] = ...) -> None: ...

class Vector(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Disc(_message.Message):
    __slots__ = ("offset", "radius")
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    RADIUS_FIELD_NUMBER: _ClassVar[int]
    offset: float
    radius: float
    def __init__(self, offset: _Optional[float] = ..., radius: _Optional[float] = ...) -> None: ...

class Task(_message.Message):
    __slots__ = ("robot", "seed", "motion", "radius", "height", "step_height", "max_speed", "max_acceleration", "max_jerk", "max_yaw_rate", "discs", "low", "high", "start", "start_heading", "goal", "goal_tolerance", "period_s", "delay_s", "deadline_s", "sensors", "settings", "waypoints", "prior", "sideways_speed", "rest_height", "max_yaw_acceleration")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    RADIUS_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    STEP_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    MAX_SPEED_FIELD_NUMBER: _ClassVar[int]
    MAX_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    MAX_JERK_FIELD_NUMBER: _ClassVar[int]
    MAX_YAW_RATE_FIELD_NUMBER: _ClassVar[int]
    DISCS_FIELD_NUMBER: _ClassVar[int]
    LOW_FIELD_NUMBER: _ClassVar[int]
    HIGH_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    START_HEADING_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    GOAL_TOLERANCE_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    DELAY_S_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_S_FIELD_NUMBER: _ClassVar[int]
    SENSORS_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_FIELD_NUMBER: _ClassVar[int]
    WAYPOINTS_FIELD_NUMBER: _ClassVar[int]
    PRIOR_FIELD_NUMBER: _ClassVar[int]
    SIDEWAYS_SPEED_FIELD_NUMBER: _ClassVar[int]
    REST_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    MAX_YAW_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    robot: str
    seed: int
    motion: str
    radius: float
    height: float
    step_height: float
    max_speed: float
    max_acceleration: float
    max_jerk: float
    max_yaw_rate: float
    discs: _containers.RepeatedCompositeFieldContainer[Disc]
    low: Vector
    high: Vector
    start: Vector
    start_heading: float
    goal: Vector
    goal_tolerance: float
    period_s: float
    delay_s: float
    deadline_s: float
    sensors: _containers.RepeatedCompositeFieldContainer[Sensor]
    settings: str
    waypoints: _containers.RepeatedCompositeFieldContainer[Vector]
    prior: PriorMap
    sideways_speed: float
    rest_height: float
    max_yaw_acceleration: float
    def __init__(self, robot: _Optional[str] = ..., seed: _Optional[int] = ..., motion: _Optional[str] = ..., radius: _Optional[float] = ..., height: _Optional[float] = ..., step_height: _Optional[float] = ..., max_speed: _Optional[float] = ..., max_acceleration: _Optional[float] = ..., max_jerk: _Optional[float] = ..., max_yaw_rate: _Optional[float] = ..., discs: _Optional[_Iterable[_Union[Disc, _Mapping]]] = ..., low: _Optional[_Union[Vector, _Mapping]] = ..., high: _Optional[_Union[Vector, _Mapping]] = ..., start: _Optional[_Union[Vector, _Mapping]] = ..., start_heading: _Optional[float] = ..., goal: _Optional[_Union[Vector, _Mapping]] = ..., goal_tolerance: _Optional[float] = ..., period_s: _Optional[float] = ..., delay_s: _Optional[float] = ..., deadline_s: _Optional[float] = ..., sensors: _Optional[_Iterable[_Union[Sensor, _Mapping]]] = ..., settings: _Optional[str] = ..., waypoints: _Optional[_Iterable[_Union[Vector, _Mapping]]] = ..., prior: _Optional[_Union[PriorMap, _Mapping]] = ..., sideways_speed: _Optional[float] = ..., rest_height: _Optional[float] = ..., max_yaw_acceleration: _Optional[float] = ...) -> None: ...

class PriorMap(_message.Message):
    __slots__ = ("resolution", "origin", "shape", "states")
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    resolution: float
    origin: Vector
    shape: _containers.RepeatedScalarFieldContainer[int]
    states: bytes
    def __init__(self, resolution: _Optional[float] = ..., origin: _Optional[_Union[Vector, _Mapping]] = ..., shape: _Optional[_Iterable[int]] = ..., states: _Optional[bytes] = ...) -> None: ...

class Sensor(_message.Message):
    __slots__ = ("name", "kind", "range_m", "rate_hz", "position_base_sensor", "rotation_base_sensor", "directions", "beams", "info", "measures")
    NAME_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    POSITION_BASE_SENSOR_FIELD_NUMBER: _ClassVar[int]
    ROTATION_BASE_SENSOR_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    BEAMS_FIELD_NUMBER: _ClassVar[int]
    INFO_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    name: str
    kind: str
    range_m: float
    rate_hz: float
    position_base_sensor: _containers.RepeatedScalarFieldContainer[float]
    rotation_base_sensor: _containers.RepeatedScalarFieldContainer[float]
    directions: bytes
    beams: int
    info: bytes
    measures: str
    def __init__(self, name: _Optional[str] = ..., kind: _Optional[str] = ..., range_m: _Optional[float] = ..., rate_hz: _Optional[float] = ..., position_base_sensor: _Optional[_Iterable[float]] = ..., rotation_base_sensor: _Optional[_Iterable[float]] = ..., directions: _Optional[bytes] = ..., beams: _Optional[int] = ..., info: _Optional[bytes] = ..., measures: _Optional[str] = ...) -> None: ...

class Sweep(_message.Message):
    __slots__ = ("sensor", "ranges_mm", "classes", "directions", "age_ns", "lag")
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    RANGES_MM_FIELD_NUMBER: _ClassVar[int]
    CLASSES_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    AGE_NS_FIELD_NUMBER: _ClassVar[int]
    LAG_FIELD_NUMBER: _ClassVar[int]
    sensor: str
    ranges_mm: bytes
    classes: bytes
    directions: bytes
    age_ns: int
    lag: int
    def __init__(self, sensor: _Optional[str] = ..., ranges_mm: _Optional[bytes] = ..., classes: _Optional[bytes] = ..., directions: _Optional[bytes] = ..., age_ns: _Optional[int] = ..., lag: _Optional[int] = ...) -> None: ...

class Observation(_message.Message):
    __slots__ = ("time_ns", "sequence", "position", "quaternion", "position_sigma", "heading_sigma", "velocity", "yaw_rate", "sweeps", "effect_ns", "reference_position", "reference_velocity", "reference_heading", "reference_yaw_rate", "at_rest", "last", "trail_positions", "trail_quaternions", "trail_period_s", "covariance", "unheld", "goal", "goals_reached", "pose_age_ns")
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    POSITION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    HEADING_SIGMA_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    YAW_RATE_FIELD_NUMBER: _ClassVar[int]
    SWEEPS_FIELD_NUMBER: _ClassVar[int]
    EFFECT_NS_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_POSITION_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_HEADING_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_YAW_RATE_FIELD_NUMBER: _ClassVar[int]
    AT_REST_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    TRAIL_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    TRAIL_QUATERNIONS_FIELD_NUMBER: _ClassVar[int]
    TRAIL_PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    UNHELD_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    GOALS_REACHED_FIELD_NUMBER: _ClassVar[int]
    POSE_AGE_NS_FIELD_NUMBER: _ClassVar[int]
    time_ns: int
    sequence: int
    position: Vector
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    position_sigma: float
    heading_sigma: float
    velocity: Vector
    yaw_rate: float
    sweeps: _containers.RepeatedCompositeFieldContainer[Sweep]
    effect_ns: int
    reference_position: Vector
    reference_velocity: Vector
    reference_heading: float
    reference_yaw_rate: float
    at_rest: bool
    last: Fate
    trail_positions: _containers.RepeatedScalarFieldContainer[float]
    trail_quaternions: _containers.RepeatedScalarFieldContainer[float]
    trail_period_s: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    unheld: _containers.RepeatedScalarFieldContainer[float]
    goal: Vector
    goals_reached: int
    pose_age_ns: int
    def __init__(self, time_ns: _Optional[int] = ..., sequence: _Optional[int] = ..., position: _Optional[_Union[Vector, _Mapping]] = ..., quaternion: _Optional[_Iterable[float]] = ..., position_sigma: _Optional[float] = ..., heading_sigma: _Optional[float] = ..., velocity: _Optional[_Union[Vector, _Mapping]] = ..., yaw_rate: _Optional[float] = ..., sweeps: _Optional[_Iterable[_Union[Sweep, _Mapping]]] = ..., effect_ns: _Optional[int] = ..., reference_position: _Optional[_Union[Vector, _Mapping]] = ..., reference_velocity: _Optional[_Union[Vector, _Mapping]] = ..., reference_heading: _Optional[float] = ..., reference_yaw_rate: _Optional[float] = ..., at_rest: _Optional[bool] = ..., last: _Optional[_Union[Fate, _Mapping]] = ..., trail_positions: _Optional[_Iterable[float]] = ..., trail_quaternions: _Optional[_Iterable[float]] = ..., trail_period_s: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., unheld: _Optional[_Iterable[float]] = ..., goal: _Optional[_Union[Vector, _Mapping]] = ..., goals_reached: _Optional[int] = ..., pose_age_ns: _Optional[int] = ...) -> None: ...

class Fate(_message.Message):
    __slots__ = ("sequence", "fate", "verdict")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FATE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    fate: str
    verdict: str
    def __init__(self, sequence: _Optional[int] = ..., fate: _Optional[str] = ..., verdict: _Optional[str] = ...) -> None: ...

class Profile(_message.Message):
    __slots__ = ("times", "states", "jerks", "duration", "end")
    TIMES_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    JERKS_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    times: _containers.RepeatedScalarFieldContainer[float]
    states: _containers.RepeatedScalarFieldContainer[float]
    jerks: _containers.RepeatedScalarFieldContainer[float]
    duration: float
    end: float
    def __init__(self, times: _Optional[_Iterable[float]] = ..., states: _Optional[_Iterable[float]] = ..., jerks: _Optional[_Iterable[float]] = ..., duration: _Optional[float] = ..., end: _Optional[float] = ...) -> None: ...

class ProfiledTrajectory(_message.Message):
    __slots__ = ("start_ns", "path", "motion", "turning", "overshoot_m")
    START_NS_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    TURNING_FIELD_NUMBER: _ClassVar[int]
    OVERSHOOT_M_FIELD_NUMBER: _ClassVar[int]
    start_ns: int
    path: _containers.RepeatedScalarFieldContainer[float]
    motion: Profile
    turning: Profile
    overshoot_m: float
    def __init__(self, start_ns: _Optional[int] = ..., path: _Optional[_Iterable[float]] = ..., motion: _Optional[_Union[Profile, _Mapping]] = ..., turning: _Optional[_Union[Profile, _Mapping]] = ..., overshoot_m: _Optional[float] = ...) -> None: ...

class SampledTrajectory(_message.Message):
    __slots__ = ("period_s", "positions", "headings")
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    HEADINGS_FIELD_NUMBER: _ClassVar[int]
    period_s: float
    positions: _containers.RepeatedScalarFieldContainer[float]
    headings: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, period_s: _Optional[float] = ..., positions: _Optional[_Iterable[float]] = ..., headings: _Optional[_Iterable[float]] = ...) -> None: ...

class Velocity(_message.Message):
    __slots__ = ("forward", "left", "up", "yaw_rate", "duration_s")
    FORWARD_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    UP_FIELD_NUMBER: _ClassVar[int]
    YAW_RATE_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    forward: float
    left: float
    up: float
    yaw_rate: float
    duration_s: float
    def __init__(self, forward: _Optional[float] = ..., left: _Optional[float] = ..., up: _Optional[float] = ..., yaw_rate: _Optional[float] = ..., duration_s: _Optional[float] = ...) -> None: ...

class Waypoints(_message.Message):
    __slots__ = ("points", "speed")
    POINTS_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    points: _containers.RepeatedScalarFieldContainer[float]
    speed: float
    def __init__(self, points: _Optional[_Iterable[float]] = ..., speed: _Optional[float] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("profiled", "sampled", "velocity", "waypoints", "sequence", "action", "label", "reason", "planned_path", "map_version", "scalars", "costmap")
    class ScalarsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    PROFILED_FIELD_NUMBER: _ClassVar[int]
    SAMPLED_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    WAYPOINTS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    LABEL_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    PLANNED_PATH_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    SCALARS_FIELD_NUMBER: _ClassVar[int]
    COSTMAP_FIELD_NUMBER: _ClassVar[int]
    profiled: ProfiledTrajectory
    sampled: SampledTrajectory
    velocity: Velocity
    waypoints: Waypoints
    sequence: int
    action: str
    label: str
    reason: str
    planned_path: _containers.RepeatedScalarFieldContainer[float]
    map_version: str
    scalars: _containers.ScalarMap[str, float]
    costmap: Grid
    def __init__(self, profiled: _Optional[_Union[ProfiledTrajectory, _Mapping]] = ..., sampled: _Optional[_Union[SampledTrajectory, _Mapping]] = ..., velocity: _Optional[_Union[Velocity, _Mapping]] = ..., waypoints: _Optional[_Union[Waypoints, _Mapping]] = ..., sequence: _Optional[int] = ..., action: _Optional[str] = ..., label: _Optional[str] = ..., reason: _Optional[str] = ..., planned_path: _Optional[_Iterable[float]] = ..., map_version: _Optional[str] = ..., scalars: _Optional[_Mapping[str, float]] = ..., costmap: _Optional[_Union[Grid, _Mapping]] = ...) -> None: ...

class Grid(_message.Message):
    __slots__ = ("x", "y", "resolution", "width", "height", "cells")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    CELLS_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    resolution: float
    width: int
    height: int
    cells: bytes
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., resolution: _Optional[float] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., cells: _Optional[bytes] = ...) -> None: ...

class MapBox(_message.Message):
    __slots__ = ("time_ns", "sequence", "resolution", "origin", "shape", "states", "position", "quaternion")
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    time_ns: int
    sequence: int
    resolution: float
    origin: Vector
    shape: _containers.RepeatedScalarFieldContainer[int]
    states: bytes
    position: Vector
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, time_ns: _Optional[int] = ..., sequence: _Optional[int] = ..., resolution: _Optional[float] = ..., origin: _Optional[_Union[Vector, _Mapping]] = ..., shape: _Optional[_Iterable[int]] = ..., states: _Optional[bytes] = ..., position: _Optional[_Union[Vector, _Mapping]] = ..., quaternion: _Optional[_Iterable[float]] = ...) -> None: ...

class Prediction(_message.Message):
    __slots__ = ("sequence", "offset", "shape", "log_odds")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    LOG_ODDS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    offset: _containers.RepeatedScalarFieldContainer[int]
    shape: _containers.RepeatedScalarFieldContainer[int]
    log_odds: bytes
    def __init__(self, sequence: _Optional[int] = ..., offset: _Optional[_Iterable[int]] = ..., shape: _Optional[_Iterable[int]] = ..., log_odds: _Optional[bytes] = ...) -> None: ...
