"""The CRTP messages of the Crazyflie that are used, and its axes and signs.

Its body axes are ours (x forward, y left, z up), and so are the signs of its IMU, in g and deg/s.
Of its angles and rates, which are in degrees, **pitch has the other sign**: nose up is positive, in
set-points and in `stateEstimate`. Yaw and yaw rate of the generic set-points are ours (the older
set-points of port 3, which are not used here, have the yaw rate inverted). Thrust is 0 to 65535,
linear in force with the firmware's battery compensation. Positions are in its world frame, which
the poses sent to it make ours.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Generator
from enum import IntFlag

import msgspec

from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.crtp.packets import CrtpPort, Packet
from quadrotor.records import Record
from vehicle.boards.board import BodyRates
from vehicle_link.serial.attitude_command import AttitudeCommand

OLDEST, NEWEST = 12, 13
"""Versions of CRTP: the one whose layouts were checked, and the next, which stays compatible."""
THRUST_FULL = 65535
ACCELEROMETER_SCALE = 24.0 / 32768.0
"""Scale, in g, of the counts that an acceleration in g is rounded to: the sensor's own."""
GYROSCOPE_SCALE = 2000.0 / 32768.0
"""Scale, in deg/s."""
PASCAL = 100.0
"""Pa in the unit of `baro.pressure`, the millibar."""

VERSION = 1  # channel of PLATFORM
TOC, READ, WRITE, MISC = 0, 1, 2, 3  # channels of PARAMETERS
CONTROL, DATA = 1, 2  # channels of LOG, whose TOC has channel 0
INFO, COMMAND = 0, 1  # channels of SUPERVISOR
GET_ITEM, GET_INFO = 2, 3
LOG_RESET, LOG_CREATE, LOG_START = 5, 6, 8
ARM, EMERGENCY_STOP = 1, 3
POSE = 8
STOP, MANUAL = 0, 11
SETPOINT = struct.Struct("<BfffHB")
"""MANUAL, roll, pitch, yaw rate, thrust, 1 if roll and pitch are rates: with the mode in each
packet, no board that was switched on again takes rates for angles."""
ITEM = struct.Struct("<BH")
TOC_INFO = struct.Struct("<BHI")
POSE_DATA = struct.Struct("<B7f")
PARAMETER_TYPES = {8: "B", 9: "H", 10: "I", 11: "Q", 0: "b", 1: "h", 2: "i", 3: "q", 6: "f", 7: "d"}
LOG_TYPES = {1: "B", 2: "H", 3: "I", 4: "b", 5: "h", 6: "i", 7: "f"}
TYPE_BITS, READ_ONLY = 0x0F, 0x40
"""Bits of a type; of the others, this one tells that a parameter is read-only."""


class Info(IntFlag):
    """Bits of `supervisor.info`."""

    CAN_ARM = 1
    ARMED = 2
    AUTO_ARMED = 4
    CAN_FLY = 8
    FLYING = 16
    TUMBLED = 32
    LOCKED = 64
    CRASHED = 128


class Block(msgspec.Struct, frozen=True):
    """One block of log variables."""

    number: int
    period_ms: int
    names: tuple[str, ...]


IMU = Block(0, 10, ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z"))
STATUS = Block(1, 20, ("baro.pressure", "pm.vbat", "supervisor.info"))
ESTIMATE = Block(2, 100, ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z"))
BLOCKS = IMU, STATUS, ESTIMATE


class Request(msgspec.Struct, frozen=True):
    """A packet that is sent until it is answered.

    Attributes:
        repeated: number of bytes of data that the answer repeats.
    """

    packet: Packet
    repeated: int = 1

    def is_answered_by(self, packet: Packet) -> bool:
        sent, n = self.packet, self.repeated
        same = (packet.port, packet.channel) == (sent.port, sent.channel)
        return same and packet.data[:n] == sent.data[:n]


Dialogue = Generator[Request, bytes, None]
"""Requests, each of which is given the data of its answer."""


def setpoint(command: BodyRates | AttitudeCommand, options: CrazyflieOptions) -> Packet:
    """Return the set-point of a command; its thrust is limited to the possible."""
    thrust = round(THRUST_FULL * min(1.0, max(0.0, command.thrust / options.thrust_max)))
    if isinstance(command, BodyRates):
        roll, pitch, yaw_rate = command.rates_b
    else:
        roll, pitch, yaw_rate = command.roll, command.pitch, command.yaw_rate
    degrees = math.degrees(roll), -math.degrees(pitch), math.degrees(yaw_rate)
    is_rate = isinstance(command, BodyRates)
    return Packet(CrtpPort.SETPOINT, 0, SETPOINT.pack(MANUAL, *degrees, thrust, is_rate))


STOPPED = Packet(CrtpPort.SETPOINT, 0, bytes((STOP,)))
EMERGENCY_STOPPED = Packet(CrtpPort.SUPERVISOR, COMMAND, bytes((EMERGENCY_STOP,)))
"""The request to stop, and to stay locked until it is switched off and on."""


def arm(on: bool) -> Packet:
    """Return the request to arm or disarm; disarming stops the motors in the air, too."""
    return Packet(CrtpPort.SUPERVISOR, COMMAND, bytes((ARM, on)))


def pose(state: Record) -> Packet:
    """Return the pose of a STATE (1,) for its estimator."""
    w, *ijk = state["quaternion_wb"][0].tolist()
    data = POSE_DATA.pack(POSE, *state["position_w"][0].tolist(), *ijk, w)
    return Packet(CrtpPort.LOCALIZATION, 1, data)


def imu_counts(values: tuple[float, ...]) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Return accelerometer and gyroscope as counts of the values of the block IMU."""
    x, y, z, p, q, r = values
    a, g = ACCELEROMETER_SCALE, GYROSCOPE_SCALE
    return (round(x / a), round(y / a), round(z / a)), (round(p / g), round(q / g), round(r / g))
