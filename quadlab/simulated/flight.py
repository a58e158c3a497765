"""The whole stack in simulated time: plant, serial bytes, tick, tracker, beacons and log.

It consists of the same parts as in real time, run in one thread by one clock that starts at 0, so
the same seed gives the same messages byte for byte. It is a `console.experiments.client.Client`
whose waits advance the flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import parse_layout
from bearing_sim.emulator import BearingEmulator, BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker
from console.experiments.client import VehicleView
from estimation.convergence import Convergence
from estimation.estimator import Estimator
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.guide import REQUESTER, SimulatedGuide
from quadlab.simulated.neighbours import Neighbours
from quadlab.simulated.parameters import FlightParameters
from quadlab.simulated.sensors import Source, replacements
from quadlab.simulated.stage_clock import StageClock
from quadrotor.errors import LinkError, MeasurementError, RefusedError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record, bearings_sample, has_attitude, pose_sample
from vehicle import mailbox
from vehicle.boards.kind import Kind
from vehicle.boards.mikrokopter.microcontroller import KIND
from vehicle.comms.bearing_pose import bearing_pose
from vehicle.estimators.measurement_reports import WARN_NS
from vehicle.flight.microcontroller_commands import CommandSender
from vehicle.flight.stack import FlightStack
from vehicle.modes import MOTORS_ON
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.topics.control_inputs import encode_joy

HEARTBEAT_NS = 50_000_000
TRUTH_NS = 10_000_000
SILENT_NS = 10_000_000_000
"""Time without a sample after which a flight ends."""


class SimulatedFlight(SimulatedGuide):
    """One vehicle, flown as fast as the processor allows.

    Args:
        parameters: of vehicle, simulator, tracker and bearings.
        simulated: the robot, made from `parameters.simulator`.
        log: receives every message.
        estimator: a plugin that replaces the vehicle's own.
        plugins: folder of users' control laws and estimators.
        kind: of its board, whose options are `parameters.board` if it has any.
        neighbours: the other vehicles that fly at the same time.
    """

    def __init__(
        self,
        parameters: FlightParameters,
        simulated: SimulatedVehicle,
        log: FlightLog,
        estimator: Estimator | None = None,
        plugins: Path | None = None,
        kind: Kind = KIND,
        neighbours: Neighbours | None = None,
    ) -> None:
        super().__init__(parameters, simulated, log)
        self.parameters, options = parameters, getattr(parameters, "board", None)
        self.stack = FlightStack(
            parameters, estimator=estimator, plugins=plugins, board=kind.traits_with(options)
        )
        self.clock = StageClock()
        self._neighbours = neighbours
        if neighbours is not None:
            neighbours.event = lambda line: self.stack.say(line, mailbox.WARN)
            own = self.stack.state["quaternion_wb"][0]
            neighbours.attitude = lambda: tuple(own.tolist())
        self._board = kind.connect(
            simulated.ports, options, parameters.simulator.imu_rate, lambda: simulated.stamp_ns
        )
        poses, bearings = replacements(parameters, self.stack.state["position_w"][0])
        self._tracker = SimulatedTracker(parameters.tracker)
        self._bearings = BearingEmulator(parameters.bearings)
        self._poses: Source[PoseMeasurement] = poses or self._tracker
        self._sightings: Source[BearingMeasurement] = bearings or self._bearings
        self._sensors = [one for one in (bearings, poses) if one is not None]
        self._beacons = KnownBeacons(parse_layout(parameters.beacons.layout))
        self._sender = CommandSender(self.stack.modes, self._board)
        self._complained_ns = -WARN_NS
        self._next_heartbeat_ns = self._next_station_ns = self._next_truth_ns = 0
        self._heard_ns = simulated.stamp_ns
        # Views made once; they show the plant's current state.
        self._true_position_w = simulated.truth["position_w"][0]
        self._true_quaternion_wb = simulated.truth["quaternion_wb"][0]

    def close(self) -> None:
        """End the log, the stack and the simulated vehicle."""
        for part in (self._log, self.stack, self._simulated):
            part.close()

    # ------------------------------------------------------------------ the client API
    finished = False
    has_pilot = False

    def pilot_flies(self, on: bool) -> None:
        """Raise UsageError: simulated time cannot wait for a pilot."""
        raise UsageError("flying by hand is impossible in simulated time; play sticks from a file")

    def view(self) -> VehicleView:
        stack = self.stack
        return VehicleView(
            time=stack.stamp_ns * 1e-9,
            mode=stack.mode.name.lower(),
            behavior=stack.behaviors.name.name.lower(),
            armed=stack.mode in MOTORS_ON,
            airborne=stack.ground.airborne,
            position_w=stack.state["position_w"][0].copy(),
            mass=stack.estimate["mass"].item(),
            mass_deviation=math.sqrt(stack.estimate["mass_variance"].item()),
        )

    def arm(self) -> None:
        self._command(mailbox.Arm(self._request_id(), REQUESTER))

    def start(self, behavior: str, **arguments: ParameterValue) -> None:
        request = mailbox.StartBehavior(self._request_id(), REQUESTER, behavior, arguments)
        self._command(request)

    def change(self, values: dict[str, ParameterValue]) -> None:
        """Set vehicle parameters. Raises RefusedError with the vehicle's reason."""
        self._command(mailbox.ChangeParameters(self._request_id(), REQUESTER, values))
        if any(name.startswith("simulator.") for name in values):
            self._simulated.configure(self.parameters.simulator)

    def parameter(self, name: str) -> ParameterValue:
        """Return a parameter's value. Raises UnknownParameterError."""
        return self.stack.store.get(name)

    def sticks(self, axes: Sequence[float]) -> None:
        forward, left, up, yaw = (float(axis) for axis in axes)
        stamp_ns, held = self.stack.stamp_ns, (forward, left, up, yaw)
        self.stack.measure(mailbox.Joy(stamp_ns, held, True))
        self._log.put("joy", encode_joy(stamp_ns, held, True), stamp_ns, stamp_ns)

    def wait_until(
        self, condition: Callable[[VehicleView], bool], *, what: str, timeout: float
    ) -> None:
        end_ns = self.stack.stamp_ns + round(timeout * 1e9)
        while not condition(self.view()):
            if self.stack.stamp_ns >= end_ns:
                raise RefusedError(
                    f"timed out after {timeout:g} s waiting for {what}; the vehicle is "
                    f"{self.view().mode}, {self.view().behavior}"
                )
            for _ in range(5):
                self.advance()

    def wait(self, seconds: float) -> None:
        end_ns = self.stack.stamp_ns + round(seconds * 1e9)
        while self.stack.stamp_ns < end_ns:
            self.advance()

    # ------------------------------------------------------------------ one IMU period
    def advance(self) -> None:
        """Advance everything by one IMU period, in the order of the real processes.

        Raises LinkError for a board that sends no samples: time, which they count, would stop.
        """
        stack, board, log = self.stack, self._board, self._log
        lap = self.clock.begin()
        self._simulated.step()
        if self._neighbours is not None:
            self._neighbours.step()
        self._after_step()
        lap("simulated robot")
        samples = board.receive()
        if samples:
            self._heard_ns = self._simulated.stamp_ns
        elif self._simulated.stamp_ns - self._heard_ns > SILENT_NS:
            why = board.obstacle or "the simulated board is silent"
            raise LinkError(f"no sample for {SILENT_NS * 1e-9:g} s: {why}")
        self._sender.service(self._simulated.stamp_ns * 1e-9)
        lap("serial")
        for sample in samples:
            command = stack.tick(sample)
            lap("tick")
            self._sender.send(command)
            lap("serial")
            log.tick(stack.record)
            if stack.own_sensors.externals:
                log.readings(stack.readings)
            self._after_tick(stack.record)
            if stack.outbox:
                self._drain_outbox()
            lap("log")
            if (now_ns := self._simulated.stamp_ns) >= self._next_station_ns:
                self._station(now_ns)  # a radio's samples are older than the truth
                lap("station")

    def _station(self, now_ns: int) -> None:
        """Send what the base station sends: heartbeat, tracked poses, bearings."""
        if now_ns >= self._next_heartbeat_ns:
            self._next_heartbeat_ns = now_ns + HEARTBEAT_NS
            self.stack.measure(mailbox.Heartbeat(now_ns))
        if now_ns >= self._next_truth_ns:
            self._next_truth_ns = now_ns - now_ns % TRUTH_NS + TRUTH_NS
            position_w, quaternion_wb = self._true_position_w, self._true_quaternion_wb
            self._poses.observe(now_ns, position_w, quaternion_wb)
            self._sightings.observe(now_ns, position_w, quaternion_wb)
            self._log.truth(now_ns, self._simulated.truth)
        for pose in self._poses.due(now_ns):
            self.stack.measure(pose_sample(pose.stamp_ns, pose.position_w, pose.quaternion_wb))
            if has_attitude(pose.quaternion_wb):
                self._pose = pose
            self._log.pose(pose.stamp_ns, pose.position_w, pose.quaternion_wb, now_ns)
        for frame in self._sightings.due(now_ns):
            self._log.bearings(frame, now_ns)
            seen = bearings_sample(frame.stamp_ns, frame.beacon_ids, frame.bearings_b, frame.sigma)
            self.stack.measure(seen)
            self._solve(seen, now_ns)
        for sensor in self._sensors:
            for topic, stamp_ns, jpeg in sensor.shown():
                self._log.picture(topic, stamp_ns, jpeg, now_ns)
            for line in sensor.said():
                self.stack.say(f"tracker: {line}", mailbox.WARN)
        self._next_station_ns = now_ns - now_ns % TRUTH_NS + TRUTH_NS
        for arrival_ns in (self._poses.next_ns, self._sightings.next_ns):
            if arrival_ns is not None and arrival_ns < self._next_station_ns:
                self._next_station_ns = arrival_ns

    def _solve(self, seen: Record, now_ns: int) -> None:
        try:
            payload = bearing_pose(seen, self._beacons, self.stack.state)
        except MeasurementError as error:
            if now_ns - self._complained_ns > WARN_NS:  # may occur 30 times a second
                self._complained_ns = now_ns
                self.stack.say(f"bearings: {error}", mailbox.WARN)
            return
        self._log.put("bearing_pose", payload, int(seen["stamp_ns"][0]), now_ns)

    def _drain_outbox(self) -> None:
        for message in self.stack.outbox:
            if isinstance(message, mailbox.Event):
                self._log.event(message)
            elif isinstance(message, mailbox.GyroscopeFound):
                self._gyroscope(message)
            else:
                self._log.parameter_change(message)
                if message.name == "beacons.layout":
                    self._beacons = KnownBeacons(parse_layout(str(message.new)))
        self.stack.outbox.clear()


class TrueState:
    """Estimator plugin that copies the simulator's state; corrections are ignored."""

    initialized = True
    measurement_age = 0.0
    stale = False
    converged = True
    convergence = Convergence(True, "the true state")
    deviations = None

    def __init__(self, simulated: SimulatedVehicle) -> None:
        self._truth = simulated.truth

    def configure(self, parameters: object) -> None: ...

    def reset(self) -> None: ...

    def initialize(self, pose: object) -> None: ...

    def predict(self, imu: object, dt: float, state: Record) -> None:
        state[:] = self._truth

    def correct(self, pose: object, estimate: object) -> None: ...

    def correct_bearings(self, bearings: object, estimate: object) -> None: ...

    def warnings(self, rate: float) -> list[str]:
        return []

    def report(self, estimate: Record) -> None:
        estimate["measurement_age"] = 0.0
