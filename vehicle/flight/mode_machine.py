"""Mode changes of the flight stack: from arming to motors off, the control mode, and the vehicle's
own decisions.
"""

from __future__ import annotations

from dataclasses import dataclass

from control.behaviors.machine import BehaviorMachine
from control.behaviors.table import BehaviorName
from quadrotor.errors import QuadlabError
from quadrotor.motor_state import MotorState
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.boards.board import MotorReferences, RawSample
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.motor_bench import Bench
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.modes import EMERGENCY, ControlMode, Mode, check_control_move, check_move
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.parameters import SafetyParameters
from vehicle.safety.supervisor import Reaction, Supervisor, Verdict
from vehicle_link.commands import EventKind

_ON, _TAKEN_OVER = MotorState.ON, MotorState.EMERGENCY
MOTOR_START_GRACE_NS = 1_500_000_000
_BRAKING = (BehaviorName.LAND, BehaviorName.BRAKE, BehaviorName.EMERGENCY_LANDING)


@dataclass(kw_only=True, eq=False)
class ModeMachine:
    """The modes of one vehicle, and the transitions that events cause.

    Attributes:
        mode: the mode of the vehicle as a whole; changed by `move`.
        control_mode: which side computes the motor references, and from what; changed by
            `set_control_mode`.
        motor_state_wanted: the motor state that the microcontroller should have.
        lost_ports: number of lost serial ports in the last report.
        obstacle: why the microcontroller would not start the motors; "" if it would.
    """

    safety: SafetyParameters
    tick: TickRecord
    outbox: Outbox
    behaviors: BehaviorMachine
    law: ControlLaw
    navigation: Navigation
    ground: GroundContact
    supervisor: Supervisor
    mass: FlownMass
    guard: BearingsGuard
    bench: Bench
    reports_pressure: bool = True
    mode: Mode = Mode.STARTING
    control_mode: ControlMode = ControlMode.DIRECT
    motor_state_wanted: MotorState = MotorState.OFF
    lost_ports: int = 0
    obstacle: str = ""
    _armed_ns: int = 0

    @property
    def motors_had_time(self) -> bool:
        """Return whether motors that were switched on should be turning by now."""
        return self.tick.stamp_ns - self._armed_ns > MOTOR_START_GRACE_NS

    @property
    def command_timeout(self) -> float:
        """Return the s without commands after which the microcontroller lands on its own."""
        return self.safety.command_timeout

    @property
    def located(self) -> Record | None:
        """Return the STATE (1,) that the estimator found by poses, None without them."""
        return self.tick.state if self.navigation.has_pose else None

    def microcontroller_reports(self, lost_ports: int, obstacle: str) -> None:
        """Store the microcontroller's report on its ports and on the conditions that prevent a
        motor start.
        """
        self.lost_ports, self.obstacle = lost_ports, obstacle

    def move(self, mode: Mode, why: str, level: int = mailbox.INFO, *kinds: EventKind) -> None:
        """Change the mode by the table of vehicle.modes and log it. Raises RefusedError."""
        check_move(self.mode, mode)
        self.mode = mode
        if mode in (Mode.ARMED, Mode.BENCH):
            self.motor_state_wanted = MotorState.ON
            self._armed_ns = self.tick.stamp_ns
        if mode is Mode.ARMED:
            self.ground.arm(float(self.tick.state["position_w"][0, 2]))
            self.supervisor.begin_flight()
            self.guard.begin_flight()
            self.mass.begin_flight()
        elif mode in (Mode.READY, Mode.CUT):
            self.motor_state_wanted = MotorState.OFF
            self.control_mode = ControlMode.DIRECT
            self.ground.disarm()
            self.bench.end()
            self.behaviors.reset()
            self.law.controller.reset()
        self.outbox.say(f"{mode.name.lower().replace('_', ' ')}: {why}", level, *kinds)

    def set_control_mode(self, control_mode: ControlMode) -> None:
        """Change which side computes the motor references. Raises RefusedError."""
        if control_mode is self.control_mode:
            return
        check_control_move(self.control_mode, control_mode)
        self.control_mode = control_mode
        if control_mode is ControlMode.DIRECT:
            self.law.controller.reset()
        self.outbox.say(f"{control_mode.name.lower().replace('_', '-')} mode")

    # ------------------------------------------------------------------ the vehicle's own decisions
    def react(self, verdict: Verdict) -> None:
        """Carry out the supervisor's reaction; a milder one than the present one is ignored."""
        reaction, why = verdict.reaction, verdict.reason
        if reaction is Reaction.CUT:
            self.move(Mode.CUT, why, mailbox.ERROR)
        elif self.control_mode is ControlMode.EMERGENCY:
            return  # the microcontroller lands on its own and obeys nothing else
        elif reaction is Reaction.EMERGENCY:
            self.hand_over(why)
        elif reaction is Reaction.DESCEND:
            self.descend(why)
        elif reaction is Reaction.LAND:
            if self.mode is Mode.ARMED:
                self.land(why)
        elif self.behaviors.name not in _BRAKING:
            # The inertial sensors are good enough to stop by, not to land by.
            age = self.navigation.active.measurement_age
            if age <= self.safety.pose_land_after:
                self._override("brake")
                self.outbox.say_braking(why)
            else:
                self.descend(f"{why}, and no pose to brake with")

    def land(self, why: str) -> None:
        """Land under control from here, refusing everything but cut; without a pose, descend."""
        if not self.navigation.has_pose:
            self.descend(why)
            return
        self._enter_emergency(why)
        self._override("land")

    def descend(self, why: str) -> None:
        """Descend level by the barometer, with the microcontroller holding the angles.

        Without the barometer's pressure the board lands on its own.
        """
        if self.control_mode is ControlMode.EMERGENCY:
            return
        if not self.reports_pressure:
            self.hand_over(f"{why}; the board reports no air pressure to descend by")
            return
        self._enter_emergency(f"{why}; descending by the barometer, position not held")
        self._override("emergency_landing")

    def hand_over(self, why: str) -> None:
        """Leave the landing to the microcontroller."""
        if self.control_mode is ControlMode.EMERGENCY:
            return
        self._enter_emergency(f"{why}; the microcontroller lands on its own")
        self.motor_state_wanted = MotorState.EMERGENCY
        self.set_control_mode(ControlMode.EMERGENCY)

    def follow_motor_state(self, sample: RawSample) -> None:
        """React to the motor state that the microcontroller reports while motors should turn."""
        state = sample.motor_state
        if self.control_mode is EMERGENCY:
            if state == MotorState.OFF:
                self.ground.touch_down(self.tick.stamp_ns)
                self.move(Mode.READY, "landed by the microcontroller")
        elif state == _TAKEN_OVER:
            self.hand_over("the microcontroller took over: commands were missing, or the battery")
        elif state != _ON and self.motors_had_time:
            name, obstacle = MotorState(state).name.lower(), self.obstacle
            why = f": {obstacle}" if obstacle else ""
            self.move(Mode.CUT, f"microcontroller reports motors {name}{why}", mailbox.ERROR)

    def step_bench(self, sample: RawSample, dt: float) -> MotorReferences | None:
        """Return the references of one tick in mode BENCH, None when the test is over."""
        bench, tick = self.bench, self.tick
        tick.rest()
        why = bench.fault(
            sample, self.supervisor.battery_spent, self.motors_had_time, self.obstacle
        ) or bench.over(tick.stamp_ns, tick.angular_velocity_b, dt)
        if why:
            self.move(Mode.READY, f"{bench} stopped: {why}", mailbox.WARN)
            return None
        tick.motor_references[bench.motor - 1] = bench.reference
        return bench.references

    def _enter_emergency(self, why: str) -> None:
        if self.mode is Mode.EMERGENCY_LAND:
            self.outbox.say(f"emergency land: {why}", mailbox.ERROR)
        else:
            self.move(Mode.EMERGENCY_LAND, why, mailbox.ERROR)

    def _override(self, behavior: str) -> None:
        """Start `behavior` by the vehicle's own decision; allowed from any flight behavior."""
        try:
            self.behaviors.request(behavior, {}, self.tick.state, armed=True, airborne=True)
        except QuadlabError as error:  # never observed; nothing else would land the vehicle
            self.hand_over(f"{behavior} refused: {error}")
