"""The messages between the comms process and the flight process.

They are encoded as msgpack by msgspec: 1 µs each, so the flight loop can drain them between ticks.
Poses and bearings are records in separate rings (vehicle.processes.config). Stamps are nanoseconds
of the vehicle's clock.
"""

from __future__ import annotations

import msgspec

from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link import commands
from vehicle_link.commands import EventKind
from vehicle_link.parameters.change import ParameterChange

Arm = commands.Arm
Bench = commands.Bench
ChangeParameters = commands.ChangeParameters
Disarm = commands.Disarm
ExpectMove = commands.ExpectMove
Emergency = commands.Emergency
StartBehavior = commands.StartBehavior


class Calibrate(commands.Request, frozen=True, tag="calibrate"):
    """Apply a calibration's values, all or none; only on the ground with motors off.

    Empty values ask whether that is possible now.
    """

    values: dict[str, ParameterValue]


class CalibrateGyroscope(commands.Request, frozen=True, tag="calibrate_gyroscope"):
    """Find the drift again; if accepted, a GyroscopeFound with this request id follows."""


class Joy(msgspec.Struct, frozen=True, tag="joy"):
    """Sticks: axes (forward, left, up, yaw) in -1..1; enabled while the dead-man is held."""

    stamp_ns: int
    axes: tuple[float, float, float, float]
    enabled: bool


class ExternalReference(msgspec.Struct, frozen=True, tag="external_reference"):
    """Reference that another program requests for this time: REFERENCE's 18 numbers, all finite."""

    stamp_ns: int
    numbers: tuple[float, ...]


class Heartbeat(msgspec.Struct, frozen=True, tag="heartbeat"):
    """Reception of the station at this time."""

    stamp_ns: int


Command = (
    ChangeParameters
    | Arm
    | Disarm
    | ExpectMove
    | StartBehavior
    | Emergency
    | Calibrate
    | CalibrateGyroscope
    | Bench
)
Measurement = Joy | ExternalReference | Heartbeat
Inbound = Command | Measurement


class Reply(msgspec.Struct, frozen=True, tag="reply"):
    """The answer to a Command; `reason` is empty when accepted."""

    request_id: str
    accepted: bool
    reason: str = ""
    applied: dict[str, ParameterValue] = {}
    revision: int = 0
    previous: dict[str, ParameterValue] = {}
    """The values before the change, in the answer to Calibrate."""
    kind: str = ""
    """A kind of quadrotor.errors.Refusal."""


class Described(msgspec.Struct, frozen=True, tag="described"):
    """A parameter that the board alone knows, sent before the answer to an empty change."""

    description: ParameterDescription


class Event(msgspec.Struct, frozen=True, tag="event"):
    """One line for the log and the page; levels as in rcl_interfaces/Log (20 info, 30, 40)."""

    stamp_ns: int
    level: int
    text: str
    kinds: frozenset[EventKind] = frozenset()


class GyroscopeFound(msgspec.Struct, frozen=True, tag="gyroscope_found"):
    """The result of a calibration of the gyroscope; all angles in rad, body axes.

    Attributes:
        request_id: empty at the start of the vehicle, where `requester` is "start".
        reason: why the drift is unchanged; empty when there is a new one.
        deviation_b: of one sample.
        deviation_max: largest allowed deviation.
        seconds: duration of the calibration.
        voltage: V, of the battery.
    """

    stamp_ns: int
    request_id: str
    requester: str
    reason: str = ""
    bias_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    samples: int = 0
    deviation_max: float = 0.0
    seconds: float = 0.0
    voltage: float = 0.0


Notification = Event | ParameterChange | GyroscopeFound
"""Messages that a stack sends without a request."""
Outbound = Reply | Described | Notification

INFO, WARN, ERROR = 20, 30, 40

encode = msgspec.msgpack.Encoder().encode
decode_inbound = msgspec.msgpack.Decoder(Inbound).decode
decode_outbound = msgspec.msgpack.Decoder(Outbound).decode
