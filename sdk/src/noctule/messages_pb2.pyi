import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ReadingStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    READING_STATUS_UNSPECIFIED: _ClassVar[ReadingStatus]
    READING_STATUS_ECHO: _ClassVar[ReadingStatus]
    READING_STATUS_NO_ECHO: _ClassVar[ReadingStatus]
    READING_STATUS_TOO_EARLY: _ClassVar[ReadingStatus]
    READING_STATUS_STUCK_HIGH: _ClassVar[ReadingStatus]
    READING_STATUS_NO_SENSOR: _ClassVar[ReadingStatus]

class FaultKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FAULT_KIND_UNSPECIFIED: _ClassVar[FaultKind]
    FAULT_KIND_NO_ECHO_ANYWHERE: _ClassVar[FaultKind]
    FAULT_KIND_SILENT: _ClassVar[FaultKind]
    FAULT_KIND_NO_SENSOR: _ClassVar[FaultKind]
    FAULT_KIND_STUCK_HIGH: _ClassVar[FaultKind]
    FAULT_KIND_TOO_EARLY: _ClassVar[FaultKind]
    FAULT_KIND_REPEATS: _ClassVar[FaultKind]
    FAULT_KIND_BLOCKED: _ClassVar[FaultKind]
    FAULT_KIND_MOTOR_STUCK: _ClassVar[FaultKind]
    FAULT_KIND_SLIPPED: _ClassVar[FaultKind]
    FAULT_KIND_PLAY: _ClassVar[FaultKind]
    FAULT_KIND_TURNED: _ClassVar[FaultKind]
    FAULT_KIND_MOVED: _ClassVar[FaultKind]
    FAULT_KIND_RANGES_JUMPED: _ClassVar[FaultKind]
    FAULT_KIND_TOO_NOISY: _ClassVar[FaultKind]
    FAULT_KIND_CLOCK_SLIPS: _ClassVar[FaultKind]
    FAULT_KIND_ARC_SILENT: _ClassVar[FaultKind]
    FAULT_KIND_BEARING_SILENT: _ClassVar[FaultKind]

class PoseState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    POSE_STATE_UNSPECIFIED: _ClassVar[PoseState]
    POSE_STATE_FITTED: _ClassVar[PoseState]
    POSE_STATE_OPEN: _ClassVar[PoseState]
    POSE_STATE_WRONG: _ClassVar[PoseState]

class ContactKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CONTACT_KIND_UNSPECIFIED: _ClassVar[ContactKind]
    CONTACT_KIND_WALL: _ClassVar[ContactKind]
    CONTACT_KIND_CYLINDER: _ClassVar[ContactKind]
    CONTACT_KIND_CORNER: _ClassVar[ContactKind]
READING_STATUS_UNSPECIFIED: ReadingStatus
READING_STATUS_ECHO: ReadingStatus
READING_STATUS_NO_ECHO: ReadingStatus
READING_STATUS_TOO_EARLY: ReadingStatus
READING_STATUS_STUCK_HIGH: ReadingStatus
READING_STATUS_NO_SENSOR: ReadingStatus
FAULT_KIND_UNSPECIFIED: FaultKind
FAULT_KIND_NO_ECHO_ANYWHERE: FaultKind
FAULT_KIND_SILENT: FaultKind
FAULT_KIND_NO_SENSOR: FaultKind
FAULT_KIND_STUCK_HIGH: FaultKind
FAULT_KIND_TOO_EARLY: FaultKind
FAULT_KIND_REPEATS: FaultKind
FAULT_KIND_BLOCKED: FaultKind
FAULT_KIND_MOTOR_STUCK: FaultKind
FAULT_KIND_SLIPPED: FaultKind
FAULT_KIND_PLAY: FaultKind
FAULT_KIND_TURNED: FaultKind
FAULT_KIND_MOVED: FaultKind
FAULT_KIND_RANGES_JUMPED: FaultKind
FAULT_KIND_TOO_NOISY: FaultKind
FAULT_KIND_CLOCK_SLIPS: FaultKind
FAULT_KIND_ARC_SILENT: FaultKind
FAULT_KIND_BEARING_SILENT: FaultKind
POSE_STATE_UNSPECIFIED: PoseState
POSE_STATE_FITTED: PoseState
POSE_STATE_OPEN: PoseState
POSE_STATE_WRONG: PoseState
CONTACT_KIND_UNSPECIFIED: ContactKind
CONTACT_KIND_WALL: ContactKind
CONTACT_KIND_CYLINDER: ContactKind
CONTACT_KIND_CORNER: ContactKind

class Pose(_message.Message):
    __slots__ = ("x_m", "y_m", "heading_rad", "sigma_position_m", "sigma_heading_rad", "time")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    SIGMA_POSITION_M_FIELD_NUMBER: _ClassVar[int]
    SIGMA_HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    heading_rad: float
    sigma_position_m: float
    sigma_heading_rad: float
    time: _timestamp_pb2.Timestamp
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., sigma_position_m: _Optional[float] = ..., sigma_heading_rad: _Optional[float] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class Sensor(_message.Message):
    __slots__ = ("beam_width_rad", "range_bias_m", "range_sigma_m", "face_offset_m", "face_offset_sigma_m")
    BEAM_WIDTH_RAD_FIELD_NUMBER: _ClassVar[int]
    RANGE_BIAS_M_FIELD_NUMBER: _ClassVar[int]
    RANGE_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    FACE_OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    FACE_OFFSET_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    beam_width_rad: float
    range_bias_m: float
    range_sigma_m: float
    face_offset_m: float
    face_offset_sigma_m: float
    def __init__(self, beam_width_rad: _Optional[float] = ..., range_bias_m: _Optional[float] = ..., range_sigma_m: _Optional[float] = ..., face_offset_m: _Optional[float] = ..., face_offset_sigma_m: _Optional[float] = ...) -> None: ...

class Reading(_message.Message):
    __slots__ = ("bearing_rad", "time_offset_s", "time_of_flight_s", "status")
    BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    TIME_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    TIME_OF_FLIGHT_S_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    bearing_rad: float
    time_offset_s: float
    time_of_flight_s: float
    status: ReadingStatus
    def __init__(self, bearing_rad: _Optional[float] = ..., time_offset_s: _Optional[float] = ..., time_of_flight_s: _Optional[float] = ..., status: _Optional[_Union[ReadingStatus, str]] = ...) -> None: ...

class Sweep(_message.Message):
    __slots__ = ("site", "unit", "log_id", "log_sequence", "boot", "sequence", "start", "clock_error_s", "pose", "waypoint", "air_temperature_c", "sensor", "readings", "clock_drift", "clock_epoch", "life", "faults", "suspect_before")
    SITE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    LOG_ID_FIELD_NUMBER: _ClassVar[int]
    LOG_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    BOOT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    CLOCK_ERROR_S_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    WAYPOINT_FIELD_NUMBER: _ClassVar[int]
    AIR_TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    READINGS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_DRIFT_FIELD_NUMBER: _ClassVar[int]
    CLOCK_EPOCH_FIELD_NUMBER: _ClassVar[int]
    LIFE_FIELD_NUMBER: _ClassVar[int]
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    SUSPECT_BEFORE_FIELD_NUMBER: _ClassVar[int]
    site: str
    unit: str
    log_id: str
    log_sequence: int
    boot: int
    sequence: int
    start: _timestamp_pb2.Timestamp
    clock_error_s: float
    pose: Pose
    waypoint: int
    air_temperature_c: float
    sensor: Sensor
    readings: _containers.RepeatedCompositeFieldContainer[Reading]
    clock_drift: float
    clock_epoch: str
    life: int
    faults: _containers.RepeatedScalarFieldContainer[FaultKind]
    suspect_before: int
    def __init__(self, site: _Optional[str] = ..., unit: _Optional[str] = ..., log_id: _Optional[str] = ..., log_sequence: _Optional[int] = ..., boot: _Optional[int] = ..., sequence: _Optional[int] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., clock_error_s: _Optional[float] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ..., waypoint: _Optional[int] = ..., air_temperature_c: _Optional[float] = ..., sensor: _Optional[_Union[Sensor, _Mapping]] = ..., readings: _Optional[_Iterable[_Union[Reading, _Mapping]]] = ..., clock_drift: _Optional[float] = ..., clock_epoch: _Optional[str] = ..., life: _Optional[int] = ..., faults: _Optional[_Iterable[_Union[FaultKind, str]]] = ..., suspect_before: _Optional[int] = ...) -> None: ...

class UnitFault(_message.Message):
    __slots__ = ("kind", "since", "confidence", "words", "advice")
    KIND_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    CONFIDENCE_FIELD_NUMBER: _ClassVar[int]
    WORDS_FIELD_NUMBER: _ClassVar[int]
    ADVICE_FIELD_NUMBER: _ClassVar[int]
    kind: FaultKind
    since: _timestamp_pb2.Timestamp
    confidence: float
    words: str
    advice: str
    def __init__(self, kind: _Optional[_Union[FaultKind, str]] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., confidence: _Optional[float] = ..., words: _Optional[str] = ..., advice: _Optional[str] = ...) -> None: ...

class UnitStatus(_message.Message):
    __slots__ = ("site", "unit", "time", "state", "detail", "serial", "firmware", "boot", "waypoint", "homed", "clock_error_s", "clock_drift", "log_id", "log_head", "log_tail", "log_removed", "counters", "gateway", "reset_cause", "chip_temperature_c", "log_damaged", "gateway_version", "since", "last_sweep", "faults", "slip_rad")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_UNSPECIFIED: _ClassVar[UnitStatus.State]
        STATE_DISCONNECTED: _ClassVar[UnitStatus.State]
        STATE_IDLE: _ClassVar[UnitStatus.State]
        STATE_SWEEPING: _ClassVar[UnitStatus.State]
        STATE_HOMING: _ClassVar[UnitStatus.State]
        STATE_WAITING: _ClassVar[UnitStatus.State]
        STATE_FAULT: _ClassVar[UnitStatus.State]
        STATE_PAUSED: _ClassVar[UnitStatus.State]
        STATE_TURNING: _ClassVar[UnitStatus.State]
        STATE_LOADER: _ClassVar[UnitStatus.State]
        STATE_MEASURING: _ClassVar[UnitStatus.State]
    STATE_UNSPECIFIED: UnitStatus.State
    STATE_DISCONNECTED: UnitStatus.State
    STATE_IDLE: UnitStatus.State
    STATE_SWEEPING: UnitStatus.State
    STATE_HOMING: UnitStatus.State
    STATE_WAITING: UnitStatus.State
    STATE_FAULT: UnitStatus.State
    STATE_PAUSED: UnitStatus.State
    STATE_TURNING: UnitStatus.State
    STATE_LOADER: UnitStatus.State
    STATE_MEASURING: UnitStatus.State
    class CountersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    SITE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    SERIAL_FIELD_NUMBER: _ClassVar[int]
    FIRMWARE_FIELD_NUMBER: _ClassVar[int]
    BOOT_FIELD_NUMBER: _ClassVar[int]
    WAYPOINT_FIELD_NUMBER: _ClassVar[int]
    HOMED_FIELD_NUMBER: _ClassVar[int]
    CLOCK_ERROR_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_DRIFT_FIELD_NUMBER: _ClassVar[int]
    LOG_ID_FIELD_NUMBER: _ClassVar[int]
    LOG_HEAD_FIELD_NUMBER: _ClassVar[int]
    LOG_TAIL_FIELD_NUMBER: _ClassVar[int]
    LOG_REMOVED_FIELD_NUMBER: _ClassVar[int]
    COUNTERS_FIELD_NUMBER: _ClassVar[int]
    GATEWAY_FIELD_NUMBER: _ClassVar[int]
    RESET_CAUSE_FIELD_NUMBER: _ClassVar[int]
    CHIP_TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    LOG_DAMAGED_FIELD_NUMBER: _ClassVar[int]
    GATEWAY_VERSION_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    LAST_SWEEP_FIELD_NUMBER: _ClassVar[int]
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    SLIP_RAD_FIELD_NUMBER: _ClassVar[int]
    site: str
    unit: str
    time: _timestamp_pb2.Timestamp
    state: UnitStatus.State
    detail: str
    serial: int
    firmware: str
    boot: int
    waypoint: int
    homed: bool
    clock_error_s: float
    clock_drift: float
    log_id: str
    log_head: int
    log_tail: int
    log_removed: int
    counters: _containers.ScalarMap[str, int]
    gateway: str
    reset_cause: str
    chip_temperature_c: float
    log_damaged: int
    gateway_version: str
    since: _timestamp_pb2.Timestamp
    last_sweep: _timestamp_pb2.Timestamp
    faults: _containers.RepeatedCompositeFieldContainer[UnitFault]
    slip_rad: float
    def __init__(self, site: _Optional[str] = ..., unit: _Optional[str] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., state: _Optional[_Union[UnitStatus.State, str]] = ..., detail: _Optional[str] = ..., serial: _Optional[int] = ..., firmware: _Optional[str] = ..., boot: _Optional[int] = ..., waypoint: _Optional[int] = ..., homed: _Optional[bool] = ..., clock_error_s: _Optional[float] = ..., clock_drift: _Optional[float] = ..., log_id: _Optional[str] = ..., log_head: _Optional[int] = ..., log_tail: _Optional[int] = ..., log_removed: _Optional[int] = ..., counters: _Optional[_Mapping[str, int]] = ..., gateway: _Optional[str] = ..., reset_cause: _Optional[str] = ..., chip_temperature_c: _Optional[float] = ..., log_damaged: _Optional[int] = ..., gateway_version: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., last_sweep: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., faults: _Optional[_Iterable[_Union[UnitFault, _Mapping]]] = ..., slip_rad: _Optional[float] = ...) -> None: ...

class LogRecords(_message.Message):
    __slots__ = ("log_id", "head", "tail", "sweeps", "gaps")
    LOG_ID_FIELD_NUMBER: _ClassVar[int]
    HEAD_FIELD_NUMBER: _ClassVar[int]
    TAIL_FIELD_NUMBER: _ClassVar[int]
    SWEEPS_FIELD_NUMBER: _ClassVar[int]
    GAPS_FIELD_NUMBER: _ClassVar[int]
    log_id: str
    head: int
    tail: int
    sweeps: _containers.RepeatedCompositeFieldContainer[Sweep]
    gaps: _containers.RepeatedCompositeFieldContainer[LogGap]
    def __init__(self, log_id: _Optional[str] = ..., head: _Optional[int] = ..., tail: _Optional[int] = ..., sweeps: _Optional[_Iterable[_Union[Sweep, _Mapping]]] = ..., gaps: _Optional[_Iterable[_Union[LogGap, _Mapping]]] = ...) -> None: ...

class LogGap(_message.Message):
    __slots__ = ("first", "last", "damaged", "reason")
    FIRST_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    DAMAGED_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    first: int
    last: int
    damaged: bool
    reason: str
    def __init__(self, first: _Optional[int] = ..., last: _Optional[int] = ..., damaged: _Optional[bool] = ..., reason: _Optional[str] = ...) -> None: ...

class SweepPlan(_message.Message):
    __slots__ = ("first_bearing_rad", "bearing_step_rad", "count", "ping_interval_s", "top_speed_half_steps_s", "ramp_s", "settle_s", "pings")
    FIRST_BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    BEARING_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    PING_INTERVAL_S_FIELD_NUMBER: _ClassVar[int]
    TOP_SPEED_HALF_STEPS_S_FIELD_NUMBER: _ClassVar[int]
    RAMP_S_FIELD_NUMBER: _ClassVar[int]
    SETTLE_S_FIELD_NUMBER: _ClassVar[int]
    PINGS_FIELD_NUMBER: _ClassVar[int]
    first_bearing_rad: float
    bearing_step_rad: float
    count: int
    ping_interval_s: float
    top_speed_half_steps_s: float
    ramp_s: float
    settle_s: float
    pings: int
    def __init__(self, first_bearing_rad: _Optional[float] = ..., bearing_step_rad: _Optional[float] = ..., count: _Optional[int] = ..., ping_interval_s: _Optional[float] = ..., top_speed_half_steps_s: _Optional[float] = ..., ramp_s: _Optional[float] = ..., settle_s: _Optional[float] = ..., pings: _Optional[int] = ...) -> None: ...

class Calibration(_message.Message):
    __slots__ = ("half_steps_per_turn", "backlash_half_steps", "home", "home_bearing_rad")
    class Home(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        HOME_UNSPECIFIED: _ClassVar[Calibration.Home]
        HOME_SWITCH: _ClassVar[Calibration.Home]
        HOME_STOP: _ClassVar[Calibration.Home]
        HOME_OPENING_SWITCH: _ClassVar[Calibration.Home]
    HOME_UNSPECIFIED: Calibration.Home
    HOME_SWITCH: Calibration.Home
    HOME_STOP: Calibration.Home
    HOME_OPENING_SWITCH: Calibration.Home
    HALF_STEPS_PER_TURN_FIELD_NUMBER: _ClassVar[int]
    BACKLASH_HALF_STEPS_FIELD_NUMBER: _ClassVar[int]
    HOME_FIELD_NUMBER: _ClassVar[int]
    HOME_BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    half_steps_per_turn: float
    backlash_half_steps: int
    home: Calibration.Home
    home_bearing_rad: float
    def __init__(self, half_steps_per_turn: _Optional[float] = ..., backlash_half_steps: _Optional[int] = ..., home: _Optional[_Union[Calibration.Home, str]] = ..., home_bearing_rad: _Optional[float] = ...) -> None: ...

class UnitSettings(_message.Message):
    __slots__ = ("plan", "calibration", "temperature_trim_k", "stored")
    PLAN_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_TRIM_K_FIELD_NUMBER: _ClassVar[int]
    STORED_FIELD_NUMBER: _ClassVar[int]
    plan: SweepPlan
    calibration: Calibration
    temperature_trim_k: float
    stored: bool
    def __init__(self, plan: _Optional[_Union[SweepPlan, _Mapping]] = ..., calibration: _Optional[_Union[Calibration, _Mapping]] = ..., temperature_trim_k: _Optional[float] = ..., stored: _Optional[bool] = ...) -> None: ...

class CommandRequest(_message.Message):
    __slots__ = ("request_id", "plan", "pause_s", "waypoint", "bearing_rad", "calibration", "temperature_c", "image", "force")
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    PLAN_FIELD_NUMBER: _ClassVar[int]
    PAUSE_S_FIELD_NUMBER: _ClassVar[int]
    WAYPOINT_FIELD_NUMBER: _ClassVar[int]
    BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    FORCE_FIELD_NUMBER: _ClassVar[int]
    request_id: str
    plan: SweepPlan
    pause_s: float
    waypoint: int
    bearing_rad: float
    calibration: Calibration
    temperature_c: float
    image: bytes
    force: bool
    def __init__(self, request_id: _Optional[str] = ..., plan: _Optional[_Union[SweepPlan, _Mapping]] = ..., pause_s: _Optional[float] = ..., waypoint: _Optional[int] = ..., bearing_rad: _Optional[float] = ..., calibration: _Optional[_Union[Calibration, _Mapping]] = ..., temperature_c: _Optional[float] = ..., image: _Optional[bytes] = ..., force: _Optional[bool] = ...) -> None: ...

class Caller(_message.Message):
    __slots__ = ("session", "certificate", "signature")
    SESSION_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATE_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_FIELD_NUMBER: _ClassVar[int]
    session: str
    certificate: bytes
    signature: bytes
    def __init__(self, session: _Optional[str] = ..., certificate: _Optional[bytes] = ..., signature: _Optional[bytes] = ...) -> None: ...

class Measurement(_message.Message):
    __slots__ = ("name", "value", "verdict", "words", "time")
    class Verdict(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        VERDICT_UNSPECIFIED: _ClassVar[Measurement.Verdict]
        VERDICT_GOOD: _ClassVar[Measurement.Verdict]
        VERDICT_BAD: _ClassVar[Measurement.Verdict]
        VERDICT_UNKNOWN: _ClassVar[Measurement.Verdict]
    VERDICT_UNSPECIFIED: Measurement.Verdict
    VERDICT_GOOD: Measurement.Verdict
    VERDICT_BAD: Measurement.Verdict
    VERDICT_UNKNOWN: Measurement.Verdict
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    WORDS_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: float
    verdict: Measurement.Verdict
    words: str
    time: _timestamp_pb2.Timestamp
    def __init__(self, name: _Optional[str] = ..., value: _Optional[float] = ..., verdict: _Optional[_Union[Measurement.Verdict, str]] = ..., words: _Optional[str] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class CommandReply(_message.Message):
    __slots__ = ("request_id", "done", "error", "status", "settings", "detail", "under_way", "measurements")
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    DONE_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    UNDER_WAY_FIELD_NUMBER: _ClassVar[int]
    MEASUREMENTS_FIELD_NUMBER: _ClassVar[int]
    request_id: str
    done: bool
    error: str
    status: UnitStatus
    settings: UnitSettings
    detail: str
    under_way: bool
    measurements: _containers.RepeatedCompositeFieldContainer[Measurement]
    def __init__(self, request_id: _Optional[str] = ..., done: _Optional[bool] = ..., error: _Optional[str] = ..., status: _Optional[_Union[UnitStatus, _Mapping]] = ..., settings: _Optional[_Union[UnitSettings, _Mapping]] = ..., detail: _Optional[str] = ..., under_way: _Optional[bool] = ..., measurements: _Optional[_Iterable[_Union[Measurement, _Mapping]]] = ...) -> None: ...

class Cursor(_message.Message):
    __slots__ = ("unit", "log_id", "log_sequence", "time")
    UNIT_FIELD_NUMBER: _ClassVar[int]
    LOG_ID_FIELD_NUMBER: _ClassVar[int]
    LOG_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    unit: str
    log_id: str
    log_sequence: int
    time: _timestamp_pb2.Timestamp
    def __init__(self, unit: _Optional[str] = ..., log_id: _Optional[str] = ..., log_sequence: _Optional[int] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class ServiceStatus(_message.Message):
    __slots__ = ("site", "name", "role", "version", "time", "detail", "counters", "cursors", "rerun", "rerun_recording")
    class CountersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    SITE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    ROLE_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    COUNTERS_FIELD_NUMBER: _ClassVar[int]
    CURSORS_FIELD_NUMBER: _ClassVar[int]
    RERUN_FIELD_NUMBER: _ClassVar[int]
    RERUN_RECORDING_FIELD_NUMBER: _ClassVar[int]
    site: str
    name: str
    role: str
    version: str
    time: _timestamp_pb2.Timestamp
    detail: str
    counters: _containers.ScalarMap[str, int]
    cursors: _containers.RepeatedCompositeFieldContainer[Cursor]
    rerun: str
    rerun_recording: str
    def __init__(self, site: _Optional[str] = ..., name: _Optional[str] = ..., role: _Optional[str] = ..., version: _Optional[str] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., detail: _Optional[str] = ..., counters: _Optional[_Mapping[str, int]] = ..., cursors: _Optional[_Iterable[_Union[Cursor, _Mapping]]] = ..., rerun: _Optional[str] = ..., rerun_recording: _Optional[str] = ...) -> None: ...

class Point(_message.Message):
    __slots__ = ("x_m", "y_m")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ...) -> None: ...

class Wall(_message.Message):
    __slots__ = ("theta_rad", "rho_m", "start", "end", "covariance", "readings", "chance")
    THETA_RAD_FIELD_NUMBER: _ClassVar[int]
    RHO_M_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    READINGS_FIELD_NUMBER: _ClassVar[int]
    CHANCE_FIELD_NUMBER: _ClassVar[int]
    theta_rad: float
    rho_m: float
    start: Point
    end: Point
    covariance: _containers.RepeatedScalarFieldContainer[float]
    readings: int
    chance: float
    def __init__(self, theta_rad: _Optional[float] = ..., rho_m: _Optional[float] = ..., start: _Optional[_Union[Point, _Mapping]] = ..., end: _Optional[_Union[Point, _Mapping]] = ..., covariance: _Optional[_Iterable[float]] = ..., readings: _Optional[int] = ..., chance: _Optional[float] = ...) -> None: ...

class Corner(_message.Message):
    __slots__ = ("x_m", "y_m", "covariance", "walls")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    WALLS_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    walls: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., walls: _Optional[_Iterable[int]] = ...) -> None: ...

class Cylinder(_message.Message):
    __slots__ = ("x_m", "y_m", "radius_m", "covariance", "readings")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    READINGS_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    radius_m: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    readings: int
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., radius_m: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., readings: _Optional[int] = ...) -> None: ...

class Touch(_message.Message):
    __slots__ = ("x_m", "y_m", "covariance", "unit", "readings", "direction_rad", "width_rad", "chance_wall", "chance_corner", "chance_cylinder")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    READINGS_FIELD_NUMBER: _ClassVar[int]
    DIRECTION_RAD_FIELD_NUMBER: _ClassVar[int]
    WIDTH_RAD_FIELD_NUMBER: _ClassVar[int]
    CHANCE_WALL_FIELD_NUMBER: _ClassVar[int]
    CHANCE_CORNER_FIELD_NUMBER: _ClassVar[int]
    CHANCE_CYLINDER_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    unit: str
    readings: int
    direction_rad: float
    width_rad: float
    chance_wall: float
    chance_corner: float
    chance_cylinder: float
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., unit: _Optional[str] = ..., readings: _Optional[int] = ..., direction_rad: _Optional[float] = ..., width_rad: _Optional[float] = ..., chance_wall: _Optional[float] = ..., chance_corner: _Optional[float] = ..., chance_cylinder: _Optional[float] = ...) -> None: ...

class UnitPose(_message.Message):
    __slots__ = ("unit", "x_m", "y_m", "heading_rad", "covariance", "stated", "state", "fixes_frame", "detail")
    UNIT_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    STATED_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    FIXES_FRAME_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    unit: str
    x_m: float
    y_m: float
    heading_rad: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    stated: Pose
    state: PoseState
    fixes_frame: bool
    detail: str
    def __init__(self, unit: _Optional[str] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., stated: _Optional[_Union[Pose, _Mapping]] = ..., state: _Optional[_Union[PoseState, str]] = ..., fixes_frame: _Optional[bool] = ..., detail: _Optional[str] = ...) -> None: ...

class Contour(_message.Message):
    __slots__ = ("site", "mapper", "version", "time", "method", "walls", "corners", "cylinders", "sweeps", "poses", "stops", "touches", "note")
    SITE_FIELD_NUMBER: _ClassVar[int]
    MAPPER_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    METHOD_FIELD_NUMBER: _ClassVar[int]
    WALLS_FIELD_NUMBER: _ClassVar[int]
    CORNERS_FIELD_NUMBER: _ClassVar[int]
    CYLINDERS_FIELD_NUMBER: _ClassVar[int]
    SWEEPS_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    STOPS_FIELD_NUMBER: _ClassVar[int]
    TOUCHES_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    site: str
    mapper: str
    version: int
    time: _timestamp_pb2.Timestamp
    method: str
    walls: _containers.RepeatedCompositeFieldContainer[Wall]
    corners: _containers.RepeatedCompositeFieldContainer[Corner]
    cylinders: _containers.RepeatedCompositeFieldContainer[Cylinder]
    sweeps: int
    poses: _containers.RepeatedCompositeFieldContainer[UnitPose]
    stops: _containers.RepeatedCompositeFieldContainer[UnitPose]
    touches: _containers.RepeatedCompositeFieldContainer[Touch]
    note: str
    def __init__(self, site: _Optional[str] = ..., mapper: _Optional[str] = ..., version: _Optional[int] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., method: _Optional[str] = ..., walls: _Optional[_Iterable[_Union[Wall, _Mapping]]] = ..., corners: _Optional[_Iterable[_Union[Corner, _Mapping]]] = ..., cylinders: _Optional[_Iterable[_Union[Cylinder, _Mapping]]] = ..., sweeps: _Optional[int] = ..., poses: _Optional[_Iterable[_Union[UnitPose, _Mapping]]] = ..., stops: _Optional[_Iterable[_Union[UnitPose, _Mapping]]] = ..., touches: _Optional[_Iterable[_Union[Touch, _Mapping]]] = ..., note: _Optional[str] = ...) -> None: ...

class FeaturePoint(_message.Message):
    __slots__ = ("x_m", "y_m", "reliability", "kind")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    RELIABILITY_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    reliability: float
    kind: ContactKind
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., reliability: _Optional[float] = ..., kind: _Optional[_Union[ContactKind, str]] = ...) -> None: ...

class Features(_message.Message):
    __slots__ = ("site", "mapper", "version", "time", "points")
    SITE_FIELD_NUMBER: _ClassVar[int]
    MAPPER_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    site: str
    mapper: str
    version: int
    time: _timestamp_pb2.Timestamp
    points: _containers.RepeatedCompositeFieldContainer[FeaturePoint]
    def __init__(self, site: _Optional[str] = ..., mapper: _Optional[str] = ..., version: _Optional[int] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., points: _Optional[_Iterable[_Union[FeaturePoint, _Mapping]]] = ...) -> None: ...

class GridTile(_message.Message):
    __slots__ = ("site", "mapper", "time", "tile_x", "tile_y", "x_m", "y_m", "cell_m", "columns", "rows", "occupied", "free")
    SITE_FIELD_NUMBER: _ClassVar[int]
    MAPPER_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    TILE_X_FIELD_NUMBER: _ClassVar[int]
    TILE_Y_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    CELL_M_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    OCCUPIED_FIELD_NUMBER: _ClassVar[int]
    FREE_FIELD_NUMBER: _ClassVar[int]
    site: str
    mapper: str
    time: _timestamp_pb2.Timestamp
    tile_x: int
    tile_y: int
    x_m: float
    y_m: float
    cell_m: float
    columns: int
    rows: int
    occupied: bytes
    free: bytes
    def __init__(self, site: _Optional[str] = ..., mapper: _Optional[str] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., tile_x: _Optional[int] = ..., tile_y: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., cell_m: _Optional[float] = ..., columns: _Optional[int] = ..., rows: _Optional[int] = ..., occupied: _Optional[bytes] = ..., free: _Optional[bytes] = ...) -> None: ...
