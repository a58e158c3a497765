# Made by scripts/message_types.py of the .msg and .srv files and the tables of topics.
from dataclasses import Field
from typing import ClassVar, Generic, Literal, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

class Message:
    """A message of any type."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[object]]]

class Answer(Message):
    """A response of a service that may refuse."""

    accepted: bool
    reason: str

M_co = TypeVar("M_co", bound=Message, covariant=True)

class Request(Message, Generic[M_co]):
    """A request of a service, whose responses are of this type."""

class PersonalRequest(Request[M_co]):
    """A request in the name of a person."""

    request_id: str
    requester: str

class TypeName(str, Generic[M_co]):
    """The name of a message type, in the tables."""

class Actuators(Message):
    header: Header
    thrust: float
    torque: Vector3
    thrusts: NDArray[np.float64]
    motor_references: NDArray[np.float64]
    scaling: float

class BatteryState(Message):
    header: Header
    voltage: float
    temperature: float
    current: float
    charge: float
    capacity: float
    design_capacity: float
    percentage: float
    power_supply_status: int
    power_supply_health: int
    power_supply_technology: int
    present: bool
    cell_voltage: NDArray[np.float32]
    cell_temperature: NDArray[np.float32]
    location: str
    serial_number: str

class BearingArray(Message):
    header: Header
    beacon_ids: NDArray[np.int32]
    bearings: list[Vector3]
    sigma: float

class BenchReading(Message):
    header: Header
    force: float
    torque: float
    speed: float

class BenchRequest(PersonalRequest[BenchResponse]):
    motor: int
    reference: int
    secured: bool

class BenchResponse(Answer): ...

class CalibrateRequest(PersonalRequest[CalibrateResponse]):
    action: str
    record: str

class CalibrateResponse(Answer):
    records: list[str]

class CameraFigures(Message):
    name: str
    picture_rate: float
    tags_share: float
    grey_level: float
    residual: float

class ChangeParametersRequest(PersonalRequest[ChangeParametersResponse]):
    parameters: list[Parameter]

class ChangeParametersResponse(Answer):
    applied: list[Parameter]
    revision: int

class Check(Message):
    name: str
    place: str
    state: str
    found: str
    wanted: str
    advice: str

class ChecksRequest(PersonalRequest[ChecksResponse]):
    again: bool

class ChecksResponse(Answer):
    checked: float
    checks: list[Check]

class ColorRGBA(Message):
    r: float
    g: float
    b: float
    a: float

class CommandRequest(PersonalRequest[CommandResponse]):
    valid_until_ns: int

class CommandResponse(Answer): ...

class CompressedImage(Message):
    header: Header
    format: str
    data: NDArray[np.uint8]

class ControlRequest(PersonalRequest[ControlResponse]):
    action: str

class ControlResponse(Answer): ...

class ControlStatus(Message):
    header: Header
    holder: str
    asking: str
    answer_within: float

class DescribeParametersRequest(Request[DescribeParametersResponse]):
    names: list[str]

class DescribeParametersResponse(Message):
    descriptors: list[ParameterDescriptor]

class Duration(Message):
    sec: int
    nanosec: int

class EmergencyRequest(PersonalRequest[EmergencyResponse]):
    action: str

class EmergencyResponse(Answer): ...

class EstimatorComparison(Message):
    header: Header
    truth: str
    duration: float
    sigma: float
    position_bound: float
    attitude_bound: float
    estimators: list[EstimatorResult]

class EstimatorResult(Message):
    name: str
    initialized: bool
    converged: bool
    pose: Pose
    velocity: Vector3
    position_covariance: NDArray[np.float64]
    attitude_variance: float
    position_error: float
    attitude_error: float
    position_rms_recent: float
    position_max_recent: float
    position_rms: float
    position_max: float
    attitude_rms_recent: float
    attitude_max_recent: float
    attitude_rms: float
    attitude_max: float
    processor: float
    beacon_ids: NDArray[np.int32]
    residuals: NDArray[np.float64]

class EstimatorStatus(Message):
    header: Header
    estimator: str
    mass: float
    mass_variance: float
    accelerometer_bias: Vector3
    gyroscope_bias: Vector3
    position_innovation: Vector3
    attitude_innovation: Vector3
    measurement_age: float
    measurements_used: int
    measurements_refused: int
    measurements_ignored: int
    agreement: int
    nis: float
    nis_freedom: int
    consistency: float
    refused_share: float
    accelerometer_noise_scale: float
    gyroscope_noise_scale: float
    measurement_noise_scale: float
    position_variance: Vector3
    velocity_variance: Vector3
    attitude_variance: Vector3

class ExperimentRequest(PersonalRequest[ExperimentResponse]):
    action: str
    name: str
    options: list[Parameter]

class ExperimentResponse(Answer):
    names: list[str]
    descriptions: list[str]
    descriptors: list[ParameterDescriptor]
    calibrations: list[str]
    problems: list[str]

class ExperimentStatus(Message):
    header: Header
    name: str
    phase: str
    step: str
    requester: str
    manual: bool
    elapsed: float
    planned: float
    reason: str
    run_id: str
    verdict: str
    metric_names: list[str]
    metric_values: NDArray[np.float64]
    metric_limits: NDArray[np.float64]
    reports: list[str]
    instruction: str
    step_number: int
    step_count: int
    step_share: float
    question: str
    live_names: list[str]
    live_values: NDArray[np.float64]
    live_units: list[str]
    proposal: str
    decision: str

class FloatingPointRange(Message):
    from_value: float
    to_value: float
    step: float

class FluidPressure(Message):
    header: Header
    fluid_pressure: float
    variance: float

class GetParameterTypesRequest(Request[GetParameterTypesResponse]):
    names: list[str]

class GetParameterTypesResponse(Message):
    types: NDArray[np.uint8]

class GetParametersRequest(Request[GetParametersResponse]):
    names: list[str]

class GetParametersResponse(Message):
    values: list[ParameterValue]

class Header(Message):
    stamp: Time
    frame_id: str

class Heartbeat(Message):
    sequence: int
    stamp_ns: int
    instance: int
    holder: int

class Imu(Message):
    header: Header
    orientation: Quaternion
    orientation_covariance: NDArray[np.float64]
    angular_velocity: Vector3
    angular_velocity_covariance: NDArray[np.float64]
    linear_acceleration: Vector3
    linear_acceleration_covariance: NDArray[np.float64]

class IntegerRange(Message):
    from_value: int
    to_value: int
    step: int

class Joy(Message):
    header: Header
    axes: NDArray[np.float32]
    buttons: NDArray[np.int32]

class LaneRequest(PersonalRequest[LaneResponse]):
    instance: int

class LaneResponse(Answer):
    port: int
    key_id: int
    key_to_station: NDArray[np.uint8]
    key_to_vehicle: NDArray[np.uint8]

class LinkStatus(Message):
    header: Header
    state: str
    round_trip: float
    clock_offset: float
    jitter: float
    age: float
    loss: float
    telemetry_rate: float
    state_duration: float
    outages: int
    outage_last: float
    outage_longest: float
    outage_total: float
    address: str
    access: str
    path: str
    problem: str
    reopened: int

class ListParametersRequest(Request[ListParametersResponse]):
    prefixes: list[str]
    depth: int

class ListParametersResponse(Message):
    result: ListParametersResult

class ListParametersResult(Message):
    names: list[str]
    prefixes: list[str]

class Log(Message):
    stamp: Time
    level: int
    name: str
    msg: str
    file: str
    function: str
    line: int

class Mark(Message):
    header: Header
    id: str
    run_id: str
    time: float
    text: str
    requester: str

class MarkRequest(PersonalRequest[MarkResponse]):
    id: str
    text: str
    pressed_ns: int

class MarkResponse(Answer):
    run_id: str
    time: float
    logged: bool

class Marker(Message):
    header: Header
    ns: str
    id: int
    type: int
    action: int
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: list[Point]
    colors: list[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: list[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool

class MarkerArray(Message):
    markers: list[Marker]

class MeshFile(Message):
    filename: str
    data: NDArray[np.uint8]

class Odometry(Message):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance

class OnboardFile(Message):
    name: str
    size: int
    identity: int
    start_ns: int
    end_ns: int
    closed: bool
    recovered: bool

class OnboardFilesRequest(PersonalRequest[OnboardFilesResponse]): ...

class OnboardFilesResponse(Answer):
    files: list[OnboardFile]
    free_bytes: int

class OnboardLogRequest(PersonalRequest[OnboardLogResponse]):
    columns: list[str]
    start_ns: int
    end_ns: int
    rows: int

class OnboardLogResponse(Answer):
    file: str
    stamps_ns: NDArray[np.int64]
    values: NDArray[np.float32]
    written_ns: int
    complete: bool
    damaged: int

class OnboardPartRequest(PersonalRequest[OnboardPartResponse]):
    name: str
    offset: int
    length: int

class OnboardPartResponse(Answer):
    file: OnboardFile
    data: NDArray[np.uint8]
    crc32: int
    sha256: NDArray[np.uint8]

class Parameter(Message):
    name: str
    value: ParameterValue

class ParameterChange(Message):
    header: Header
    name: str
    old_value: ParameterValue
    new_value: ParameterValue
    requester: str
    revision: int
    instance: int

class ParameterDescriptor(Message):
    name: str
    type: int
    description: str
    additional_constraints: str
    read_only: bool
    dynamic_typing: bool
    floating_point_range: list[FloatingPointRange]
    integer_range: list[IntegerRange]

class ParameterValue(Message):
    type: int
    bool_value: bool
    integer_value: int
    double_value: float
    string_value: str
    byte_array_value: NDArray[np.uint8]
    bool_array_value: NDArray[np.bool_]
    integer_array_value: NDArray[np.int64]
    double_array_value: NDArray[np.float64]
    string_array_value: list[str]

class Point(Message):
    x: float
    y: float
    z: float

class PointStamped(Message):
    header: Header
    point: Point

class Pose(Message):
    position: Point
    orientation: Quaternion

class PoseStamped(Message):
    header: Header
    pose: Pose

class PoseWithCovariance(Message):
    pose: Pose
    covariance: NDArray[np.float64]

class PoseWithCovarianceStamped(Message):
    header: Header
    pose: PoseWithCovariance

class Preflight(Message):
    header: Header
    ready: bool
    armed: bool
    blocks: bool
    checks: list[Check]

class Presence(Message):
    names: list[str]

class Quaternion(Message):
    x: float
    y: float
    z: float
    w: float

class RecordRequest(PersonalRequest[RecordResponse]):
    start: bool

class RecordResponse(Answer):
    run_id: str

class Reference(Message):
    header: Header
    position: Vector3
    velocity: Vector3
    acceleration: Vector3
    jerk: Vector3
    snap: Vector3
    yaw: float
    yaw_rate: float
    yaw_acceleration: float

class SensorReading(Message):
    header: Header
    sensor: str
    reading: float
    expected: float
    residual: float
    gate: float
    deviation: float
    judgement: int

class SetParametersAtomicallyRequest(Request[SetParametersAtomicallyResponse]):
    parameters: list[Parameter]

class SetParametersAtomicallyResponse(Message):
    result: SetParametersResult

class SetParametersRequest(Request[SetParametersResponse]):
    parameters: list[Parameter]

class SetParametersResponse(Message):
    results: list[SetParametersResult]

class SetParametersResult(Message):
    successful: bool
    reason: str

class SimulationRequest(PersonalRequest[SimulationResponse]):
    action: str

class SimulationResponse(Answer): ...

class StartBehaviorRequest(PersonalRequest[StartBehaviorResponse]):
    name: str
    arguments: list[Parameter]
    valid_until_ns: int

class StartBehaviorResponse(Answer):
    kind: str

class StationStatus(Message):
    header: Header
    recording: bool
    run_id: str
    recording_duration: float
    recording_bytes: int
    free_bytes: int
    tracker_rate: float
    alarms: list[str]
    real_time_factor: float

class StickStatus(Message):
    header: Header
    enabled: bool
    reason: str

class SweepArray(Message):
    header: Header
    plane: int
    rotor: Pose
    tilt: float
    phase: float
    gib_magnitude: float
    gib_phase: float
    curve: float
    sensors: list[Vector3]
    angles: NDArray[np.float64]
    sigma: float

class TFMessage(Message):
    transforms: list[TransformStamped]

class Telemetry(Message):
    sequence: int
    stamp_ns: int
    offsets_ns: NDArray[np.uint32]
    samples: NDArray[np.float32]

class Time(Message):
    sec: int
    nanosec: int

class TimeSyncRequest(Request[TimeSyncResponse]):
    client_sent_ns: int

class TimeSyncResponse(Message):
    server_received_ns: int
    server_sent_ns: int

class TrackerStatus(Message):
    header: Header
    system: str
    body: str
    seen: list[str]
    rates: NDArray[np.float64]
    frame_rate: float
    latency: float
    latency_p99: float
    latency_counts: NDArray[np.uint32]
    clock_drift: float
    gaps: int
    jumps: int
    clock_jumps: int
    problem: str
    withheld: bool
    cameras: list[CameraFigures]

class Transfer(Message):
    id: int
    kind: str
    name: str
    phase: str
    bytes: int
    total_bytes: int
    rate: float
    problem: str

class TransferRequest(PersonalRequest[TransferResponse]):
    action: str
    name: str

class TransferResponse(Answer):
    id: int

class Transfers(Message):
    header: Header
    transfers: list[Transfer]

class Transform(Message):
    translation: Vector3
    rotation: Quaternion

class TransformStamped(Message):
    header: Header
    child_frame_id: str
    transform: Transform

class Twist(Message):
    linear: Vector3
    angular: Vector3

class TwistWithCovariance(Message):
    twist: Twist
    covariance: NDArray[np.float64]

class UVCoordinate(Message):
    u: float
    v: float

class Vector3(Message):
    x: float
    y: float
    z: float

class VehicleStatus(Message):
    header: Header
    mode: str
    behavior: str
    control_mode: str
    armed: bool
    airborne: bool
    flags: list[str]
    parameter_revision: int
    instance: int
    tick_rate: float
    lateness_p50: float
    lateness_p99: float
    lateness_max: float
    missed_share: float
    lateness_histogram: NDArray[np.uint32]
    overruns: int
    missed_frames: int
    damaged_frames: int
    nominal_rate: float
    suspect_offset: float
    suspect_beacon: int
    suspect_left_out: bool
    shadow_lack: int
    shadow_share: float
    shadow_ready: float
    shadow_deviation: float
    shadow_distance: float
    oscillation_frequency: float
    oscillation_axis: int
    board_command_rate: float
    board_round_trip: float
    board_acknowledged: float
    board_retries: float
    board_waiting: int

class WhoAmIRequest(Request[WhoAmIResponse]): ...

class WhoAmIResponse(Message):
    name: str
    role: str
    access: str
    instance: int
    protocol: str
    version: str
    robot_id: int
    firmware: int

class ServiceName(str, Generic[M_co]):
    """The name of a service, whose responses are of this type."""

class Decode(Protocol):
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Actuators"]
    ) -> Actuators: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["sensor_msgs/BatteryState"]
    ) -> BatteryState: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/BearingArray"]
    ) -> BearingArray: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/BenchReading"]
    ) -> BenchReading: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Bench_Request"]
    ) -> BenchRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Bench_Response"]
    ) -> BenchResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Calibrate_Request"]
    ) -> CalibrateRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Calibrate_Response"]
    ) -> CalibrateResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/CameraFigures"]
    ) -> CameraFigures: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/ChangeParameters_Request"],
    ) -> ChangeParametersRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/ChangeParameters_Response"],
    ) -> ChangeParametersResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Check"]
    ) -> Check: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Checks_Request"]
    ) -> ChecksRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Checks_Response"]
    ) -> ChecksResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["std_msgs/ColorRGBA"]
    ) -> ColorRGBA: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Command_Request"]
    ) -> CommandRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Command_Response"]
    ) -> CommandResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["sensor_msgs/CompressedImage"]
    ) -> CompressedImage: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Control_Request"]
    ) -> ControlRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Control_Response"]
    ) -> ControlResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/ControlStatus"]
    ) -> ControlStatus: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/DescribeParameters_Request"],
    ) -> DescribeParametersRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/DescribeParameters_Response"],
    ) -> DescribeParametersResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["builtin_interfaces/Duration"]
    ) -> Duration: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Emergency_Request"]
    ) -> EmergencyRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Emergency_Response"]
    ) -> EmergencyResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/EstimatorComparison"]
    ) -> EstimatorComparison: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/EstimatorResult"]
    ) -> EstimatorResult: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/EstimatorStatus"]
    ) -> EstimatorStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Experiment_Request"]
    ) -> ExperimentRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/Experiment_Response"],
    ) -> ExperimentResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/ExperimentStatus"]
    ) -> ExperimentStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/FloatingPointRange"]
    ) -> FloatingPointRange: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["sensor_msgs/FluidPressure"]
    ) -> FluidPressure: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/GetParameterTypes_Request"],
    ) -> GetParameterTypesRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/GetParameterTypes_Response"],
    ) -> GetParameterTypesResponse: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/GetParameters_Request"],
    ) -> GetParametersRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/GetParameters_Response"],
    ) -> GetParametersResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["std_msgs/Header"]
    ) -> Header: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Heartbeat"]
    ) -> Heartbeat: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["sensor_msgs/Imu"]
    ) -> Imu: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/IntegerRange"]
    ) -> IntegerRange: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["sensor_msgs/Joy"]
    ) -> Joy: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Lane_Request"]
    ) -> LaneRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Lane_Response"]
    ) -> LaneResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/LinkStatus"]
    ) -> LinkStatus: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/ListParameters_Request"],
    ) -> ListParametersRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/ListParameters_Response"],
    ) -> ListParametersResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/ListParametersResult"]
    ) -> ListParametersResult: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/Log"]
    ) -> Log: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Mark"]
    ) -> Mark: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Mark_Request"]
    ) -> MarkRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Mark_Response"]
    ) -> MarkResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["visualization_msgs/Marker"]
    ) -> Marker: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["visualization_msgs/MarkerArray"]
    ) -> MarkerArray: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["visualization_msgs/MeshFile"]
    ) -> MeshFile: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["nav_msgs/Odometry"]
    ) -> Odometry: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/OnboardFile"]
    ) -> OnboardFile: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/OnboardFiles_Request"],
    ) -> OnboardFilesRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/OnboardFiles_Response"],
    ) -> OnboardFilesResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/OnboardLog_Request"]
    ) -> OnboardLogRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/OnboardLog_Response"],
    ) -> OnboardLogResponse: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/OnboardPart_Request"],
    ) -> OnboardPartRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/OnboardPart_Response"],
    ) -> OnboardPartResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/Parameter"]
    ) -> Parameter: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/ParameterChange"]
    ) -> ParameterChange: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/ParameterDescriptor"]
    ) -> ParameterDescriptor: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/ParameterValue"]
    ) -> ParameterValue: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Point"]
    ) -> Point: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/PointStamped"]
    ) -> PointStamped: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Pose"]
    ) -> Pose: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/PoseStamped"]
    ) -> PoseStamped: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/PoseWithCovariance"]
    ) -> PoseWithCovariance: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["geometry_msgs/PoseWithCovarianceStamped"],
    ) -> PoseWithCovarianceStamped: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Preflight"]
    ) -> Preflight: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Presence"]
    ) -> Presence: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Quaternion"]
    ) -> Quaternion: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Record_Request"]
    ) -> RecordRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Record_Response"]
    ) -> RecordResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Reference"]
    ) -> Reference: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/SensorReading"]
    ) -> SensorReading: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/SetParametersAtomically_Request"],
    ) -> SetParametersAtomicallyRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/SetParametersAtomically_Response"],
    ) -> SetParametersAtomicallyResponse: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/SetParameters_Request"],
    ) -> SetParametersRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["rcl_interfaces/srv/SetParameters_Response"],
    ) -> SetParametersResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["rcl_interfaces/SetParametersResult"]
    ) -> SetParametersResult: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Simulation_Request"]
    ) -> SimulationRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/Simulation_Response"],
    ) -> SimulationResponse: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/StartBehavior_Request"],
    ) -> StartBehaviorRequest: ...
    @overload
    def __call__(
        self,
        payload: bytes | memoryview,
        type_name: Literal["quadlab_msgs/srv/StartBehavior_Response"],
    ) -> StartBehaviorResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/StationStatus"]
    ) -> StationStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/StickStatus"]
    ) -> StickStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/SweepArray"]
    ) -> SweepArray: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["tf2_msgs/TFMessage"]
    ) -> TFMessage: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Telemetry"]
    ) -> Telemetry: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["builtin_interfaces/Time"]
    ) -> Time: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/TimeSync_Request"]
    ) -> TimeSyncRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/TimeSync_Response"]
    ) -> TimeSyncResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/TrackerStatus"]
    ) -> TrackerStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Transfer"]
    ) -> Transfer: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Transfer_Request"]
    ) -> TransferRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/Transfer_Response"]
    ) -> TransferResponse: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/Transfers"]
    ) -> Transfers: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Transform"]
    ) -> Transform: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/TransformStamped"]
    ) -> TransformStamped: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Twist"]
    ) -> Twist: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/TwistWithCovariance"]
    ) -> TwistWithCovariance: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["visualization_msgs/UVCoordinate"]
    ) -> UVCoordinate: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["geometry_msgs/Vector3"]
    ) -> Vector3: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/VehicleStatus"]
    ) -> VehicleStatus: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/WhoAmI_Request"]
    ) -> WhoAmIRequest: ...
    @overload
    def __call__(
        self, payload: bytes | memoryview, type_name: Literal["quadlab_msgs/srv/WhoAmI_Response"]
    ) -> WhoAmIResponse: ...
    @overload
    def __call__(self, payload: bytes | memoryview, type_name: TypeName[M_co]) -> M_co: ...
    @overload
    def __call__(self, payload: bytes | memoryview, type_name: str) -> Message: ...

class New(Protocol):
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Actuators"], **fields: object
    ) -> Actuators: ...
    @overload
    def __call__(
        self, type_name: Literal["sensor_msgs/BatteryState"], **fields: object
    ) -> BatteryState: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/BearingArray"], **fields: object
    ) -> BearingArray: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/BenchReading"], **fields: object
    ) -> BenchReading: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Bench_Request"], **fields: object
    ) -> BenchRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Bench_Response"], **fields: object
    ) -> BenchResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Calibrate_Request"], **fields: object
    ) -> CalibrateRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Calibrate_Response"], **fields: object
    ) -> CalibrateResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/CameraFigures"], **fields: object
    ) -> CameraFigures: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/ChangeParameters_Request"], **fields: object
    ) -> ChangeParametersRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/ChangeParameters_Response"], **fields: object
    ) -> ChangeParametersResponse: ...
    @overload
    def __call__(self, type_name: Literal["quadlab_msgs/Check"], **fields: object) -> Check: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Checks_Request"], **fields: object
    ) -> ChecksRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Checks_Response"], **fields: object
    ) -> ChecksResponse: ...
    @overload
    def __call__(self, type_name: Literal["std_msgs/ColorRGBA"], **fields: object) -> ColorRGBA: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Command_Request"], **fields: object
    ) -> CommandRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Command_Response"], **fields: object
    ) -> CommandResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["sensor_msgs/CompressedImage"], **fields: object
    ) -> CompressedImage: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Control_Request"], **fields: object
    ) -> ControlRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Control_Response"], **fields: object
    ) -> ControlResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/ControlStatus"], **fields: object
    ) -> ControlStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/DescribeParameters_Request"], **fields: object
    ) -> DescribeParametersRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/DescribeParameters_Response"], **fields: object
    ) -> DescribeParametersResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["builtin_interfaces/Duration"], **fields: object
    ) -> Duration: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Emergency_Request"], **fields: object
    ) -> EmergencyRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Emergency_Response"], **fields: object
    ) -> EmergencyResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/EstimatorComparison"], **fields: object
    ) -> EstimatorComparison: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/EstimatorResult"], **fields: object
    ) -> EstimatorResult: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/EstimatorStatus"], **fields: object
    ) -> EstimatorStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Experiment_Request"], **fields: object
    ) -> ExperimentRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Experiment_Response"], **fields: object
    ) -> ExperimentResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/ExperimentStatus"], **fields: object
    ) -> ExperimentStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/FloatingPointRange"], **fields: object
    ) -> FloatingPointRange: ...
    @overload
    def __call__(
        self, type_name: Literal["sensor_msgs/FluidPressure"], **fields: object
    ) -> FluidPressure: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/GetParameterTypes_Request"], **fields: object
    ) -> GetParameterTypesRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/GetParameterTypes_Response"], **fields: object
    ) -> GetParameterTypesResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/GetParameters_Request"], **fields: object
    ) -> GetParametersRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/GetParameters_Response"], **fields: object
    ) -> GetParametersResponse: ...
    @overload
    def __call__(self, type_name: Literal["std_msgs/Header"], **fields: object) -> Header: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Heartbeat"], **fields: object
    ) -> Heartbeat: ...
    @overload
    def __call__(self, type_name: Literal["sensor_msgs/Imu"], **fields: object) -> Imu: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/IntegerRange"], **fields: object
    ) -> IntegerRange: ...
    @overload
    def __call__(self, type_name: Literal["sensor_msgs/Joy"], **fields: object) -> Joy: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Lane_Request"], **fields: object
    ) -> LaneRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Lane_Response"], **fields: object
    ) -> LaneResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/LinkStatus"], **fields: object
    ) -> LinkStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/ListParameters_Request"], **fields: object
    ) -> ListParametersRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/ListParameters_Response"], **fields: object
    ) -> ListParametersResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/ListParametersResult"], **fields: object
    ) -> ListParametersResult: ...
    @overload
    def __call__(self, type_name: Literal["rcl_interfaces/Log"], **fields: object) -> Log: ...
    @overload
    def __call__(self, type_name: Literal["quadlab_msgs/Mark"], **fields: object) -> Mark: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Mark_Request"], **fields: object
    ) -> MarkRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Mark_Response"], **fields: object
    ) -> MarkResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["visualization_msgs/Marker"], **fields: object
    ) -> Marker: ...
    @overload
    def __call__(
        self, type_name: Literal["visualization_msgs/MarkerArray"], **fields: object
    ) -> MarkerArray: ...
    @overload
    def __call__(
        self, type_name: Literal["visualization_msgs/MeshFile"], **fields: object
    ) -> MeshFile: ...
    @overload
    def __call__(self, type_name: Literal["nav_msgs/Odometry"], **fields: object) -> Odometry: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/OnboardFile"], **fields: object
    ) -> OnboardFile: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardFiles_Request"], **fields: object
    ) -> OnboardFilesRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardFiles_Response"], **fields: object
    ) -> OnboardFilesResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardLog_Request"], **fields: object
    ) -> OnboardLogRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardLog_Response"], **fields: object
    ) -> OnboardLogResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardPart_Request"], **fields: object
    ) -> OnboardPartRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/OnboardPart_Response"], **fields: object
    ) -> OnboardPartResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/Parameter"], **fields: object
    ) -> Parameter: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/ParameterChange"], **fields: object
    ) -> ParameterChange: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/ParameterDescriptor"], **fields: object
    ) -> ParameterDescriptor: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/ParameterValue"], **fields: object
    ) -> ParameterValue: ...
    @overload
    def __call__(self, type_name: Literal["geometry_msgs/Point"], **fields: object) -> Point: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/PointStamped"], **fields: object
    ) -> PointStamped: ...
    @overload
    def __call__(self, type_name: Literal["geometry_msgs/Pose"], **fields: object) -> Pose: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/PoseStamped"], **fields: object
    ) -> PoseStamped: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/PoseWithCovariance"], **fields: object
    ) -> PoseWithCovariance: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/PoseWithCovarianceStamped"], **fields: object
    ) -> PoseWithCovarianceStamped: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Preflight"], **fields: object
    ) -> Preflight: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Presence"], **fields: object
    ) -> Presence: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/Quaternion"], **fields: object
    ) -> Quaternion: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Record_Request"], **fields: object
    ) -> RecordRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Record_Response"], **fields: object
    ) -> RecordResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Reference"], **fields: object
    ) -> Reference: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/SensorReading"], **fields: object
    ) -> SensorReading: ...
    @overload
    def __call__(
        self,
        type_name: Literal["rcl_interfaces/srv/SetParametersAtomically_Request"],
        **fields: object,
    ) -> SetParametersAtomicallyRequest: ...
    @overload
    def __call__(
        self,
        type_name: Literal["rcl_interfaces/srv/SetParametersAtomically_Response"],
        **fields: object,
    ) -> SetParametersAtomicallyResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/SetParameters_Request"], **fields: object
    ) -> SetParametersRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/srv/SetParameters_Response"], **fields: object
    ) -> SetParametersResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["rcl_interfaces/SetParametersResult"], **fields: object
    ) -> SetParametersResult: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Simulation_Request"], **fields: object
    ) -> SimulationRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Simulation_Response"], **fields: object
    ) -> SimulationResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/StartBehavior_Request"], **fields: object
    ) -> StartBehaviorRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/StartBehavior_Response"], **fields: object
    ) -> StartBehaviorResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/StationStatus"], **fields: object
    ) -> StationStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/StickStatus"], **fields: object
    ) -> StickStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/SweepArray"], **fields: object
    ) -> SweepArray: ...
    @overload
    def __call__(self, type_name: Literal["tf2_msgs/TFMessage"], **fields: object) -> TFMessage: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Telemetry"], **fields: object
    ) -> Telemetry: ...
    @overload
    def __call__(self, type_name: Literal["builtin_interfaces/Time"], **fields: object) -> Time: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/TimeSync_Request"], **fields: object
    ) -> TimeSyncRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/TimeSync_Response"], **fields: object
    ) -> TimeSyncResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/TrackerStatus"], **fields: object
    ) -> TrackerStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Transfer"], **fields: object
    ) -> Transfer: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Transfer_Request"], **fields: object
    ) -> TransferRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/Transfer_Response"], **fields: object
    ) -> TransferResponse: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/Transfers"], **fields: object
    ) -> Transfers: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/Transform"], **fields: object
    ) -> Transform: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/TransformStamped"], **fields: object
    ) -> TransformStamped: ...
    @overload
    def __call__(self, type_name: Literal["geometry_msgs/Twist"], **fields: object) -> Twist: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/TwistWithCovariance"], **fields: object
    ) -> TwistWithCovariance: ...
    @overload
    def __call__(
        self, type_name: Literal["visualization_msgs/UVCoordinate"], **fields: object
    ) -> UVCoordinate: ...
    @overload
    def __call__(
        self, type_name: Literal["geometry_msgs/Vector3"], **fields: object
    ) -> Vector3: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/VehicleStatus"], **fields: object
    ) -> VehicleStatus: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/WhoAmI_Request"], **fields: object
    ) -> WhoAmIRequest: ...
    @overload
    def __call__(
        self, type_name: Literal["quadlab_msgs/srv/WhoAmI_Response"], **fields: object
    ) -> WhoAmIResponse: ...
    @overload
    def __call__(self, type_name: str, **fields: object) -> Message: ...
