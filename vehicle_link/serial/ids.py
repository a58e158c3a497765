"""Numbers of the microcontroller's values and of its states, and its identity.

Source: facts of TeleKyb's MikroKopter interface, listed in docs/boards/microcontroller.md.
"""

from __future__ import annotations

from enum import IntEnum


class Id(IntEnum):
    """The id of a value in a set, a request or a mirror; each value is an int16."""

    ACCELEROMETER_X = 0  # counts of 10 bit
    ACCELEROMETER_Y = 1
    ACCELEROMETER_Z = 2
    GYROSCOPE_X = 3  # counts of 10 bit
    GYROSCOPE_Y = 4
    GYROSCOPE_Z = 5
    ACCELERATION_X = 6
    ACCELERATION_Y = 7
    ACCELERATION_Z = 8
    RATE_X = 9
    RATE_Y = 10
    RATE_Z = 11
    BATTERY = 12  # 0.1 V
    ACCELEROMETER_OFFSET_X = 13
    ACCELEROMETER_OFFSET_Y = 14
    ACCELEROMETER_OFFSET_Z = 15
    GYROSCOPE_DRIFT_X = 16
    GYROSCOPE_DRIFT_Y = 17
    GYROSCOPE_DRIFT_Z = 18
    PITCH = 19
    ROLL = 20
    PITCH_RATE = 21
    ROLL_RATE = 22
    GAIN_P = 23
    GAIN_D = 24
    GAIN_I = 25
    GAIN_YAW_RATE = 26
    GAIN_YAW_ACCELERATION = 27
    YAW_CONTROL_TYPE = 28
    MIRROR_PERIOD = 29
    TIME = 30  # ms modulo 60 s, unsigned
    MIRROR_ACTIVE = 31
    MOTOR_STATE = 32  # a quadrotor.motor_state.MotorState
    DRIFT_ESTIMATION_ACTIVE = 33
    COMMANDS_PER_SECOND = 34
    LONGEST_COMMAND_GAP = 35
    PACKETS_PER_SECOND = 36
    LONGEST_PACKET_GAP = 37
    CONTROL_STEPS_PER_SECOND = 38
    LONGEST_CONTROL_PERIOD = 39
    ROBOT_ID = 40
    FIRMWARE_REVISION = 41
    FLIGHT_CONTROL_MODE = 42  # a FlightControlMode
    PRESSURE = 43  # Pa - 90000
    YAW_RATE = 44
    CRC_ERRORS = 45
    CONTROL_PERIOD_MIN = 46  # 0.1 ms, as the four below
    ESTIMATION_PERIOD_MIN = 47
    COMMAND_PERIOD_MIN = 48
    DATA_PERIOD_MIN = 49
    IMU_PERIOD_MIN = 50
    ESTIMATION_STEPS_PER_SECOND = 51
    SECOND_SERIAL_ENABLED = 52
    SECOND_SERIAL_PACKETS_PER_SECOND = 53
    EMERGENCY_THRUST = 54
    EMERGENCY_TIMEOUT = 55
    PORT_PIN = 56
    THRUST = 57
    TORQUE_ROLL = 58
    TORQUE_PITCH = 59
    TORQUE_YAW = 60
    MOTOR_REFERENCE_1 = 61
    MOTOR_REFERENCE_2 = 62
    MOTOR_REFERENCE_3 = 63
    MOTOR_REFERENCE_4 = 64


class FlightControlMode(IntEnum):
    """Values of Id.FLIGHT_CONTROL_MODE: what the four bytes of a command mean."""

    NEAR_HOVERING = 0  # pitch, roll, yaw rate, thrust
    DIRECT = 1  # four motor references


PRESSURE_OFFSET = 90_000
"""Pa; subtracted from Id.PRESSURE so that it fits 16 bits."""

TIME_PERIOD_MS = 60_000
"""Milliseconds after which Id.TIME wraps around."""

MIRROR = (
    Id.TIME,
    Id.ACCELEROMETER_X,
    Id.ACCELEROMETER_Y,
    Id.ACCELEROMETER_Z,
    Id.GYROSCOPE_X,
    Id.GYROSCOPE_Y,
    Id.GYROSCOPE_Z,
    Id.BATTERY,
    Id.MOTOR_STATE,
    Id.PRESSURE,
)
"""Values in one `D` frame: everything that a tick needs, so that samples are complete."""
