"""Guided procedures in simulated time: the hand that holds the vehicle, the bench, the
confirmations.

`quadlab.simulated.flight.SimulatedFlight` inherits it and keeps flying during them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from bearing_sim.pose_measurement import PoseMeasurement
from console.experiments.readings import BenchReadings, ImuReadings, Progress, TrackedAttitude
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import TICK, Record
from quadrotor.rotations import euler_from_quaternion
from vehicle import mailbox
from vehicle.calibration.gyroscope_record import gyroscope_record
from vehicle.flight.stack import FlightStack
from vehicle.modes import Mode
from vehicle.simulator.force_sensor import ForceReading
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.topics.bench_readings import encode_bench_reading

REQUESTER = "experiment"
TRACKED_NS = 100_000_000
"""Age, in ns, above which a pose of the tracker is not used."""
BENCH_AGAIN_NS = 100_000_000
KEPT = 60_000
"""Largest number of unread ticks or readings."""
PATIENCE = 30.0
"""Seconds to wait for the gyroscope's calibration, and for setting the vehicle down."""


class SimulatedGuide:
    """A simulated person, tracker and force/torque sensor.

    Attributes:
        progress: the newest progress.
        on_progress: called with each reported progress.
    """

    simulated = True
    stack: FlightStack

    def __init__(
        self, parameters: FlightParameters, simulated: SimulatedVehicle, log: FlightLog
    ) -> None:
        self.progress: Progress | None = None
        self.on_progress: Callable[[Progress], None] = lambda _: None
        self._flown, self._simulated, self._log = parameters, simulated, log
        self._ticks: deque[bytes] | None = None
        self._readings: deque[ForceReading] = deque(maxlen=KEPT)
        self._pose: PoseMeasurement | None = None
        self._bench: tuple[int, int] | None = None
        self._bench_due_ns = 0
        self._found: dict[str, mailbox.GyroscopeFound] = {}
        self._requests = 0

    def wait(self, seconds: float) -> None:
        raise NotImplementedError

    # ------------------------------------------------------------------ the client API
    def tell(self, progress: Progress) -> None:
        self.progress = progress
        self.on_progress(progress)

    def confirm(self, question: str) -> None:
        """Confirm at once; the log has a line about it."""
        self.stack.say(f"confirmed: {question}")

    def turn(self, quaternion_wb: Sequence[float] | None) -> None:
        """Turn the vehicle; with None set it down level, and wait until it is at rest."""
        if quaternion_wb is None:
            self._simulate({"simulator.held": "free"})
            end = self.stack.stamp_ns + round(PATIENCE * 1e9)
            while self._simulated.held and self.stack.stamp_ns < end:
                self.wait(0.1)
            return
        angles = np.degrees(euler_from_quaternion(np.array(quaternion_wb, dtype=np.float64)))
        roll, pitch, yaw = angles.tolist()
        self._simulate(
            {
                "simulator.held": "hand",
                "simulator.hand_roll": roll,
                "simulator.hand_pitch": pitch,
                "simulator.hand_yaw": yaw,
            }
        )

    def imu(self) -> ImuReadings:
        """Return the IMU readings since the last call; the first call starts collecting and returns
        none.
        """
        kept = self._ticks or ()
        ticks = np.frombuffer(b"".join(kept), TICK)
        self._ticks = deque(maxlen=KEPT)
        imu, actuators = ticks["imu"], ticks["actuators"]
        return ImuReadings(
            imu["stamp_ns"] * 1e-9,
            imu["specific_force_b"],
            imu["angular_velocity_b"],
            actuators["motor_references"],
            actuators["wrench"],
        )

    def tracked(self) -> TrackedAttitude | None:
        pose = self._pose
        if pose is None or self.stack.stamp_ns - pose.stamp_ns > TRACKED_NS:
            return None
        return TrackedAttitude(pose.stamp_ns * 1e-9, pose.quaternion_wb)

    def calibrate_gyroscope(self) -> CalibrationRecord:
        """Calibrate the gyroscope. Raises RefusedError with the vehicle's reason."""
        request_id = self._request_id()
        self._command(mailbox.CalibrateGyroscope(request_id, REQUESTER))
        end = self.stack.stamp_ns + round(PATIENCE * 1e9)
        while (found := self._found.get(request_id)) is None:
            if self.stack.stamp_ns > end:
                raise RefusedError(f"no drift of the gyroscope was found in {PATIENCE:g} s")
            self.wait(0.01)
        if found.reason:
            raise RefusedError(found.reason)
        return gyroscope_record(found)

    def bench(self, motor: int, reference: int) -> None:
        if motor:
            self._simulate({"simulator.held": "bench"})
        self._command(mailbox.Bench(self._request_id(), REQUESTER, motor, reference, secured=True))
        self._bench = (motor, reference) if motor else None
        self._bench_due_ns = self.stack.stamp_ns + BENCH_AGAIN_NS
        if not motor:
            self._simulate({"simulator.held": "free"})

    def bench_readings(self) -> BenchReadings:
        rows = [(r.stamp_ns * 1e-9, r.force, r.torque, r.speed) for r in self._readings]
        self._readings.clear()
        table = np.array(rows).reshape(-1, 4)
        return BenchReadings(table[:, 0], table[:, 1], table[:, 2], table[:, 3])

    # ------------------------------------------------------------------ while it flies
    def _after_step(self) -> None:
        """Read the sensor, and repeat the command for the bench when it is due."""
        reading = self._simulated.bench_reading()
        if reading is not None:
            self._readings.append(reading)
            payload = encode_bench_reading(
                reading.stamp_ns, reading.force, reading.torque, reading.speed
            )
            self._log.put("bench_reading", payload, reading.stamp_ns, reading.stamp_ns)
        if self._bench is not None and self.stack.stamp_ns >= self._bench_due_ns:
            if self.stack.mode is not Mode.BENCH:
                self._bench = None
                raise RefusedError(
                    f"the vehicle has ended the bench; it is {self.stack.mode.name.lower()}"
                )
            self.bench(*self._bench)

    def _after_tick(self, record: Record) -> None:
        if self._ticks is not None:
            self._ticks.append(record.tobytes())

    def _gyroscope(self, found: mailbox.GyroscopeFound) -> None:
        self._found[found.request_id] = found

    def _simulate(self, values: dict[str, ParameterValue]) -> None:
        """Change the simulator's parameters; the log gets the changes."""
        store, outbox = self.stack.store, self.stack.outbox
        old = {name: store.get(name) for name in values}
        for name, value in store.set(values).items():
            if value != old[name]:
                outbox.append(
                    ParameterChange(
                        stamp_ns=self.stack.stamp_ns,
                        name=name,
                        old=old[name],
                        new=value,
                        requester=REQUESTER,
                        revision=store.revision,
                    )
                )
        if any(value != old[name] for name, value in values.items()):
            self._simulated.configure(self._flown.simulator)

    def _command(self, command: mailbox.Command) -> None:
        reply = self.stack.handle(command)
        if not reply.accepted:
            raise RefusedError(reply.reason, reply.kind)

    def _request_id(self) -> str:
        self._requests += 1
        return str(self._requests)
