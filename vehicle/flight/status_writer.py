"""The STATUS part of the tick's record."""

from __future__ import annotations

from quadrotor.records import Record
from vehicle.flight.lateness import LoopCounts, LoopStatistics
from vehicle.flight.modes import MOTORS_ON, ControlMode, Flag, Mode

_ROW = ("mode", "behavior", "armed", "airborne", "control_mode", "flags")
_SUSPECT = ("suspect_beacon", "suspect_offset", "suspect_left_out")
# As plain numbers: an IntFlag costs half a microsecond an operation.
_GYRO_UNCALIBRATED, _NO_POSE = int(Flag.GYRO_UNCALIBRATED), int(Flag.NO_POSE)
_SATURATED, _TILT_LIMITED = int(Flag.SATURATED), int(Flag.TILT_LIMITED)
_NOT_REAL_TIME = int(Flag.NOT_REAL_TIME)


class StatusWriter:
    """Writes what changed; the fields that change at each tick through views made once.

    Args:
        status: STATUS of shape (1,), part of the tick's record.
    """

    def __init__(self, status: Record) -> None:
        self.real_time = True
        self._status = status
        self._voltage, self._pressure = status["battery_voltage"], status["pressure"]
        self._written: tuple[int, ...] = ()
        self._suspect: tuple[int, float, bool] | None = None

    def loop(self, statistics: LoopStatistics, counts: LoopCounts, rate: float) -> None:
        """Write what the loop measured of itself; `rate` (Hz) as it is meant to be."""
        status = self._status
        status["tick_rate"], status["nominal_rate"] = statistics.rate, rate
        status["missed_share"] = statistics.missed_share
        status["lateness_p50"] = statistics.lateness_p50
        status["lateness_p99"] = statistics.lateness_p99
        status["lateness_max"] = statistics.lateness_max
        status["lateness_histogram"] = counts.lateness
        status["overruns"] = counts.overruns
        status["missed_frames"] = counts.missed_frames
        status["damaged_frames"] = counts.damaged_frames

    def write(
        self,
        *,
        mode: Mode,
        control_mode: ControlMode,
        behavior: int,
        airborne: bool,
        supervisor_flags: Flag,
        estimate_flags: int,
        suspect: tuple[int, float, bool],
        stale_pose: bool,
        saturated: bool,
        tilt_limited: bool,
        voltage: float,
        pressure: float,
    ) -> None:
        """Write the status, once a tick.

        Args:
            suspect: id, mean offset (rad) of a beacon that is off, whether it is left out.
            voltage: V. pressure: Pa.
        """
        self._voltage[0], self._pressure[0] = voltage, pressure
        flags = int(supervisor_flags) | estimate_flags
        if mode is Mode.STARTING:
            flags |= _GYRO_UNCALIBRATED
        if stale_pose:
            flags |= _NO_POSE
        if saturated:
            flags |= _SATURATED
        if airborne and tilt_limited:
            flags |= _TILT_LIMITED
        if not self.real_time:
            flags |= _NOT_REAL_TIME
        row = (mode, behavior, mode in MOTORS_ON, airborne, control_mode, flags)
        if row != self._written:
            self._written = row
            for field, value in zip(_ROW, row, strict=True):
                self._status[field] = value
        if suspect != self._suspect:
            self._suspect = suspect
            for field, number in zip(_SUSPECT, suspect, strict=True):
                self._status[field] = number
