import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SensorInfo(_message.Message):
    __slots__ = ("name", "kind", "range_m", "row_width", "rows", "columns", "position_base_sensor", "rotation_base_sensor", "order", "beams", "row_step", "column_step", "scan_poses", "measures", "rate_hz", "device", "source")
    NAME_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    ROW_WIDTH_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    POSITION_BASE_SENSOR_FIELD_NUMBER: _ClassVar[int]
    ROTATION_BASE_SENSOR_FIELD_NUMBER: _ClassVar[int]
    ORDER_FIELD_NUMBER: _ClassVar[int]
    BEAMS_FIELD_NUMBER: _ClassVar[int]
    ROW_STEP_FIELD_NUMBER: _ClassVar[int]
    COLUMN_STEP_FIELD_NUMBER: _ClassVar[int]
    SCAN_POSES_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    name: str
    kind: str
    range_m: float
    row_width: int
    rows: _containers.RepeatedScalarFieldContainer[float]
    columns: _containers.RepeatedScalarFieldContainer[float]
    position_base_sensor: _containers.RepeatedScalarFieldContainer[float]
    rotation_base_sensor: _containers.RepeatedScalarFieldContainer[float]
    order: str
    beams: int
    row_step: int
    column_step: int
    scan_poses: int
    measures: str
    rate_hz: float
    device: str
    source: str
    def __init__(self, name: _Optional[str] = ..., kind: _Optional[str] = ..., range_m: _Optional[float] = ..., row_width: _Optional[int] = ..., rows: _Optional[_Iterable[float]] = ..., columns: _Optional[_Iterable[float]] = ..., position_base_sensor: _Optional[_Iterable[float]] = ..., rotation_base_sensor: _Optional[_Iterable[float]] = ..., order: _Optional[str] = ..., beams: _Optional[int] = ..., row_step: _Optional[int] = ..., column_step: _Optional[int] = ..., scan_poses: _Optional[int] = ..., measures: _Optional[str] = ..., rate_hz: _Optional[float] = ..., device: _Optional[str] = ..., source: _Optional[str] = ...) -> None: ...

class Sweep(_message.Message):
    __slots__ = ("timestamp", "sequence", "sensor", "rows", "columns", "codec", "ranges", "classes", "directions", "beam_poses", "ages_ns", "mount", "age_ns", "lag")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    CODEC_FIELD_NUMBER: _ClassVar[int]
    RANGES_FIELD_NUMBER: _ClassVar[int]
    CLASSES_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    BEAM_POSES_FIELD_NUMBER: _ClassVar[int]
    AGES_NS_FIELD_NUMBER: _ClassVar[int]
    MOUNT_FIELD_NUMBER: _ClassVar[int]
    AGE_NS_FIELD_NUMBER: _ClassVar[int]
    LAG_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    sensor: str
    rows: int
    columns: int
    codec: str
    ranges: bytes
    classes: bytes
    directions: bytes
    beam_poses: bytes
    ages_ns: _containers.RepeatedScalarFieldContainer[int]
    mount: _containers.RepeatedScalarFieldContainer[float]
    age_ns: int
    lag: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., sensor: _Optional[str] = ..., rows: _Optional[int] = ..., columns: _Optional[int] = ..., codec: _Optional[str] = ..., ranges: _Optional[bytes] = ..., classes: _Optional[bytes] = ..., directions: _Optional[bytes] = ..., beam_poses: _Optional[bytes] = ..., ages_ns: _Optional[_Iterable[int]] = ..., mount: _Optional[_Iterable[float]] = ..., age_ns: _Optional[int] = ..., lag: _Optional[int] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("timestamp", "sequence", "position", "quaternion", "position_sigma", "history_positions", "history_quaternions", "history_period_s", "heading_sigma", "estimator", "covariance", "information", "unheld", "age_ns")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    POSITION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    HISTORY_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    HISTORY_QUATERNIONS_FIELD_NUMBER: _ClassVar[int]
    HISTORY_PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    HEADING_SIGMA_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    INFORMATION_FIELD_NUMBER: _ClassVar[int]
    UNHELD_FIELD_NUMBER: _ClassVar[int]
    AGE_NS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    position: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    position_sigma: float
    history_positions: _containers.RepeatedScalarFieldContainer[float]
    history_quaternions: _containers.RepeatedScalarFieldContainer[float]
    history_period_s: float
    heading_sigma: float
    estimator: str
    covariance: _containers.RepeatedScalarFieldContainer[float]
    information: _containers.RepeatedScalarFieldContainer[float]
    unheld: _containers.RepeatedScalarFieldContainer[float]
    age_ns: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., position: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., position_sigma: _Optional[float] = ..., history_positions: _Optional[_Iterable[float]] = ..., history_quaternions: _Optional[_Iterable[float]] = ..., history_period_s: _Optional[float] = ..., heading_sigma: _Optional[float] = ..., estimator: _Optional[str] = ..., covariance: _Optional[_Iterable[float]] = ..., information: _Optional[_Iterable[float]] = ..., unheld: _Optional[_Iterable[float]] = ..., age_ns: _Optional[int] = ...) -> None: ...

class Goal(_message.Message):
    __slots__ = ("timestamp", "sequence", "position", "index")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    INDEX_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    position: _containers.RepeatedScalarFieldContainer[float]
    index: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., position: _Optional[_Iterable[float]] = ..., index: _Optional[int] = ...) -> None: ...

class RecordedMotion(_message.Message):
    __slots__ = ("timestamp", "sequence", "position", "quaternion", "velocity", "way", "own_maps")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    WAY_FIELD_NUMBER: _ClassVar[int]
    OWN_MAPS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    position: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    velocity: _containers.RepeatedScalarFieldContainer[float]
    way: _containers.RepeatedScalarFieldContainer[float]
    own_maps: _containers.RepeatedCompositeFieldContainer[OwnMap]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., position: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., velocity: _Optional[_Iterable[float]] = ..., way: _Optional[_Iterable[float]] = ..., own_maps: _Optional[_Iterable[_Union[OwnMap, _Mapping]]] = ...) -> None: ...

class OwnMap(_message.Message):
    __slots__ = ("timestamp", "topic", "resolution", "corner", "rows", "columns", "packed")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    CORNER_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    PACKED_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    topic: str
    resolution: float
    corner: _containers.RepeatedScalarFieldContainer[float]
    rows: int
    columns: int
    packed: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., topic: _Optional[str] = ..., resolution: _Optional[float] = ..., corner: _Optional[_Iterable[float]] = ..., rows: _Optional[int] = ..., columns: _Optional[int] = ..., packed: _Optional[bytes] = ...) -> None: ...

class Latency(_message.Message):
    __slots__ = ("timestamp", "sequence", "mode", "delay_s")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    DELAY_S_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    mode: str
    delay_s: float
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., mode: _Optional[str] = ..., delay_s: _Optional[float] = ...) -> None: ...

class StageLatency(_message.Message):
    __slots__ = ("sense_ms", "map_ms", "costmap_ms", "plan_ms", "answer_ms", "predict_ms")
    SENSE_MS_FIELD_NUMBER: _ClassVar[int]
    MAP_MS_FIELD_NUMBER: _ClassVar[int]
    COSTMAP_MS_FIELD_NUMBER: _ClassVar[int]
    PLAN_MS_FIELD_NUMBER: _ClassVar[int]
    ANSWER_MS_FIELD_NUMBER: _ClassVar[int]
    PREDICT_MS_FIELD_NUMBER: _ClassVar[int]
    sense_ms: float
    map_ms: float
    costmap_ms: float
    plan_ms: float
    answer_ms: float
    predict_ms: float
    def __init__(self, sense_ms: _Optional[float] = ..., map_ms: _Optional[float] = ..., costmap_ms: _Optional[float] = ..., plan_ms: _Optional[float] = ..., answer_ms: _Optional[float] = ..., predict_ms: _Optional[float] = ...) -> None: ...

class Point(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Trajectory(_message.Message):
    __slots__ = ("start", "duration_s", "path", "arc_length", "heading", "sample_period_s")
    START_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    ARC_LENGTH_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    start: _timestamp_pb2.Timestamp
    duration_s: float
    path: _containers.RepeatedCompositeFieldContainer[Point]
    arc_length: _containers.RepeatedScalarFieldContainer[float]
    heading: _containers.RepeatedScalarFieldContainer[float]
    sample_period_s: float
    def __init__(self, start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., duration_s: _Optional[float] = ..., path: _Optional[_Iterable[_Union[Point, _Mapping]]] = ..., arc_length: _Optional[_Iterable[float]] = ..., heading: _Optional[_Iterable[float]] = ..., sample_period_s: _Optional[float] = ...) -> None: ...

class PackedDecision(_message.Message):
    __slots__ = ("path", "arc_length", "heading", "global_path", "hashes")
    PATH_FIELD_NUMBER: _ClassVar[int]
    ARC_LENGTH_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    GLOBAL_PATH_FIELD_NUMBER: _ClassVar[int]
    HASHES_FIELD_NUMBER: _ClassVar[int]
    path: _containers.RepeatedScalarFieldContainer[int]
    arc_length: _containers.RepeatedScalarFieldContainer[int]
    heading: _containers.RepeatedScalarFieldContainer[int]
    global_path: _containers.RepeatedScalarFieldContainer[int]
    hashes: bytes
    def __init__(self, path: _Optional[_Iterable[int]] = ..., arc_length: _Optional[_Iterable[int]] = ..., heading: _Optional[_Iterable[int]] = ..., global_path: _Optional[_Iterable[int]] = ..., hashes: _Optional[bytes] = ...) -> None: ...

class Reason(_message.Message):
    __slots__ = ("kind", "free_m", "path_m", "distance_m", "limit_m", "turn_rad", "waited_s", "delay_s", "deadline_s", "since", "places", "iterations", "cell", "cell_state", "place", "target", "sigma_m", "range_sigma_m", "frontier")
    KIND_FIELD_NUMBER: _ClassVar[int]
    FREE_M_FIELD_NUMBER: _ClassVar[int]
    PATH_M_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    LIMIT_M_FIELD_NUMBER: _ClassVar[int]
    TURN_RAD_FIELD_NUMBER: _ClassVar[int]
    WAITED_S_FIELD_NUMBER: _ClassVar[int]
    DELAY_S_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_S_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    PLACES_FIELD_NUMBER: _ClassVar[int]
    ITERATIONS_FIELD_NUMBER: _ClassVar[int]
    CELL_FIELD_NUMBER: _ClassVar[int]
    CELL_STATE_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    RANGE_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    FRONTIER_FIELD_NUMBER: _ClassVar[int]
    kind: str
    free_m: float
    path_m: float
    distance_m: float
    limit_m: float
    turn_rad: float
    waited_s: float
    delay_s: float
    deadline_s: float
    since: int
    places: int
    iterations: int
    cell: Point
    cell_state: str
    place: Point
    target: Point
    sigma_m: float
    range_sigma_m: float
    frontier: str
    def __init__(self, kind: _Optional[str] = ..., free_m: _Optional[float] = ..., path_m: _Optional[float] = ..., distance_m: _Optional[float] = ..., limit_m: _Optional[float] = ..., turn_rad: _Optional[float] = ..., waited_s: _Optional[float] = ..., delay_s: _Optional[float] = ..., deadline_s: _Optional[float] = ..., since: _Optional[int] = ..., places: _Optional[int] = ..., iterations: _Optional[int] = ..., cell: _Optional[_Union[Point, _Mapping]] = ..., cell_state: _Optional[str] = ..., place: _Optional[_Union[Point, _Mapping]] = ..., target: _Optional[_Union[Point, _Mapping]] = ..., sigma_m: _Optional[float] = ..., range_sigma_m: _Optional[float] = ..., frontier: _Optional[str] = ...) -> None: ...

class StackCommand(_message.Message):
    __slots__ = ("timestamp", "sequence", "command")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    command: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., command: _Optional[bytes] = ...) -> None: ...

class Prediction(_message.Message):
    __slots__ = ("timestamp", "sequence", "predictor", "first", "shape", "log_odds", "late")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    PREDICTOR_FIELD_NUMBER: _ClassVar[int]
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    LOG_ODDS_FIELD_NUMBER: _ClassVar[int]
    LATE_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    predictor: str
    first: _containers.RepeatedScalarFieldContainer[int]
    shape: _containers.RepeatedScalarFieldContainer[int]
    log_odds: bytes
    late: bool
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., predictor: _Optional[str] = ..., first: _Optional[_Iterable[int]] = ..., shape: _Optional[_Iterable[int]] = ..., log_odds: _Optional[bytes] = ..., late: _Optional[bool] = ...) -> None: ...

class Verdict(_message.Message):
    __slots__ = ("verdict", "free_m", "cut", "limited")
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    FREE_M_FIELD_NUMBER: _ClassVar[int]
    CUT_FIELD_NUMBER: _ClassVar[int]
    LIMITED_FIELD_NUMBER: _ClassVar[int]
    verdict: str
    free_m: float
    cut: bool
    limited: bool
    def __init__(self, verdict: _Optional[str] = ..., free_m: _Optional[float] = ..., cut: _Optional[bool] = ..., limited: _Optional[bool] = ...) -> None: ...

class Evidence(_message.Message):
    __slots__ = ("measured_m", "prior_m", "predicted_m", "unproven_m")
    MEASURED_M_FIELD_NUMBER: _ClassVar[int]
    PRIOR_M_FIELD_NUMBER: _ClassVar[int]
    PREDICTED_M_FIELD_NUMBER: _ClassVar[int]
    UNPROVEN_M_FIELD_NUMBER: _ClassVar[int]
    measured_m: float
    prior_m: float
    predicted_m: float
    unproven_m: float
    def __init__(self, measured_m: _Optional[float] = ..., prior_m: _Optional[float] = ..., predicted_m: _Optional[float] = ..., unproven_m: _Optional[float] = ...) -> None: ...

class Decision(_message.Message):
    __slots__ = ("timestamp", "sequence", "trigger", "representation", "map_version", "resolution_m", "unknown_policy", "inflation_radius_m", "localization_margin_m", "widening", "collision_distance_sq", "position", "quaternion", "position_sigma", "input_digest", "evidence_age_s", "planner", "planner_seed", "planner_iterations", "path_cost", "path_length_m", "least_clearance_m", "stages", "delay_s", "deadline_s", "deadline_missed", "action", "reason", "label", "global_path", "trajectory", "committed_length_m", "chain", "packed", "predicate", "verdict", "committed_evidence", "global_evidence")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TRIGGER_FIELD_NUMBER: _ClassVar[int]
    REPRESENTATION_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_M_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_POLICY_FIELD_NUMBER: _ClassVar[int]
    INFLATION_RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    LOCALIZATION_MARGIN_M_FIELD_NUMBER: _ClassVar[int]
    WIDENING_FIELD_NUMBER: _ClassVar[int]
    COLLISION_DISTANCE_SQ_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    POSITION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    INPUT_DIGEST_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_AGE_S_FIELD_NUMBER: _ClassVar[int]
    PLANNER_FIELD_NUMBER: _ClassVar[int]
    PLANNER_SEED_FIELD_NUMBER: _ClassVar[int]
    PLANNER_ITERATIONS_FIELD_NUMBER: _ClassVar[int]
    PATH_COST_FIELD_NUMBER: _ClassVar[int]
    PATH_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    LEAST_CLEARANCE_M_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    DELAY_S_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_S_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_MISSED_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LABEL_FIELD_NUMBER: _ClassVar[int]
    GLOBAL_PATH_FIELD_NUMBER: _ClassVar[int]
    TRAJECTORY_FIELD_NUMBER: _ClassVar[int]
    COMMITTED_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    CHAIN_FIELD_NUMBER: _ClassVar[int]
    PACKED_FIELD_NUMBER: _ClassVar[int]
    PREDICATE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    COMMITTED_EVIDENCE_FIELD_NUMBER: _ClassVar[int]
    GLOBAL_EVIDENCE_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    trigger: str
    representation: str
    map_version: str
    resolution_m: float
    unknown_policy: str
    inflation_radius_m: float
    localization_margin_m: float
    widening: _containers.RepeatedScalarFieldContainer[int]
    collision_distance_sq: int
    position: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    position_sigma: float
    input_digest: str
    evidence_age_s: float
    planner: str
    planner_seed: int
    planner_iterations: int
    path_cost: float
    path_length_m: float
    least_clearance_m: float
    stages: StageLatency
    delay_s: float
    deadline_s: float
    deadline_missed: bool
    action: str
    reason: str
    label: str
    global_path: _containers.RepeatedCompositeFieldContainer[Point]
    trajectory: Trajectory
    committed_length_m: float
    chain: str
    packed: PackedDecision
    predicate: Reason
    verdict: Verdict
    committed_evidence: Evidence
    global_evidence: Evidence
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., trigger: _Optional[str] = ..., representation: _Optional[str] = ..., map_version: _Optional[str] = ..., resolution_m: _Optional[float] = ..., unknown_policy: _Optional[str] = ..., inflation_radius_m: _Optional[float] = ..., localization_margin_m: _Optional[float] = ..., widening: _Optional[_Iterable[int]] = ..., collision_distance_sq: _Optional[int] = ..., position: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., position_sigma: _Optional[float] = ..., input_digest: _Optional[str] = ..., evidence_age_s: _Optional[float] = ..., planner: _Optional[str] = ..., planner_seed: _Optional[int] = ..., planner_iterations: _Optional[int] = ..., path_cost: _Optional[float] = ..., path_length_m: _Optional[float] = ..., least_clearance_m: _Optional[float] = ..., stages: _Optional[_Union[StageLatency, _Mapping]] = ..., delay_s: _Optional[float] = ..., deadline_s: _Optional[float] = ..., deadline_missed: _Optional[bool] = ..., action: _Optional[str] = ..., reason: _Optional[str] = ..., label: _Optional[str] = ..., global_path: _Optional[_Iterable[_Union[Point, _Mapping]]] = ..., trajectory: _Optional[_Union[Trajectory, _Mapping]] = ..., committed_length_m: _Optional[float] = ..., chain: _Optional[str] = ..., packed: _Optional[_Union[PackedDecision, _Mapping]] = ..., predicate: _Optional[_Union[Reason, _Mapping]] = ..., verdict: _Optional[_Union[Verdict, _Mapping]] = ..., committed_evidence: _Optional[_Union[Evidence, _Mapping]] = ..., global_evidence: _Optional[_Union[Evidence, _Mapping]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("timestamp", "sequence", "position", "quaternion", "velocity", "clearance_m", "collisions", "movers", "hit_by_mover")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    CLEARANCE_M_FIELD_NUMBER: _ClassVar[int]
    COLLISIONS_FIELD_NUMBER: _ClassVar[int]
    MOVERS_FIELD_NUMBER: _ClassVar[int]
    HIT_BY_MOVER_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    position: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    velocity: _containers.RepeatedScalarFieldContainer[float]
    clearance_m: float
    collisions: int
    movers: _containers.RepeatedCompositeFieldContainer[MoverPose]
    hit_by_mover: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., position: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ..., velocity: _Optional[_Iterable[float]] = ..., clearance_m: _Optional[float] = ..., collisions: _Optional[int] = ..., movers: _Optional[_Iterable[_Union[MoverPose, _Mapping]]] = ..., hit_by_mover: _Optional[int] = ...) -> None: ...

class MoverPose(_message.Message):
    __slots__ = ("name", "present", "position", "quaternion")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PRESENT_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    QUATERNION_FIELD_NUMBER: _ClassVar[int]
    name: str
    present: bool
    position: _containers.RepeatedScalarFieldContainer[float]
    quaternion: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, name: _Optional[str] = ..., present: _Optional[bool] = ..., position: _Optional[_Iterable[float]] = ..., quaternion: _Optional[_Iterable[float]] = ...) -> None: ...

class StreamHash(_message.Message):
    __slots__ = ("name", "hash")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HASH_FIELD_NUMBER: _ClassVar[int]
    name: str
    hash: str
    def __init__(self, name: _Optional[str] = ..., hash: _Optional[str] = ...) -> None: ...

class Streams(_message.Message):
    __slots__ = ("timestamp", "sequence", "streams", "packed")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    STREAMS_FIELD_NUMBER: _ClassVar[int]
    PACKED_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    streams: _containers.RepeatedCompositeFieldContainer[StreamHash]
    packed: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., streams: _Optional[_Iterable[_Union[StreamHash, _Mapping]]] = ..., packed: _Optional[bytes] = ...) -> None: ...

class Perturbation(_message.Message):
    __slots__ = ("timestamp", "sequence", "kind", "severity", "amount", "unit", "streams", "pose_shift", "pose_turn", "changed_beams", "withheld", "added_delay_s", "displaced_position", "displaced_quaternion", "exact_severity", "evidence_age_s")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    AMOUNT_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    STREAMS_FIELD_NUMBER: _ClassVar[int]
    POSE_SHIFT_FIELD_NUMBER: _ClassVar[int]
    POSE_TURN_FIELD_NUMBER: _ClassVar[int]
    CHANGED_BEAMS_FIELD_NUMBER: _ClassVar[int]
    WITHHELD_FIELD_NUMBER: _ClassVar[int]
    ADDED_DELAY_S_FIELD_NUMBER: _ClassVar[int]
    DISPLACED_POSITION_FIELD_NUMBER: _ClassVar[int]
    DISPLACED_QUATERNION_FIELD_NUMBER: _ClassVar[int]
    EXACT_SEVERITY_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_AGE_S_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    kind: str
    severity: int
    amount: float
    unit: str
    streams: _containers.RepeatedScalarFieldContainer[str]
    pose_shift: _containers.RepeatedScalarFieldContainer[float]
    pose_turn: float
    changed_beams: int
    withheld: _containers.RepeatedScalarFieldContainer[str]
    added_delay_s: float
    displaced_position: _containers.RepeatedScalarFieldContainer[float]
    displaced_quaternion: _containers.RepeatedScalarFieldContainer[float]
    exact_severity: float
    evidence_age_s: float
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., kind: _Optional[str] = ..., severity: _Optional[int] = ..., amount: _Optional[float] = ..., unit: _Optional[str] = ..., streams: _Optional[_Iterable[str]] = ..., pose_shift: _Optional[_Iterable[float]] = ..., pose_turn: _Optional[float] = ..., changed_beams: _Optional[int] = ..., withheld: _Optional[_Iterable[str]] = ..., added_delay_s: _Optional[float] = ..., displaced_position: _Optional[_Iterable[float]] = ..., displaced_quaternion: _Optional[_Iterable[float]] = ..., exact_severity: _Optional[float] = ..., evidence_age_s: _Optional[float] = ...) -> None: ...

class Array(_message.Message):
    __slots__ = ("name", "dtype", "shape", "data")
    NAME_FIELD_NUMBER: _ClassVar[int]
    DTYPE_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    name: str
    dtype: str
    shape: _containers.RepeatedScalarFieldContainer[int]
    data: bytes
    def __init__(self, name: _Optional[str] = ..., dtype: _Optional[str] = ..., shape: _Optional[_Iterable[int]] = ..., data: _Optional[bytes] = ...) -> None: ...

class State(_message.Message):
    __slots__ = ("timestamp", "sequence", "arrays")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    ARRAYS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    arrays: _containers.RepeatedCompositeFieldContainer[Array]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., arrays: _Optional[_Iterable[_Union[Array, _Mapping]]] = ...) -> None: ...

class Points(_message.Message):
    __slots__ = ("coordinates",)
    COORDINATES_FIELD_NUMBER: _ClassVar[int]
    coordinates: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, coordinates: _Optional[_Iterable[float]] = ...) -> None: ...

class Profile(_message.Message):
    __slots__ = ("times", "states", "jerks", "duration", "end")
    TIMES_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    JERKS_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    times: _containers.RepeatedScalarFieldContainer[float]
    states: Points
    jerks: _containers.RepeatedScalarFieldContainer[float]
    duration: float
    end: float
    def __init__(self, times: _Optional[_Iterable[float]] = ..., states: _Optional[_Union[Points, _Mapping]] = ..., jerks: _Optional[_Iterable[float]] = ..., duration: _Optional[float] = ..., end: _Optional[float] = ...) -> None: ...

class CommittedTrajectory(_message.Message):
    __slots__ = ("start_ns", "path", "motion", "turning", "overshoot_m")
    START_NS_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    TURNING_FIELD_NUMBER: _ClassVar[int]
    OVERSHOOT_M_FIELD_NUMBER: _ClassVar[int]
    start_ns: int
    path: Points
    motion: Profile
    turning: Profile
    overshoot_m: float
    def __init__(self, start_ns: _Optional[int] = ..., path: _Optional[_Union[Points, _Mapping]] = ..., motion: _Optional[_Union[Profile, _Mapping]] = ..., turning: _Optional[_Union[Profile, _Mapping]] = ..., overshoot_m: _Optional[float] = ...) -> None: ...

class Exploration(_message.Message):
    __slots__ = ("since", "backtracking", "returning")
    SINCE_FIELD_NUMBER: _ClassVar[int]
    BACKTRACKING_FIELD_NUMBER: _ClassVar[int]
    RETURNING_FIELD_NUMBER: _ClassVar[int]
    since: int
    backtracking: bool
    returning: bool
    def __init__(self, since: _Optional[int] = ..., backtracking: _Optional[bool] = ..., returning: _Optional[bool] = ...) -> None: ...

class Route(_message.Message):
    __slots__ = ("path", "improved_ns", "exploration")
    PATH_FIELD_NUMBER: _ClassVar[int]
    IMPROVED_NS_FIELD_NUMBER: _ClassVar[int]
    EXPLORATION_FIELD_NUMBER: _ClassVar[int]
    path: Points
    improved_ns: int
    exploration: Exploration
    def __init__(self, path: _Optional[_Union[Points, _Mapping]] = ..., improved_ns: _Optional[int] = ..., exploration: _Optional[_Union[Exploration, _Mapping]] = ...) -> None: ...

class PathLoss(_message.Message):
    __slots__ = ("sequence", "under_way", "label")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UNDER_WAY_FIELD_NUMBER: _ClassVar[int]
    LABEL_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    under_way: str
    label: str
    def __init__(self, sequence: _Optional[int] = ..., under_way: _Optional[str] = ..., label: _Optional[str] = ...) -> None: ...

class Tries(_message.Message):
    __slots__ = ("viewpoints", "backtracks", "returns")
    VIEWPOINTS_FIELD_NUMBER: _ClassVar[int]
    BACKTRACKS_FIELD_NUMBER: _ClassVar[int]
    RETURNS_FIELD_NUMBER: _ClassVar[int]
    viewpoints: Points
    backtracks: int
    returns: int
    def __init__(self, viewpoints: _Optional[_Union[Points, _Mapping]] = ..., backtracks: _Optional[int] = ..., returns: _Optional[int] = ...) -> None: ...

class Trails(_message.Message):
    __slots__ = ("breadcrumbs", "unheld")
    BREADCRUMBS_FIELD_NUMBER: _ClassVar[int]
    UNHELD_FIELD_NUMBER: _ClassVar[int]
    breadcrumbs: Points
    unheld: Points
    def __init__(self, breadcrumbs: _Optional[_Union[Points, _Mapping]] = ..., unheld: _Optional[_Union[Points, _Mapping]] = ...) -> None: ...

class ClosedGap(_message.Message):
    __slots__ = ("place", "tries")
    PLACE_FIELD_NUMBER: _ClassVar[int]
    TRIES_FIELD_NUMBER: _ClassVar[int]
    place: _containers.RepeatedScalarFieldContainer[float]
    tries: int
    def __init__(self, place: _Optional[_Iterable[float]] = ..., tries: _Optional[int] = ...) -> None: ...

class LostWay(_message.Message):
    __slots__ = ("place", "length_m", "time_ns")
    PLACE_FIELD_NUMBER: _ClassVar[int]
    LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    place: _containers.RepeatedScalarFieldContainer[float]
    length_m: float
    time_ns: int
    def __init__(self, place: _Optional[_Iterable[float]] = ..., length_m: _Optional[float] = ..., time_ns: _Optional[int] = ...) -> None: ...

class Narrows(_message.Message):
    __slots__ = ("oriented", "closed", "lost")
    ORIENTED_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    oriented: bool
    closed: _containers.RepeatedCompositeFieldContainer[ClosedGap]
    lost: LostWay
    def __init__(self, oriented: _Optional[bool] = ..., closed: _Optional[_Iterable[_Union[ClosedGap, _Mapping]]] = ..., lost: _Optional[_Union[LostWay, _Mapping]] = ...) -> None: ...

class PlannerState(_message.Message):
    __slots__ = ("committed", "route", "path_loss", "rest_since_ns", "tries", "trails", "narrows")
    COMMITTED_FIELD_NUMBER: _ClassVar[int]
    ROUTE_FIELD_NUMBER: _ClassVar[int]
    PATH_LOSS_FIELD_NUMBER: _ClassVar[int]
    REST_SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    TRIES_FIELD_NUMBER: _ClassVar[int]
    TRAILS_FIELD_NUMBER: _ClassVar[int]
    NARROWS_FIELD_NUMBER: _ClassVar[int]
    committed: _containers.RepeatedCompositeFieldContainer[CommittedTrajectory]
    route: Route
    path_loss: PathLoss
    rest_since_ns: int
    tries: Tries
    trails: Trails
    narrows: Narrows
    def __init__(self, committed: _Optional[_Iterable[_Union[CommittedTrajectory, _Mapping]]] = ..., route: _Optional[_Union[Route, _Mapping]] = ..., path_loss: _Optional[_Union[PathLoss, _Mapping]] = ..., rest_since_ns: _Optional[int] = ..., tries: _Optional[_Union[Tries, _Mapping]] = ..., trails: _Optional[_Union[Trails, _Mapping]] = ..., narrows: _Optional[_Union[Narrows, _Mapping]] = ...) -> None: ...

class MapContent(_message.Message):
    __slots__ = ("ticks", "bricks", "records", "window", "filters")
    TICKS_FIELD_NUMBER: _ClassVar[int]
    BRICKS_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    WINDOW_FIELD_NUMBER: _ClassVar[int]
    FILTERS_FIELD_NUMBER: _ClassVar[int]
    ticks: int
    bricks: int
    records: bytes
    window: _containers.RepeatedScalarFieldContainer[int]
    filters: _containers.RepeatedCompositeFieldContainer[FilterContent]
    def __init__(self, ticks: _Optional[int] = ..., bricks: _Optional[int] = ..., records: _Optional[bytes] = ..., window: _Optional[_Iterable[int]] = ..., filters: _Optional[_Iterable[_Union[FilterContent, _Mapping]]] = ...) -> None: ...

class FilterContent(_message.Message):
    __slots__ = ("name", "content")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    name: str
    content: bytes
    def __init__(self, name: _Optional[str] = ..., content: _Optional[bytes] = ...) -> None: ...

class Keyframe(_message.Message):
    __slots__ = ("timestamp", "sequence", "chain", "state", "map")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    CHAIN_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    sequence: int
    chain: str
    state: PlannerState
    map: MapContent
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., chain: _Optional[str] = ..., state: _Optional[_Union[PlannerState, _Mapping]] = ..., map: _Optional[_Union[MapContent, _Mapping]] = ...) -> None: ...
