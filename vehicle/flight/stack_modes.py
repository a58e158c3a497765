"""Mode changes of the flight stack: arming to off, who turns what into motor references, and what
the vehicle does by its own decision.
"""

from __future__ import annotations

from control.behaviors.ground import stand
from control.behaviors.table import BehaviorName
from quadrotor.errors import QuadlabError
from vehicle.flight.modes import ControlMode, Mode, check_control_move, check_move
from vehicle.flight.stack_parts import StackParts
from vehicle.microcontroller.microcontroller import RawSample
from vehicle.processes import mailbox
from vehicle.safety.supervisor import Reaction, Verdict
from vehicle_link.serial.ids import FlightControlMode, MotorState

MOTOR_START_GRACE_NS = 1_500_000_000
_BRAKING = (BehaviorName.LAND, BehaviorName.BRAKE, BehaviorName.EMERGENCY_LANDING)


class StackModes(StackParts):
    """The modes of the flight stack, and the moves from a cause to the mode it leads to."""

    @property
    def flight_control_mode(self) -> FlightControlMode:
        """Return how the microcontroller is to read what `tick` returns."""
        if self.control_mode is ControlMode.NEAR_HOVERING:
            return FlightControlMode.NEAR_HOVERING
        return FlightControlMode.DIRECT

    @property
    def command_timeout_ms(self) -> int:
        """Return silence of commands after which the microcontroller is to land alone."""
        return round(1000 * self.parameters.safety.command_timeout)

    def move(self, mode: Mode, why: str, level: int = mailbox.INFO) -> None:
        """Change the mode by the table of vehicle.flight.modes and say so. Raises RefusedError."""
        check_move(self.mode, mode)
        self.mode = mode
        if mode in (Mode.ARMED, Mode.BENCH):
            self.motor_state_wanted = MotorState.ON
            self._armed_ns = self._stamp_ns
        if mode is Mode.ARMED:
            self.ground.arm(float(self.state["position_w"][0, 2]))
            self.supervisor.begin_flight()
            self.guard.begin_flight()
            self.mass.begin_flight()
        elif mode in (Mode.READY, Mode.CUT):
            self.motor_state_wanted = MotorState.OFF
            self.control_mode = ControlMode.DIRECT
            self.ground.disarm()
            self.bench.end()
            self.behaviors.reset()
            self.controller.reset()
        self.say(f"{mode.name.lower().replace('_', ' ')}: {why}", level)

    def steer_by(self, control_mode: ControlMode) -> None:
        """Change who turns what into motor references. Raises RefusedError."""
        if control_mode is self.control_mode:
            return
        check_control_move(self.control_mode, control_mode)
        self.control_mode = control_mode
        if control_mode is ControlMode.DIRECT:
            self.controller.reset()
        self.say(f"{control_mode.name.lower().replace('_', '-')} mode")

    def react(self, verdict: Verdict) -> None:
        """Carry out what the supervisor found due; a milder reaction than the present one waits."""
        reaction, why = verdict.reaction, verdict.reason
        if reaction is Reaction.CUT:
            self.move(Mode.CUT, why, mailbox.ERROR)
        elif self.control_mode is ControlMode.EMERGENCY:
            return  # the microcontroller lands alone: nothing else is obeyed
        elif reaction is Reaction.EMERGENCY:
            self.hand_over(why)
        elif reaction is Reaction.DESCEND:
            self.descend_now(why)
        elif reaction is Reaction.LAND:
            if self.mode is Mode.ARMED:
                self.land_now(why)
        elif self.behaviors.name not in _BRAKING:
            # Its inertial sensors are good enough to stop by, not to land by.
            age = self.navigation.active.measurement_age
            if age <= self.parameters.safety.pose_land_after:
                self._override("brake")
                self.say(f"braking: {why}", mailbox.WARN)
            else:
                self.descend_now(f"{why}, and no pose to brake by")

    def land_now(self, why: str) -> None:
        """Land under control from here, refusing everything but cut; without a pose, descend."""
        if not self.has_pose:
            self.descend_now(why)
            return
        self._enter_emergency(why)
        self._override("land")

    def descend_now(self, why: str) -> None:
        """Descend level by the barometer; the microcontroller holds the angles."""
        if self.control_mode is ControlMode.EMERGENCY:
            return
        self._enter_emergency(f"{why}; down by the barometer, not held in place")
        self._override("emergency_landing")

    def hand_over(self, why: str) -> None:
        """Hand over to the microcontroller, which lands alone."""
        if self.control_mode is ControlMode.EMERGENCY:
            return
        self._enter_emergency(f"{why}; the microcontroller lands alone")
        self.motor_state_wanted = MotorState.EMERGENCY
        self.steer_by(ControlMode.EMERGENCY)

    def _enter_emergency(self, why: str) -> None:
        if self.mode is Mode.EMERGENCY_LAND:
            self.say(f"emergency land: {why}", mailbox.ERROR)
        else:
            self.move(Mode.EMERGENCY_LAND, why, mailbox.ERROR)

    def _override(self, behavior: str) -> None:
        """Start `behavior` by the vehicle's own decision; the table allows it from any flight."""
        try:
            self.behaviors.request(behavior, {}, self.state, armed=True, airborne=True)
        except QuadlabError as error:  # never seen; no one else would land it then
            self.hand_over(f"{behavior} refused: {error}")

    # ------------------------------------------------------------------ the microcontroller's word
    def heed(self, sample: RawSample) -> None:
        """Act on what the microcontroller reports of its motors, while they should turn."""
        started = self._stamp_ns - self._armed_ns > MOTOR_START_GRACE_NS
        state = sample.motor_state
        if self.control_mode is ControlMode.EMERGENCY:
            if state == MotorState.OFF:
                self.ground.touch_down(self._stamp_ns)
                self.move(Mode.READY, "landed by the microcontroller")
        elif state == MotorState.EMERGENCY:
            self.hand_over("the microcontroller took over: commands were missing, or the battery")
        elif started and state != MotorState.ON:
            name = MotorState(state).name.lower()
            why = f": {self.obstacle}" if self.obstacle else ""
            self.move(Mode.CUT, f"microcontroller reports motors {name}{why}", mailbox.ERROR)

    def _rest(self) -> None:
        stand(self.state, self.reference)
        self.actuators[...] = self._off
