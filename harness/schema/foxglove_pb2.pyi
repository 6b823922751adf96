import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Vector2(_message.Message):
    __slots__ = ("x", "y")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ...) -> None: ...

class Vector3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Point3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Quaternion(_message.Message):
    __slots__ = ("x", "y", "z", "w")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    W_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    w: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ..., w: _Optional[float] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("position", "orientation")
    POSITION_FIELD_NUMBER: _ClassVar[int]
    ORIENTATION_FIELD_NUMBER: _ClassVar[int]
    position: Vector3
    orientation: Quaternion
    def __init__(self, position: _Optional[_Union[Vector3, _Mapping]] = ..., orientation: _Optional[_Union[Quaternion, _Mapping]] = ...) -> None: ...

class Color(_message.Message):
    __slots__ = ("r", "g", "b", "a")
    R_FIELD_NUMBER: _ClassVar[int]
    G_FIELD_NUMBER: _ClassVar[int]
    B_FIELD_NUMBER: _ClassVar[int]
    A_FIELD_NUMBER: _ClassVar[int]
    r: float
    g: float
    b: float
    a: float
    def __init__(self, r: _Optional[float] = ..., g: _Optional[float] = ..., b: _Optional[float] = ..., a: _Optional[float] = ...) -> None: ...

class FrameTransform(_message.Message):
    __slots__ = ("timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    PARENT_FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    CHILD_FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    TRANSLATION_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., parent_frame_id: _Optional[str] = ..., child_frame_id: _Optional[str] = ..., translation: _Optional[_Union[Vector3, _Mapping]] = ..., rotation: _Optional[_Union[Quaternion, _Mapping]] = ...) -> None: ...

class FrameTransforms(_message.Message):
    __slots__ = ("transforms",)
    TRANSFORMS_FIELD_NUMBER: _ClassVar[int]
    transforms: _containers.RepeatedCompositeFieldContainer[FrameTransform]
    def __init__(self, transforms: _Optional[_Iterable[_Union[FrameTransform, _Mapping]]] = ...) -> None: ...

class PackedElementField(_message.Message):
    __slots__ = ("name", "offset", "type")
    class NumericType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        UNKNOWN: _ClassVar[PackedElementField.NumericType]
        UINT8: _ClassVar[PackedElementField.NumericType]
        INT8: _ClassVar[PackedElementField.NumericType]
        UINT16: _ClassVar[PackedElementField.NumericType]
        INT16: _ClassVar[PackedElementField.NumericType]
        UINT32: _ClassVar[PackedElementField.NumericType]
        INT32: _ClassVar[PackedElementField.NumericType]
        FLOAT32: _ClassVar[PackedElementField.NumericType]
        FLOAT64: _ClassVar[PackedElementField.NumericType]
    UNKNOWN: PackedElementField.NumericType
    UINT8: PackedElementField.NumericType
    INT8: PackedElementField.NumericType
    UINT16: PackedElementField.NumericType
    INT16: PackedElementField.NumericType
    UINT32: PackedElementField.NumericType
    INT32: PackedElementField.NumericType
    FLOAT32: PackedElementField.NumericType
    FLOAT64: PackedElementField.NumericType
    NAME_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    name: str
    offset: int
    type: PackedElementField.NumericType
    def __init__(self, name: _Optional[str] = ..., offset: _Optional[int] = ..., type: _Optional[_Union[PackedElementField.NumericType, str]] = ...) -> None: ...

class PointCloud(_message.Message):
    __slots__ = ("timestamp", "frame_id", "pose", "point_stride", "fields", "data")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    POINT_STRIDE_FIELD_NUMBER: _ClassVar[int]
    FIELDS_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    pose: Pose
    point_stride: int
    fields: _containers.RepeatedCompositeFieldContainer[PackedElementField]
    data: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ..., point_stride: _Optional[int] = ..., fields: _Optional[_Iterable[_Union[PackedElementField, _Mapping]]] = ..., data: _Optional[bytes] = ...) -> None: ...

class Grid(_message.Message):
    __slots__ = ("timestamp", "frame_id", "pose", "column_count", "cell_size", "row_stride", "cell_stride", "fields", "data")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    COLUMN_COUNT_FIELD_NUMBER: _ClassVar[int]
    CELL_SIZE_FIELD_NUMBER: _ClassVar[int]
    ROW_STRIDE_FIELD_NUMBER: _ClassVar[int]
    CELL_STRIDE_FIELD_NUMBER: _ClassVar[int]
    FIELDS_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    pose: Pose
    column_count: int
    cell_size: Vector2
    row_stride: int
    cell_stride: int
    fields: _containers.RepeatedCompositeFieldContainer[PackedElementField]
    data: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ..., column_count: _Optional[int] = ..., cell_size: _Optional[_Union[Vector2, _Mapping]] = ..., row_stride: _Optional[int] = ..., cell_stride: _Optional[int] = ..., fields: _Optional[_Iterable[_Union[PackedElementField, _Mapping]]] = ..., data: _Optional[bytes] = ...) -> None: ...

class SpherePrimitive(_message.Message):
    __slots__ = ("pose", "size", "color")
    POSE_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    COLOR_FIELD_NUMBER: _ClassVar[int]
    pose: Pose
    size: Vector3
    color: Color
    def __init__(self, pose: _Optional[_Union[Pose, _Mapping]] = ..., size: _Optional[_Union[Vector3, _Mapping]] = ..., color: _Optional[_Union[Color, _Mapping]] = ...) -> None: ...

class LinePrimitive(_message.Message):
    __slots__ = ("type", "pose", "thickness", "scale_invariant", "points", "color")
    class Type(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        LINE_STRIP: _ClassVar[LinePrimitive.Type]
        LINE_LOOP: _ClassVar[LinePrimitive.Type]
        LINE_LIST: _ClassVar[LinePrimitive.Type]
    LINE_STRIP: LinePrimitive.Type
    LINE_LOOP: LinePrimitive.Type
    LINE_LIST: LinePrimitive.Type
    TYPE_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    THICKNESS_FIELD_NUMBER: _ClassVar[int]
    SCALE_INVARIANT_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    COLOR_FIELD_NUMBER: _ClassVar[int]
    type: LinePrimitive.Type
    pose: Pose
    thickness: float
    scale_invariant: bool
    points: _containers.RepeatedCompositeFieldContainer[Point3]
    color: Color
    def __init__(self, type: _Optional[_Union[LinePrimitive.Type, str]] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ..., thickness: _Optional[float] = ..., scale_invariant: _Optional[bool] = ..., points: _Optional[_Iterable[_Union[Point3, _Mapping]]] = ..., color: _Optional[_Union[Color, _Mapping]] = ...) -> None: ...

class TriangleListPrimitive(_message.Message):
    __slots__ = ("pose", "points", "color")
    POSE_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    COLOR_FIELD_NUMBER: _ClassVar[int]
    pose: Pose
    points: _containers.RepeatedCompositeFieldContainer[Point3]
    color: Color
    def __init__(self, pose: _Optional[_Union[Pose, _Mapping]] = ..., points: _Optional[_Iterable[_Union[Point3, _Mapping]]] = ..., color: _Optional[_Union[Color, _Mapping]] = ...) -> None: ...

class TextPrimitive(_message.Message):
    __slots__ = ("pose", "billboard", "font_size", "scale_invariant", "color", "text")
    POSE_FIELD_NUMBER: _ClassVar[int]
    BILLBOARD_FIELD_NUMBER: _ClassVar[int]
    FONT_SIZE_FIELD_NUMBER: _ClassVar[int]
    SCALE_INVARIANT_FIELD_NUMBER: _ClassVar[int]
    COLOR_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    pose: Pose
    billboard: bool
    font_size: float
    scale_invariant: bool
    color: Color
    text: str
    def __init__(self, pose: _Optional[_Union[Pose, _Mapping]] = ..., billboard: _Optional[bool] = ..., font_size: _Optional[float] = ..., scale_invariant: _Optional[bool] = ..., color: _Optional[_Union[Color, _Mapping]] = ..., text: _Optional[str] = ...) -> None: ...

class SceneEntity(_message.Message):
    __slots__ = ("timestamp", "frame_id", "id", "spheres", "lines", "triangles", "texts")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    SPHERES_FIELD_NUMBER: _ClassVar[int]
    LINES_FIELD_NUMBER: _ClassVar[int]
    TRIANGLES_FIELD_NUMBER: _ClassVar[int]
    TEXTS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    id: str
    spheres: _containers.RepeatedCompositeFieldContainer[SpherePrimitive]
    lines: _containers.RepeatedCompositeFieldContainer[LinePrimitive]
    triangles: _containers.RepeatedCompositeFieldContainer[TriangleListPrimitive]
    texts: _containers.RepeatedCompositeFieldContainer[TextPrimitive]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., id: _Optional[str] = ..., spheres: _Optional[_Iterable[_Union[SpherePrimitive, _Mapping]]] = ..., lines: _Optional[_Iterable[_Union[LinePrimitive, _Mapping]]] = ..., triangles: _Optional[_Iterable[_Union[TriangleListPrimitive, _Mapping]]] = ..., texts: _Optional[_Iterable[_Union[TextPrimitive, _Mapping]]] = ...) -> None: ...

class SceneUpdate(_message.Message):
    __slots__ = ("entities",)
    ENTITIES_FIELD_NUMBER: _ClassVar[int]
    entities: _containers.RepeatedCompositeFieldContainer[SceneEntity]
    def __init__(self, entities: _Optional[_Iterable[_Union[SceneEntity, _Mapping]]] = ...) -> None: ...

class Log(_message.Message):
    __slots__ = ("timestamp", "level", "message", "name")
    class Level(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        UNKNOWN: _ClassVar[Log.Level]
        DEBUG: _ClassVar[Log.Level]
        INFO: _ClassVar[Log.Level]
        WARNING: _ClassVar[Log.Level]
        ERROR: _ClassVar[Log.Level]
        FATAL: _ClassVar[Log.Level]
    UNKNOWN: Log.Level
    DEBUG: Log.Level
    INFO: Log.Level
    WARNING: Log.Level
    ERROR: Log.Level
    FATAL: Log.Level
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    level: Log.Level
    message: str
    name: str
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., level: _Optional[_Union[Log.Level, str]] = ..., message: _Optional[str] = ..., name: _Optional[str] = ...) -> None: ...
