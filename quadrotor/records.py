"""The records of one tick, as numpy structured types.

Numba reads them by field name, a ring buffer copies them as bytes, and an array of N is a
batch of N vehicles: one definition serves the tick, the log and compiled campaigns.
Frames are in the names: `_w` world (z up), `_b` body (x forward, y left, z up), `_wb`
maps body to world. Units are SI; stamps are integer nanoseconds on the vehicle's clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Record = npt.NDArray[np.void]
"""A structured array, shape (1,) in the tick, (N,) in a batch."""


class Item(Protocol):
    """One record `array[k]` inside compiled code: its fields are attributes, of which numba, and
    not mypy, knows the types.
    """

    def __getattr__(self, field: str) -> Any: ...

    def __setattr__(self, field: str, value: Any) -> None: ...


Numbers = Sequence[float] | npt.NDArray[np.float64]
Ids = npt.NDArray[np.int32]

STATE = np.dtype(
    [
        ("position_w", "f8", 3),  # m
        ("velocity_w", "f8", 3),  # m/s, world axes
        ("quaternion_wb", "f8", 4),  # (w, x, y, z), unit, body to world
        ("angular_velocity_b", "f8", 3),  # rad/s, body axes
    ],
    align=True,
)

REFERENCE = np.dtype(
    [
        ("position_w", "f8", 3),  # m
        ("velocity_w", "f8", 3),  # m/s
        ("acceleration_w", "f8", 3),  # m/s^2
        ("jerk_w", "f8", 3),  # m/s^3
        ("snap_w", "f8", 3),  # m/s^4
        ("yaw", "f8"),  # rad, about z_W
        ("yaw_rate", "f8"),  # rad/s
        ("yaw_acceleration", "f8"),  # rad/s^2
    ],
    align=True,
)

IMU_SAMPLE = np.dtype(
    [
        ("stamp_ns", "i8"),
        ("specific_force_b", "f8", 3),  # m/s^2, +g on z when level and at rest
        ("angular_velocity_b", "f8", 3),  # rad/s
    ],
    align=True,
)

POSE_SAMPLE = np.dtype(
    [
        ("stamp_ns", "i8"),  # when the pose was valid, not when it arrived
        ("position_w", "f8", 3),  # m
        ("quaternion_wb", "f8", 4),  # (w, x, y, z); NO_ATTITUDE for the position of a marker
    ],
    align=True,
)

NO_ATTITUDE = (0.0, 0.0, 0.0, 0.0)
"""Quaternion of a POSE_SAMPLE that is only the position of a single marker."""

MAX_BEACONS = 32
"""Largest number of bearings of one frame in a record."""

BEARINGS_SAMPLE = np.dtype(
    [
        ("stamp_ns", "i8"),  # when the bearings were valid, not when they arrived
        ("count", "i8"),  # number of the rows below in use
        ("sigma", "f8"),  # rad on each of two tangent axes
        ("beacon_w", "f8", (MAX_BEACONS, 3)),  # m
        ("bearing_b", "f8", (MAX_BEACONS, 3)),  # unit, from the body towards the beacon
        ("beacon_id", "i4", MAX_BEACONS),
    ],
    align=True,
)

SWEEP_PLANE = np.dtype(
    [
        ("origin_w", "f8", 3),  # m, of the rotor
        ("quaternion_wr", "f8", 4),  # from the rotor's frame: z is its axis, angles count from x
        ("tilt", "f8"),  # rad, of the plane of light
        ("phase", "f8"),  # rad
        ("gib_magnitude", "f8"),  # rad
        ("gib_phase", "f8"),  # rad
        ("curve", "f8"),  # 1/rad
    ],
    align=True,
)
"""A plane of light that a base station rotates, as in `estimation.sweep_angles`."""

MAX_SENSORS = 16
"""Largest number of sensors of one sweep in a record."""

SWEEPS_SAMPLE = np.dtype(
    [
        ("stamp_ns", "i8"),  # when the plane met the sensors
        ("count", "i8"),  # number of the rows below in use
        ("sigma", "f8"),  # rad
        ("number", "i8"),  # of the plane
        ("plane", SWEEP_PLANE),
        ("sensor_b", "f8", (MAX_SENSORS, 3)),  # m
        ("angle", "f8", MAX_SENSORS),  # rad
    ],
    align=True,
)

READING_SAMPLE = np.dtype(
    [
        ("stamp_ns", "i8"),  # when it was measured
        ("position_w", "f8", 3),  # m, of the vehicle, where the reading is linearised
        ("quaternion_wb", "f8", 4),  # the same
        ("rest", "f8"),  # measured less what is expected there
        ("row", "f8", 6),  # what is expected, by position (1/m) and attitude (1/rad), world axes
        ("sigma", "f8"),  # standard deviation
    ],
    align=True,
)
"""One number that a sensor of the user's own measured, in the sensor's unit."""

OWN_SENSORS = 4
"""Sensors of the user's own that run at a time: each is a process, with a topic of readings."""

JUDGED_READING = np.dtype(
    [
        ("stamp_ns", "i8"),  # when it was measured
        ("place", "i8"),  # of the sensor among those that run, from 1
        ("sensor", "S64"),  # its name
        ("reading", "f8"),  # as measured
        ("residual", "f8"),  # measured less expected
        ("gate", "f8"),  # least residual that is refused; NaN: not judged
        ("deviation", "f8"),  # standard deviation that the sensor states
        ("judgement", "i8"),  # 0 used, 1 refused by the gate, 2 not taken
    ],
    align=True,
)
"""One such number with what a filter made of it, for log and charts, in the sensor's unit."""

ACTUATORS = np.dtype(
    [
        ("wrench", "f8", 4),  # thrust (N), torque about body x, y, z (N m)
        ("thrusts", "f8", 4),  # N, motors front, left, rear, right
        ("motor_references", "f8", 4),  # counts sent to the motor controllers
        ("scaling", "f8"),  # lambda of the saturation rule, 1 = nothing scaled
    ],
    align=True,
)

ESTIMATE = np.dtype(
    [
        ("mass", "f8"),  # kg
        ("mass_variance", "f8"),  # kg^2
        ("accelerometer_bias_b", "f8", 3),  # m/s^2
        ("gyroscope_bias_b", "f8", 3),  # rad/s
        ("position_innovation_w", "f8", 3),  # m
        ("attitude_innovation_b", "f8", 3),  # rad
        ("measurement_age", "f8"),  # s since the newest pose was valid; inf if there was none
        # Measurements since the estimator was reset:
        ("measurements_used", "u4"),
        ("measurements_refused", "u4"),  # by the gate: too far from the prediction
        ("measurements_ignored", "u4"),  # too old, repeated, in the future, or unusable
        ("agreement", "u1"),  # estimation.outcome.Agreement of measurements and estimate
        # For an estimator with a covariance; NaN and 0 for others:
        ("nis", "f8"),  # normalised innovation squared of the newest measurement used
        ("nis_freedom", "i4"),  # its degrees of freedom; 0 when the newest was refused
        ("consistency", "f8"),  # mean of nis / nis_freedom over the last few dozen
        ("refused_share", "f8"),  # of the last few dozen measurements
        # Adapted noise, as a multiple of the deviation stated by the parameters:
        ("accelerometer_noise_scale", "f8"),
        ("gyroscope_noise_scale", "f8"),
        ("measurement_noise_scale", "f8"),  # the largest of positions, attitudes, bearings
        ("position_variance_w", "f8", 3),  # m^2, after the newest measurement
        ("velocity_variance_w", "f8", 3),  # m^2/s^2
        ("attitude_variance_w", "f8", 3),  # rad^2, about the world's axes
    ],
    align=True,
)

STATUS = np.dtype(
    [
        ("mode", "u1"),  # vehicle.modes.Mode
        ("behavior", "u1"),  # index into control.behaviors.table.BehaviorName
        ("armed", "u1"),
        ("airborne", "u1"),
        ("control_mode", "u1"),  # vehicle.modes.ControlMode
        ("flags", "u4"),  # bit set of vehicle.modes.Flag
        ("parameter_revision", "u4"),
        ("tick_rate", "f8"),  # Hz
        ("lateness_p50", "f8"),  # s, over the last second
        ("lateness_p99", "f8"),  # s
        ("lateness_max", "f8"),  # s
        ("missed_share", "f8"),  # periods without a tick, 0..1, over the last second
        ("battery_voltage", "f8"),  # V
        ("pressure", "f8"),  # Pa
        # Since the start of the flight process:
        ("lateness_histogram", "u4", 8),  # ticks; bounds in vehicle.flight.lateness.BOUNDS_NS
        ("overruns", "u4"),  # ticks that took longer than a period
        ("missed_frames", "u4"),  # periods without a sample
        ("damaged_frames", "u4"),  # runs of bytes that were not frames
        ("nominal_rate", "f8"),  # Hz, requested rate of the samples
        # While the flag BEACON_OFF is set:
        ("suspect_offset", "f8"),  # rad, of the beacon's bearings from those expected by the others
        ("suspect_beacon", "i4"),  # its id; -1: it is unclear which
        ("suspect_left_out", "u1"),  # the estimator ignores it
        # The estimator in parallel (`estimation.shadow`):
        ("shadow_lack", "u1"),  # vehicle.estimators.readiness.Lack: what it needs to be flown on
        ("shadow_share", "f8"),  # of the way there, 0..1
        ("shadow_ready", "f8"),  # s since it lacks nothing
        ("shadow_deviation", "f8"),  # m, of its position as it states it; NaN: it does not
        ("shadow_distance", "f8"),  # m, from the estimate in use
        # While the flag OSCILLATING is set:
        ("oscillation_frequency", "f8"),  # Hz
        ("oscillation_axis", "i4"),  # index into vehicle.safety.oscillation.CHANNELS
        # The link to the board over the last second; 0: the board does not tell
        ("board_command_rate", "f8"),  # Hz, commands sent
        ("board_round_trip", "f8"),  # s, mean of its requests or exchanges
        ("board_acknowledged", "f8"),  # share of the packets sent, 0..1
        ("board_retries", "f8"),  # mean of the acknowledged packets
        ("board_waiting", "u4"),  # packets that wait to be sent
    ],
    align=True,
)

TICK = np.dtype(
    [
        ("sequence", "u8"),
        ("imu", IMU_SAMPLE),  # imu.stamp_ns is the time of the whole tick
        ("state", STATE),
        ("reference", REFERENCE),
        ("actuators", ACTUATORS),
        ("estimate", ESTIMATE),
        ("status", STATUS),
    ],
    align=True,
)
"""Everything that one tick measured and decided: the output of the flight process."""


def offset_of(record: np.dtype[np.void], field: str) -> int:
    """Return the offset of a field in a record, in bytes."""
    assert record.fields is not None
    return int(record.fields[field][1])


def new_state() -> Record:
    """Return one state at the origin, level and at rest, shape (1,)."""
    state = np.zeros(1, STATE)
    state["quaternion_wb"][:, 0] = 1.0
    return state


def new_reference() -> Record:
    """Return one reference at the origin, at rest, yaw 0, shape (1,)."""
    return np.zeros(1, REFERENCE)


def pose_sample(stamp_ns: int, position_w: Numbers, quaternion_wb: Numbers) -> Record:
    """Return a POSE_SAMPLE, shape (1,)."""
    sample = np.zeros(1, POSE_SAMPLE)
    sample[0] = stamp_ns, position_w, quaternion_wb
    return sample


def has_attitude(quaternion_wb: npt.ArrayLike) -> bool:
    """Return whether a tracked quaternion is an attitude, not NO_ATTITUDE of a marker."""
    return bool(np.count_nonzero(quaternion_wb))  # np.any takes 4 µs


def bearings_sample(
    stamp_ns: int, beacon_ids: Sequence[int] | Ids, bearings_b: npt.ArrayLike, sigma: float
) -> Record:
    """Return a BEARINGS_SAMPLE without beacon positions, shape (1,), of the first MAX_BEACONS."""
    count = min(len(beacon_ids), MAX_BEACONS)
    sample = np.zeros(1, BEARINGS_SAMPLE)
    sample["stamp_ns"], sample["count"], sample["sigma"] = stamp_ns, count, sigma
    sample["beacon_id"][0, :count] = beacon_ids[:count]
    sample["bearing_b"][0, :count] = np.reshape(bearings_b, (-1, 3))[:count]
    return sample


def beacon_ids_of(sample: Record) -> list[int]:
    """Return the ids in a BEARINGS_SAMPLE (1,), in its order."""
    ids: list[int] = sample["beacon_id"][0, : sample["count"][0]].tolist()
    return ids


def new_tick() -> Record:
    """Return one empty tick record with a valid attitude, shape (1,)."""
    tick = np.zeros(1, TICK)
    tick["state"]["quaternion_wb"][:, 0] = 1.0
    tick["estimate"]["measurement_age"] = np.inf
    return tick
