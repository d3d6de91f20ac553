from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Gait(_message.Message):
    __slots__ = ("frequency_hz", "phase_rad", "amplitude")
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    PHASE_RAD_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_FIELD_NUMBER: _ClassVar[int]
    frequency_hz: _containers.RepeatedScalarFieldContainer[float]
    phase_rad: _containers.RepeatedScalarFieldContainer[float]
    amplitude: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, frequency_hz: _Optional[_Iterable[float]] = ..., phase_rad: _Optional[_Iterable[float]] = ..., amplitude: _Optional[_Iterable[float]] = ...) -> None: ...

class Estimate(_message.Message):
    __slots__ = ("mean_m_s", "low_m_s", "high_m_s")
    MEAN_M_S_FIELD_NUMBER: _ClassVar[int]
    LOW_M_S_FIELD_NUMBER: _ClassVar[int]
    HIGH_M_S_FIELD_NUMBER: _ClassVar[int]
    mean_m_s: float
    low_m_s: float
    high_m_s: float
    def __init__(self, mean_m_s: _Optional[float] = ..., low_m_s: _Optional[float] = ..., high_m_s: _Optional[float] = ...) -> None: ...

class Edge(_message.Message):
    __slots__ = ("first", "second")
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    first: int
    second: int
    def __init__(self, first: _Optional[int] = ..., second: _Optional[int] = ...) -> None: ...

class Terrain(_message.Message):
    __slots__ = ("x_m", "y_m", "height_m")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    x_m: _containers.RepeatedScalarFieldContainer[float]
    y_m: _containers.RepeatedScalarFieldContainer[float]
    height_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, x_m: _Optional[_Iterable[float]] = ..., y_m: _Optional[_Iterable[float]] = ..., height_m: _Optional[_Iterable[float]] = ...) -> None: ...

class Structure(_message.Message):
    __slots__ = ("struts", "springs", "motor_struts", "terrain")
    STRUTS_FIELD_NUMBER: _ClassVar[int]
    SPRINGS_FIELD_NUMBER: _ClassVar[int]
    MOTOR_STRUTS_FIELD_NUMBER: _ClassVar[int]
    TERRAIN_FIELD_NUMBER: _ClassVar[int]
    struts: _containers.RepeatedCompositeFieldContainer[Edge]
    springs: _containers.RepeatedCompositeFieldContainer[Edge]
    motor_struts: _containers.RepeatedScalarFieldContainer[int]
    terrain: Terrain
    def __init__(self, struts: _Optional[_Iterable[_Union[Edge, _Mapping]]] = ..., springs: _Optional[_Iterable[_Union[Edge, _Mapping]]] = ..., motor_struts: _Optional[_Iterable[int]] = ..., terrain: _Optional[_Union[Terrain, _Mapping]] = ...) -> None: ...

class Source(_message.Message):
    __slots__ = ("name", "gaits", "scores_m_s")
    NAME_FIELD_NUMBER: _ClassVar[int]
    GAITS_FIELD_NUMBER: _ClassVar[int]
    SCORES_M_S_FIELD_NUMBER: _ClassVar[int]
    name: str
    gaits: _containers.RepeatedCompositeFieldContainer[Gait]
    scores_m_s: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, name: _Optional[str] = ..., gaits: _Optional[_Iterable[_Union[Gait, _Mapping]]] = ..., scores_m_s: _Optional[_Iterable[float]] = ...) -> None: ...

class Run(_message.Message):
    __slots__ = ("format", "structure", "sources", "about")
    class AboutEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    STRUCTURE_FIELD_NUMBER: _ClassVar[int]
    SOURCES_FIELD_NUMBER: _ClassVar[int]
    ABOUT_FIELD_NUMBER: _ClassVar[int]
    format: int
    structure: Structure
    sources: _containers.RepeatedCompositeFieldContainer[Source]
    about: _containers.ScalarMap[str, str]
    def __init__(self, format: _Optional[int] = ..., structure: _Optional[_Union[Structure, _Mapping]] = ..., sources: _Optional[_Iterable[_Union[Source, _Mapping]]] = ..., about: _Optional[_Mapping[str, str]] = ...) -> None: ...

class Suggestion(_message.Message):
    __slots__ = ("gait", "origin", "expected", "hyperparameters", "phase")
    class HyperparametersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    GAIT_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    HYPERPARAMETERS_FIELD_NUMBER: _ClassVar[int]
    PHASE_FIELD_NUMBER: _ClassVar[int]
    gait: Gait
    origin: str
    expected: Estimate
    hyperparameters: _containers.ScalarMap[str, float]
    phase: str
    def __init__(self, gait: _Optional[_Union[Gait, _Mapping]] = ..., origin: _Optional[str] = ..., expected: _Optional[_Union[Estimate, _Mapping]] = ..., hyperparameters: _Optional[_Mapping[str, float]] = ..., phase: _Optional[str] = ...) -> None: ...

class Forces(_message.Message):
    __slots__ = ("tensions_n", "motors_n", "contacts_m", "contacts_n")
    TENSIONS_N_FIELD_NUMBER: _ClassVar[int]
    MOTORS_N_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_M_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_N_FIELD_NUMBER: _ClassVar[int]
    tensions_n: _containers.RepeatedScalarFieldContainer[float]
    motors_n: _containers.RepeatedScalarFieldContainer[float]
    contacts_m: _containers.RepeatedScalarFieldContainer[float]
    contacts_n: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, tensions_n: _Optional[_Iterable[float]] = ..., motors_n: _Optional[_Iterable[float]] = ..., contacts_m: _Optional[_Iterable[float]] = ..., contacts_n: _Optional[_Iterable[float]] = ...) -> None: ...

class Tracking(_message.Message):
    __slots__ = ("t_s", "x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad", "markers_m", "forces", "uncertainty_m")
    T_S_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_RAD_FIELD_NUMBER: _ClassVar[int]
    ROLL_RAD_FIELD_NUMBER: _ClassVar[int]
    MARKERS_M_FIELD_NUMBER: _ClassVar[int]
    FORCES_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_M_FIELD_NUMBER: _ClassVar[int]
    t_s: float
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float
    roll_rad: float
    markers_m: _containers.RepeatedScalarFieldContainer[float]
    forces: Forces
    uncertainty_m: float
    def __init__(self, t_s: _Optional[float] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., yaw_rad: _Optional[float] = ..., pitch_rad: _Optional[float] = ..., roll_rad: _Optional[float] = ..., markers_m: _Optional[_Iterable[float]] = ..., forces: _Optional[_Union[Forces, _Mapping]] = ..., uncertainty_m: _Optional[float] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("t_s", "gait", "hold_s")
    T_S_FIELD_NUMBER: _ClassVar[int]
    GAIT_FIELD_NUMBER: _ClassVar[int]
    HOLD_S_FIELD_NUMBER: _ClassVar[int]
    t_s: float
    gait: Gait
    hold_s: float
    def __init__(self, t_s: _Optional[float] = ..., gait: _Optional[_Union[Gait, _Mapping]] = ..., hold_s: _Optional[float] = ...) -> None: ...

class MotorState(_message.Message):
    __slots__ = ("t_s", "frequency_hz", "measured", "current_a", "temperature_c")
    T_S_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    MEASURED_FIELD_NUMBER: _ClassVar[int]
    CURRENT_A_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    t_s: float
    frequency_hz: _containers.RepeatedScalarFieldContainer[float]
    measured: bool
    current_a: _containers.RepeatedScalarFieldContainer[float]
    temperature_c: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_s: _Optional[float] = ..., frequency_hz: _Optional[_Iterable[float]] = ..., measured: bool = ..., current_a: _Optional[_Iterable[float]] = ..., temperature_c: _Optional[_Iterable[float]] = ...) -> None: ...

class Recommendation(_message.Message):
    __slots__ = ("gait", "estimate")
    GAIT_FIELD_NUMBER: _ClassVar[int]
    ESTIMATE_FIELD_NUMBER: _ClassVar[int]
    gait: Gait
    estimate: Estimate
    def __init__(self, gait: _Optional[_Union[Gait, _Mapping]] = ..., estimate: _Optional[_Union[Estimate, _Mapping]] = ...) -> None: ...

class RestingPose(_message.Message):
    __slots__ = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad", "position_sd_m", "yaw_sd_rad", "face")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_RAD_FIELD_NUMBER: _ClassVar[int]
    ROLL_RAD_FIELD_NUMBER: _ClassVar[int]
    POSITION_SD_M_FIELD_NUMBER: _ClassVar[int]
    YAW_SD_RAD_FIELD_NUMBER: _ClassVar[int]
    FACE_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float
    roll_rad: float
    position_sd_m: float
    yaw_sd_rad: float
    face: int
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., yaw_rad: _Optional[float] = ..., pitch_rad: _Optional[float] = ..., roll_rad: _Optional[float] = ..., position_sd_m: _Optional[float] = ..., yaw_sd_rad: _Optional[float] = ..., face: _Optional[int] = ...) -> None: ...

class Displacement(_message.Message):
    __slots__ = ("forward_m", "left_m", "turn_rad")
    FORWARD_M_FIELD_NUMBER: _ClassVar[int]
    LEFT_M_FIELD_NUMBER: _ClassVar[int]
    TURN_RAD_FIELD_NUMBER: _ClassVar[int]
    forward_m: float
    left_m: float
    turn_rad: float
    def __init__(self, forward_m: _Optional[float] = ..., left_m: _Optional[float] = ..., turn_rad: _Optional[float] = ...) -> None: ...

class Movement(_message.Message):
    __slots__ = ("start", "end", "displacement")
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    DISPLACEMENT_FIELD_NUMBER: _ClassVar[int]
    start: RestingPose
    end: RestingPose
    displacement: Displacement
    def __init__(self, start: _Optional[_Union[RestingPose, _Mapping]] = ..., end: _Optional[_Union[RestingPose, _Mapping]] = ..., displacement: _Optional[_Union[Displacement, _Mapping]] = ...) -> None: ...

class Piece(_message.Message):
    __slots__ = ("duration_s", "x_m", "y_m", "cos_yaw", "sin_yaw")
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    COS_YAW_FIELD_NUMBER: _ClassVar[int]
    SIN_YAW_FIELD_NUMBER: _ClassVar[int]
    duration_s: float
    x_m: float
    y_m: float
    cos_yaw: float
    sin_yaw: float
    def __init__(self, duration_s: _Optional[float] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., cos_yaw: _Optional[float] = ..., sin_yaw: _Optional[float] = ...) -> None: ...

class AppliedFrequencies(_message.Message):
    __slots__ = ("mean_hz", "measured")
    MEAN_HZ_FIELD_NUMBER: _ClassVar[int]
    MEASURED_FIELD_NUMBER: _ClassVar[int]
    mean_hz: _containers.RepeatedScalarFieldContainer[float]
    measured: bool
    def __init__(self, mean_hz: _Optional[_Iterable[float]] = ..., measured: bool = ...) -> None: ...

class Conditions(_message.Message):
    __slots__ = ("session_s", "battery_v", "battery_changed", "dropped_poses", "tracker_offset_s", "tracker_jitter_s")
    SESSION_S_FIELD_NUMBER: _ClassVar[int]
    BATTERY_V_FIELD_NUMBER: _ClassVar[int]
    BATTERY_CHANGED_FIELD_NUMBER: _ClassVar[int]
    DROPPED_POSES_FIELD_NUMBER: _ClassVar[int]
    TRACKER_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    TRACKER_JITTER_S_FIELD_NUMBER: _ClassVar[int]
    session_s: float
    battery_v: float
    battery_changed: bool
    dropped_poses: int
    tracker_offset_s: float
    tracker_jitter_s: float
    def __init__(self, session_s: _Optional[float] = ..., battery_v: _Optional[float] = ..., battery_changed: bool = ..., dropped_poses: _Optional[int] = ..., tracker_offset_s: _Optional[float] = ..., tracker_jitter_s: _Optional[float] = ...) -> None: ...

class Review(_message.Message):
    __slots__ = ("notes", "verdict", "verdict_reason", "is_suspect", "suspicion")
    NOTES_FIELD_NUMBER: _ClassVar[int]
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    VERDICT_REASON_FIELD_NUMBER: _ClassVar[int]
    IS_SUSPECT_FIELD_NUMBER: _ClassVar[int]
    SUSPICION_FIELD_NUMBER: _ClassVar[int]
    notes: str
    verdict: str
    verdict_reason: str
    is_suspect: bool
    suspicion: str
    def __init__(self, notes: _Optional[str] = ..., verdict: _Optional[str] = ..., verdict_reason: _Optional[str] = ..., is_suspect: bool = ..., suspicion: _Optional[str] = ...) -> None: ...

class Fit(_message.Message):
    __slots__ = ("hyperparameters", "is_new")
    class HyperparametersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    HYPERPARAMETERS_FIELD_NUMBER: _ClassVar[int]
    IS_NEW_FIELD_NUMBER: _ClassVar[int]
    hyperparameters: _containers.ScalarMap[str, float]
    is_new: bool
    def __init__(self, hyperparameters: _Optional[_Mapping[str, float]] = ..., is_new: bool = ...) -> None: ...

class SteeringStep(_message.Message):
    __slots__ = ("goal_x_m", "goal_y_m", "goal_yaw_rad", "predicted", "position_sd_m", "turn_sd_rad", "plan")
    GOAL_X_M_FIELD_NUMBER: _ClassVar[int]
    GOAL_Y_M_FIELD_NUMBER: _ClassVar[int]
    GOAL_YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    PREDICTED_FIELD_NUMBER: _ClassVar[int]
    POSITION_SD_M_FIELD_NUMBER: _ClassVar[int]
    TURN_SD_RAD_FIELD_NUMBER: _ClassVar[int]
    PLAN_FIELD_NUMBER: _ClassVar[int]
    goal_x_m: float
    goal_y_m: float
    goal_yaw_rad: float
    predicted: Displacement
    position_sd_m: float
    turn_sd_rad: float
    plan: _containers.RepeatedCompositeFieldContainer[Gait]
    def __init__(self, goal_x_m: _Optional[float] = ..., goal_y_m: _Optional[float] = ..., goal_yaw_rad: _Optional[float] = ..., predicted: _Optional[_Union[Displacement, _Mapping]] = ..., position_sd_m: _Optional[float] = ..., turn_sd_rad: _Optional[float] = ..., plan: _Optional[_Iterable[_Union[Gait, _Mapping]]] = ...) -> None: ...

class Trial(_message.Message):
    __slots__ = ("number", "gait", "outcome", "reason", "started_unix_s", "duration_s", "score_m_s", "recommendation", "movement", "applied", "conditions", "review", "fit", "steering", "start", "end", "pieces")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    GAIT_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    STARTED_UNIX_S_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    SCORE_M_S_FIELD_NUMBER: _ClassVar[int]
    RECOMMENDATION_FIELD_NUMBER: _ClassVar[int]
    MOVEMENT_FIELD_NUMBER: _ClassVar[int]
    APPLIED_FIELD_NUMBER: _ClassVar[int]
    CONDITIONS_FIELD_NUMBER: _ClassVar[int]
    REVIEW_FIELD_NUMBER: _ClassVar[int]
    FIT_FIELD_NUMBER: _ClassVar[int]
    STEERING_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    PIECES_FIELD_NUMBER: _ClassVar[int]
    number: int
    gait: Gait
    outcome: str
    reason: str
    started_unix_s: float
    duration_s: float
    score_m_s: float
    recommendation: Recommendation
    movement: Movement
    applied: AppliedFrequencies
    conditions: Conditions
    review: Review
    fit: Fit
    steering: SteeringStep
    start: RestingPose
    end: RestingPose
    pieces: _containers.RepeatedCompositeFieldContainer[Piece]
    def __init__(self, number: _Optional[int] = ..., gait: _Optional[_Union[Gait, _Mapping]] = ..., outcome: _Optional[str] = ..., reason: _Optional[str] = ..., started_unix_s: _Optional[float] = ..., duration_s: _Optional[float] = ..., score_m_s: _Optional[float] = ..., recommendation: _Optional[_Union[Recommendation, _Mapping]] = ..., movement: _Optional[_Union[Movement, _Mapping]] = ..., applied: _Optional[_Union[AppliedFrequencies, _Mapping]] = ..., conditions: _Optional[_Union[Conditions, _Mapping]] = ..., review: _Optional[_Union[Review, _Mapping]] = ..., fit: _Optional[_Union[Fit, _Mapping]] = ..., steering: _Optional[_Union[SteeringStep, _Mapping]] = ..., start: _Optional[_Union[RestingPose, _Mapping]] = ..., end: _Optional[_Union[RestingPose, _Mapping]] = ..., pieces: _Optional[_Iterable[_Union[Piece, _Mapping]]] = ...) -> None: ...
