"""The state of a vehicle's motors, in the words of all boards."""

from enum import IntEnum


class MotorState(IntEnum):
    """The state of the motors as a board reports it; the numbers equal those of Id.MOTOR_STATE on
    the serial line.
    """

    INIT = 0
    ON = 1
    EMERGENCY = 2  # commands were missing, so the board took over
    OFF = 3
