"""Motor states of the microcontroller and the transitions that may be requested."""

from __future__ import annotations

from vehicle_link.serial.ids import Id, MotorState

ALLOWED = {
    MotorState.INIT: frozenset({MotorState.INIT, MotorState.OFF}),
    MotorState.ON: frozenset({MotorState.ON, MotorState.INIT, MotorState.OFF}),
    MotorState.EMERGENCY: frozenset({MotorState.EMERGENCY, MotorState.ON}),
    MotorState.OFF: frozenset(MotorState),
}
"""States from which each may be set: off from all (the cut), and from emergency only off."""

WRITABLE = frozenset(
    {
        Id.ACCELEROMETER_OFFSET_X,
        Id.ACCELEROMETER_OFFSET_Y,
        Id.ACCELEROMETER_OFFSET_Z,
        Id.GAIN_P,
        Id.GAIN_D,
        Id.GAIN_I,
        Id.GAIN_YAW_RATE,
        Id.GAIN_YAW_ACCELERATION,
        Id.YAW_CONTROL_TYPE,
        Id.MIRROR_PERIOD,
        Id.MIRROR_ACTIVE,
        Id.DRIFT_ESTIMATION_ACTIVE,
        Id.FLIGHT_CONTROL_MODE,
        Id.CONTROL_PERIOD_MIN,
        Id.ESTIMATION_PERIOD_MIN,
        Id.COMMAND_PERIOD_MIN,
        Id.DATA_PERIOD_MIN,
        Id.IMU_PERIOD_MIN,
        Id.EMERGENCY_THRUST,
        Id.EMERGENCY_TIMEOUT,
        Id.PORT_PIN,
    }
)
"""Values that may be set besides the motor state; a set of another id is echoed unchanged."""

LIMITS = {
    Id.FLIGHT_CONTROL_MODE: (0, 1),
    Id.EMERGENCY_TIMEOUT: (50, 5000),  # ms
    Id.EMERGENCY_THRUST: (28, 110),
    Id.MIRROR_PERIOD: (1000, 20_000),  # us
}
"""Bounds of the values that have any."""
