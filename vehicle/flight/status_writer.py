"""Write the STATUS field of the tick's record."""

from __future__ import annotations

from dataclasses import dataclass

from control.behaviors.machine import BehaviorMachine
from estimation.parameters import EstimationParameters
from quadrotor.motor_state import MotorState
from vehicle.boards.board import RawSample
from vehicle.boards.board_link import LinkStatistics
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.rescue import Rescue
from vehicle.estimators.tracker_integrity import TrackerIntegrity
from vehicle.flight.bounds_watch import BoundsWatch
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.lateness import LoopCounts, LoopStatistics
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.tick_record import TickRecord
from vehicle.modes import EMERGENCY, MOTORS_ON, STARTING, Flag
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.oscillation import OscillationWatch
from vehicle.safety.supervisor import Supervisor

_ROW = ("mode", "behavior", "armed", "airborne", "control_mode", "flags")
_SUSPECT = ("suspect_beacon", "suspect_offset", "suspect_left_out")
_SHADOW = tuple(f"shadow_{name}" for name in ("lack", "share", "ready", "deviation", "distance"))
# Plain numbers, as an IntFlag costs half a microsecond per operation.
_GYRO_UNCALIBRATED, _NO_POSE = int(Flag.GYRO_UNCALIBRATED), int(Flag.NO_POSE)
_SATURATED, _TILT_LIMITED = int(Flag.SATURATED), int(Flag.TILT_LIMITED)
_NOT_REAL_TIME = int(Flag.NOT_REAL_TIME)


@dataclass(kw_only=True, eq=False)
class StatusWriter:
    """Writer of the status: changed fields, and by stored views those that always change."""

    estimation: EstimationParameters
    tick: TickRecord
    modes: ModeMachine
    behaviors: BehaviorMachine
    navigation: Navigation
    law: ControlLaw
    supervisor: Supervisor
    guard: BearingsGuard
    rescue: Rescue
    integrity: TrackerIntegrity
    ground: GroundContact
    bounds: BoundsWatch
    oscillation: OscillationWatch

    def __post_init__(self) -> None:
        self._real_time = True
        self._control_mode = self.modes.control_mode
        self._status = status = self.tick.status
        self._voltage, self._pressure = status["battery_voltage"], status["pressure"]
        self._written: tuple[int, ...] = ()
        self._suspect: tuple[int, float, bool] | None = None
        self._shadow: tuple[float, ...] = ()
        self._oscillated = False

    def loop(
        self, statistics: LoopStatistics, counts: LoopCounts, rate: float, real_time: bool
    ) -> None:
        """Write the loop's own statistics; `rate` (Hz) is the nominal one."""
        self._real_time = real_time
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

    def link(self, statistics: LinkStatistics) -> None:
        """Write the statistics of the link to the board."""
        status = self._status
        status["board_command_rate"] = statistics.command_rate
        status["board_round_trip"] = statistics.round_trip
        status["board_acknowledged"] = statistics.acknowledged
        status["board_retries"] = statistics.retries
        status["board_waiting"] = statistics.waiting

    def write(self, sample: RawSample, pose_age: float) -> None:
        """Write the status, once a tick.

        Args:
            pose_age: s since the newest measurement that was used in time.
        """
        self._voltage[0], self._pressure[0] = sample.battery_voltage, sample.pressure
        mode, control_mode = self.modes.mode, self.modes.control_mode
        # An emergency is reported once the microcontroller confirms it, as operators wait for that.
        if control_mode is not EMERGENCY or sample.motor_state != MotorState.ON:
            self._control_mode = control_mode
        navigation, airborne = self.navigation, self.ground.airborne
        flags = self.supervisor.flags | self.guard.flags | self.rescue.flags
        flags |= navigation.agreement.flags | navigation.suspect.flags | navigation.heading.flags
        flags |= self.integrity.flags
        flags |= self.bounds.flags | self.oscillation.flags
        if mode is STARTING:
            flags |= _GYRO_UNCALIBRATED
        if pose_age > self.estimation.measurement_timeout:
            flags |= _NO_POSE
        if self.tick.saturated:
            flags |= _SATURATED
        if airborne and self.law.controller.tilt_limited:
            flags |= _TILT_LIMITED
        if not self._real_time:
            flags |= _NOT_REAL_TIME
        behavior, suspect = self.behaviors.name, navigation.suspect.status
        row = (mode, behavior, mode in MOTORS_ON, airborne, self._control_mode, flags)
        if row != self._written:
            self._written = row
            for field, value in zip(_ROW, row, strict=True):
                self._status[field] = value
        if self.oscillation.flags or self._oscillated:
            self._oscillated = bool(self.oscillation.flags)
            self._status["oscillation_frequency"] = self.oscillation.frequency
            self._status["oscillation_axis"] = self.oscillation.memory["channel"]
        if suspect != self._suspect:
            self._suspect = suspect
            for field, number in zip(_SUSPECT, suspect, strict=True):
                self._status[field] = number
        if navigation.shadowed.status is not self._shadow:
            self._shadow = navigation.shadowed.status
            for field, figure in zip(_SHADOW, self._shadow, strict=True):
                self._status[field] = figure
