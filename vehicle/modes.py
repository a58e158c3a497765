"""Modes of the vehicle, the allowed transitions between them, and the flags of its status."""

from __future__ import annotations

from enum import IntEnum, IntFlag

from quadrotor.errors import RefusedError


class Mode(IntEnum):
    """The mode of the vehicle as a whole."""

    STARTING = 0  # waiting for still gyroscope samples and a first pose
    READY = 1  # on the ground, motors off
    ARMED = 2  # motors turning, behaviors fly
    EMERGENCY_LAND = 3  # landing; commands other than cut are refused
    CUT = 4  # motors stopped by the emergency cut
    BENCH = 5  # one motor turns on a bench, the vehicle does not fly


LEGAL_MOVES: dict[Mode, frozenset[Mode]] = {
    Mode.STARTING: frozenset({Mode.READY}),
    Mode.READY: frozenset({Mode.ARMED, Mode.STARTING, Mode.BENCH}),
    Mode.ARMED: frozenset({Mode.READY, Mode.EMERGENCY_LAND, Mode.CUT}),
    Mode.EMERGENCY_LAND: frozenset({Mode.READY, Mode.CUT}),
    Mode.CUT: frozenset({Mode.READY}),
    Mode.BENCH: frozenset({Mode.READY, Mode.CUT}),
}

FLYING = (Mode.ARMED, Mode.EMERGENCY_LAND)
"""Modes in which behaviors, or the landing that replaces them, turn the motors."""
MOTORS_ON = (*FLYING, Mode.BENCH)
"""Modes that the status reports as armed."""


def check_move(current: Mode, wanted: Mode) -> None:
    """Raise RefusedError when the table has no such change."""
    if wanted not in LEGAL_MOVES[current]:
        allowed = ", ".join(sorted(m.name.lower() for m in LEGAL_MOVES[current]))
        raise RefusedError(
            f"cannot go from {current.name.lower()} to {wanted.name.lower()}; from here: {allowed}"
        )


class ControlMode(IntEnum):
    """The control mode: which side computes the motor references, and from what."""

    NEAR_HOVERING = 0  # the microcontroller, from the angles, yaw rate and thrust sent to it
    DIRECT = 1  # this vehicle's own controller
    EMERGENCY = 2  # the microcontroller lands on its own and obeys only off


CONTROL_MOVES: dict[ControlMode, frozenset[ControlMode]] = {
    ControlMode.DIRECT: frozenset({ControlMode.NEAR_HOVERING, ControlMode.EMERGENCY}),
    ControlMode.NEAR_HOVERING: frozenset({ControlMode.DIRECT, ControlMode.EMERGENCY}),
    ControlMode.EMERGENCY: frozenset(),  # left only by switching the motors off
}


# For each tick, as the lookup of a member in its class takes 0.15 µs:
STARTING, BENCH = Mode.STARTING, Mode.BENCH
DIRECT, EMERGENCY = ControlMode.DIRECT, ControlMode.EMERGENCY


def check_control_move(current: ControlMode, wanted: ControlMode) -> None:
    """Raise RefusedError when the table has no such change."""
    if wanted is not current and wanted not in CONTROL_MOVES[current]:
        raise RefusedError(
            f"cannot go from {_words(current)} to {_words(wanted)} mode: "
            "the microcontroller lands on its own until the motors are off"
        )


def _words(mode: ControlMode) -> str:
    return mode.name.lower().replace("_", "-")


class Flag(IntFlag):
    """Conditions shown on the page; several may be set at once."""

    NONE = 0
    GYRO_UNCALIBRATED = 1
    NO_POSE = 2  # the pose measurement has timed out
    LINK_DEGRADED = 4
    LINK_LOST = 8
    BATTERY_LOW = 16
    SATURATED = 32  # scaling < 1 in the last tick
    TILT_LIMITED = 64
    NOT_REAL_TIME = 128  # SCHED_FIFO was not granted
    ON_BEARINGS = 256  # flown on bearings to beacons, without the tracker
    FELL_BACK = 512  # back on the tracker by the vehicle's own decision
    MEASUREMENTS_REFUSED = 1024  # too far from their prediction, within the last second
    TRACKER_JUMPED = 2048  # refused poses agree with each other
    ESTIMATE_DRIFTED = 4096  # measurements moved away from the prediction gradually
    BEACON_OFF = 8192  # bearings of one beacon do not fit the others
    RESCUED = 16384  # flown on the shadow: the chosen estimator is inconsistent
    HEADING_UNKNOWN = 32768  # on a marker alone, with too little motion to observe the heading
    TRACKER_CONTRADICTED = 65536  # its poses contradict the inertial sensors and count as missing
    TRACKER_TILTED = 131072  # its vertical is off that of the accelerometer
    AT_BOUND = 262144  # a bias, an integral or an estimate has been at its bound for a second
    INERTIAL_SUSPECT = 524288  # the IMU contradicts witnesses that agree with each other
    OSCILLATING = 1048576  # swings about the reference grow, or go on
    OFF_REFERENCE = 2097152  # far from the reference for half a second
