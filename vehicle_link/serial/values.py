"""The meaning of each value of the microcontroller: unit, counts per unit, bounds; counts <-> SI.

The source defines the ids and only some of the units; the others are quadlab's choice, marked so
in docs/boards/microcontroller.md. Inertial readings stay in counts here: their scale comes from the
calibration.
"""

from __future__ import annotations

import math

import msgspec

from quadrotor.errors import OutOfBoundsError
from vehicle_link.serial.attitude_command import HOVER_THRUST, THRUST_MIN
from vehicle_link.serial.ids import PRESSURE_OFFSET, TIME_PERIOD_MS, Id

INT16, UINT16 = (-32768, 32767), (0, 65535)
_SI = {
    "deg": ("rad", math.radians(1.0)),
    "deg/s": ("rad/s", math.radians(1.0)),
    "ms": ("s", 1e-3),
    "µs": ("s", 1e-6),
    "mN m": ("N m", 1e-3),
}
"""Units on the line that are not SI: the SI unit and factor of each."""


class Quantity(msgspec.Struct, frozen=True):
    """The scale of one id: value in `unit` = counts / counts_per_unit + offset."""

    description: str
    unit: str = ""  # on the line; empty for numbers, switches and choices
    counts_per_unit: float = 1
    offset: float = 0  # in `unit`
    bounds: tuple[int, int] = INT16  # counts, both allowed
    writable: bool = False

    @property
    def signed(self) -> bool:
        """Return whether the 16 bits are read as a signed number."""
        return self.bounds[0] < 0


def to_si(id: int, raw: int) -> float:
    """Return the value of an id in SI units (m g for thrust) from the int16 or uint16 of a frame.

    Raises OutOfBoundsError when there is no such id.
    """
    quantity = quantity_of(id)
    counts = _counts(quantity, raw)
    return (counts / quantity.counts_per_unit + quantity.offset) * _factor(quantity)


def quantity_of(id: int) -> Quantity:
    """Return the quantity of an id. Raises OutOfBoundsError when there is no such id."""
    try:
        return QUANTITIES[Id(id)]
    except ValueError:
        raise OutOfBoundsError(
            f"the microcontroller has no value {id}; its ids are 0 to {max(Id)}"
        ) from None


def _counts(quantity: Quantity, raw: int) -> int:
    return (raw + 32768) % 65536 - 32768 if quantity.signed else raw % 65536


def _factor(quantity: Quantity) -> float:
    return _SI.get(quantity.unit, ("", 1.0))[1]


# ---------------------------------------------------------------- the table
_CONVERTER, _SWITCH, _BYTE = (0, 1023), (0, 1), (0, 255)
_AXES = ("x, forward", "y, left", "z, up")


def _axes(
    first: Id,
    of: str,
    unit: str,
    counts_per_unit: float = 1,
    bounds: tuple[int, int] = INT16,
    writable: bool = False,
) -> dict[Id, Quantity]:
    """Return the quantities of three consecutive ids."""
    return {
        Id(first + axis): Quantity(f"{of}, {name}", unit, counts_per_unit, 0, bounds, writable)
        for axis, name in enumerate(_AXES)
    }


def _gain(of: str, unit: str) -> Quantity:
    return Quantity(
        f"near-hovering gain per unit inertia: {of}", unit, 10, bounds=(0, 32767), writable=True
    )


def _rate(of: str) -> Quantity:
    return Quantity(of, "1/s", bounds=(0, 32767))


def _longest(of: str) -> Quantity:
    return Quantity(f"longest {of} in the last second", "ms", bounds=(0, 32767))


def _shortest(of: str) -> Quantity:
    return Quantity(f"least period of {of}", "ms", 10, bounds=(0, 32767), writable=True)


def _motor(where: str) -> Quantity:
    return Quantity(f"motor reference, {where}; -1: no answer", "count", bounds=(-1, 255))


QUANTITIES: dict[Id, Quantity] = {
    **_axes(Id.ACCELEROMETER_X, "raw accelerometer", "count", bounds=_CONVERTER),
    **_axes(Id.GYROSCOPE_X, "raw gyroscope", "count", bounds=_CONVERTER),
    **_axes(Id.ACCELERATION_X, "specific force", "m/s²", 100),
    **_axes(Id.RATE_X, "angular velocity", "deg/s", 10),
    Id.BATTERY: Quantity("battery voltage", "V", 10, bounds=(0, 32767)),
    **_axes(Id.ACCELEROMETER_OFFSET_X, "accelerometer offset", "count", writable=True),
    **_axes(Id.GYROSCOPE_DRIFT_X, "gyroscope drift", "deg/s", 100),
    Id.PITCH: Quantity("pitch, about y", "deg", 10),
    Id.ROLL: Quantity("roll, about x", "deg", 10),
    Id.PITCH_RATE: Quantity("rate of pitch", "deg/s", 10),
    Id.ROLL_RATE: Quantity("rate of roll", "deg/s", 10),
    Id.GAIN_P: _gain("angle, proportional", "1/s²"),
    Id.GAIN_D: _gain("angle, derivative", "1/s"),
    Id.GAIN_I: _gain("angle, integral", "1/s³"),
    Id.GAIN_YAW_RATE: _gain("yaw rate", "1/s"),
    Id.GAIN_YAW_ACCELERATION: _gain("yaw acceleration", ""),
    Id.YAW_CONTROL_TYPE: Quantity("which yaw controller is used", bounds=_BYTE, writable=True),
    Id.MIRROR_PERIOD: Quantity("between two D frames", "µs", bounds=(1000, 20_000), writable=True),
    Id.TIME: Quantity("time since power-up, modulo 60 s", "ms", bounds=(0, TIME_PERIOD_MS - 1)),
    Id.MIRROR_ACTIVE: Quantity("whether D frames are sent: they always are"),
    Id.MOTOR_STATE: Quantity("0 init, 1 on, 2 emergency, 3 off", bounds=(0, 3), writable=True),
    Id.DRIFT_ESTIMATION_ACTIVE: Quantity(
        "whether the gyroscope's drift is being estimated", bounds=_SWITCH, writable=True
    ),
    Id.COMMANDS_PER_SECOND: _rate("commands"),
    Id.LONGEST_COMMAND_GAP: _longest("gap between commands"),
    Id.PACKETS_PER_SECOND: _rate("frames sent, over all ports"),
    Id.LONGEST_PACKET_GAP: _longest("gap between frames sent"),
    Id.CONTROL_STEPS_PER_SECOND: _rate("steps of the controller"),
    Id.LONGEST_CONTROL_PERIOD: _longest("period of the controller"),
    Id.ROBOT_ID: Quantity("which robot this is", bounds=(0, 32767)),
    Id.FIRMWARE_REVISION: Quantity("revision of the firmware", bounds=(0, 32767)),
    Id.FLIGHT_CONTROL_MODE: Quantity("0 near-hovering, 1 direct", bounds=_SWITCH, writable=True),
    Id.PRESSURE: Quantity("raw pressure", "Pa", offset=PRESSURE_OFFSET),
    Id.YAW_RATE: Quantity("yaw rate, about z", "deg/s", 10),
    Id.CRC_ERRORS: Quantity("damaged frames received", bounds=UINT16),
    Id.CONTROL_PERIOD_MIN: _shortest("the controller"),
    Id.ESTIMATION_PERIOD_MIN: _shortest("the estimator"),
    Id.COMMAND_PERIOD_MIN: _shortest("command processing"),
    Id.DATA_PERIOD_MIN: _shortest("sending data"),
    Id.IMU_PERIOD_MIN: _shortest("reading the IMU"),
    Id.ESTIMATION_STEPS_PER_SECOND: _rate("steps of the estimator"),
    Id.SECOND_SERIAL_ENABLED: Quantity("whether the second port is in use", bounds=_SWITCH),
    Id.SECOND_SERIAL_PACKETS_PER_SECOND: _rate("frames sent on the second port"),
    Id.EMERGENCY_THRUST: Quantity(
        "least thrust of the emergency's descent",
        "m g",
        HOVER_THRUST,
        0,
        (THRUST_MIN, HOVER_THRUST),
        True,
    ),
    Id.EMERGENCY_TIMEOUT: Quantity(
        "without commands until the emergency", "ms", bounds=(50, 5000), writable=True
    ),
    Id.PORT_PIN: Quantity("the port's pins", bounds=_BYTE, writable=True),
    Id.THRUST: Quantity("thrust of the controller", "m g", HOVER_THRUST, bounds=(0, 32767)),
    Id.TORQUE_ROLL: Quantity("torque about x", "mN m"),
    Id.TORQUE_PITCH: Quantity("torque about y", "mN m"),
    Id.TORQUE_YAW: Quantity("torque about z", "mN m"),
    Id.MOTOR_REFERENCE_1: _motor("front"),
    Id.MOTOR_REFERENCE_2: _motor("left"),
    Id.MOTOR_REFERENCE_3: _motor("rear"),
    Id.MOTOR_REFERENCE_4: _motor("right"),
}
