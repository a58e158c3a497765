"""The law of motor, controller and propeller on a force/torque sensor (Sec. 5.3).

The references of a schedule are held one after the other, with a rest at low speed before each; or
a file recorded elsewhere is read. The affine root law, the paper's quadratic for comparison, the
torque ratio and the lag are fitted.
"""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path

from console.evaluation.bench_file import read_bench_file
from console.evaluation.motor_bench import (
    TIME_CONSTANT_ERROR_MAX,
    TORQUE_MISS_MAX,
    WORST_MAX,
    Battery,
    BenchResult,
    from_file,
    from_log,
    record_of,
)
from console.evaluation.verdict import judged
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import wait_ready
from console.experiments.readings import BenchReadings, Progress
from estimation.calibration.motor_bench import SETTLING, BenchSchedule
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.constants import MOTORS
from quadrotor.errors import MeasurementError, QuadlabError, RefusedError, UsageError
from quadrotor.parameters import Parameters, parameter

LOOK = 0.1
SILENCE = 1.0
"""Seconds without a reading after which the sensor counts as unplugged."""
QUESTION = (
    "Is the vehicle fixed on the bench, the {motor} motor on the sensor, and its propeller's blast "
    "clear of people and loose things? It will run up to {last} counts"
)


class MotorBenchOptions(Parameters):
    """Options: motor, references and durations, or a file."""

    motor: int = parameter(1, ge=1, le=4, step=1)
    """1 front, 2 left, 3 rear, 4 right: the one on the sensor"""
    first: int = parameter(30, unit="count", ge=20, le=150, step=5)
    """the first reference"""
    last: int = parameter(190, unit="count", ge=40, le=200, step=5)
    """the last reference, about"""
    step: int = parameter(10, unit="count", ge=1, le=50, step=1)
    """from one reference to the next"""
    hold: float = parameter(
        5.0,
        unit="s",
        ge=1.5,
        le=60.0,
        step=0.5,
        description=f"of each reference; its first {SETTLING:g} s do not count",
    )
    rest: float = parameter(10.0, unit="s", ge=0.5, le=120.0, step=0.5)
    """at low speed before each, so that the motor does not overheat"""
    rest_reference: int = parameter(25, unit="count", ge=10, le=60, step=1)
    """while it rests"""
    csv: str = parameter("")
    """a recorded file instead, with the columns time_s, reference, force_N, torque_Nm and, with a
    tachometer, speed; no motor turns then"""


class MotorBench:
    """Runs the schedule; judged on how well the law fits, and how well the lag is known."""

    name = "motor_bench"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = MotorBenchOptions()
        self._vehicle = vehicle
        self._started = math.nan  # s, vehicle clock
        self._battery = Battery()
        self._simulated = False

    @property
    def planned(self) -> float:
        return 2.0 if self.parameters.csv else 3.0 + self._schedule.duration

    @property
    def _schedule(self) -> BenchSchedule:
        p = self.parameters
        return BenchSchedule(p.first, p.last, p.step, p.hold, p.rest, p.rest_reference)

    def check(self) -> None:
        """Raise UsageError for inconsistent references, StorageError or MeasurementError for an
        unusable file.
        """
        p = self.parameters
        if p.csv:
            read_bench_file(Path(p.csv))
        elif p.last < p.first + 4 * p.step:
            raise UsageError(
                f"experiment.first={p.first} to experiment.last={p.last} in steps of {p.step} are "
                f"{len(self._schedule.references)} references, a law needs 5; "
                "use smaller steps"
            )

    # ------------------------------------------------------------------ the procedure
    def fly(self, client: Client) -> None:
        """Run the schedule. Raises RefusedError with the vehicle's reason, or when the sensor stops
        sending.
        """
        p = self.parameters
        self.check()
        wait_ready(client)
        self._simulated = client.simulated
        self._battery = Battery.of(client.parameter)
        if p.csv:
            client.tell(Progress(f"Reading {Path(p.csv).name}; no motor turns", 1, 1, 1.0))
            client.wait(0.5)
            return
        question = QUESTION.format(motor=MOTORS[p.motor - 1], last=self._schedule.references[-1])
        client.confirm(question)
        client.bench_readings()
        try:
            self._run(client)
        finally:
            with suppress(QuadlabError):  # the reason for the end matters more
                client.bench(0, 0)
        client.wait(0.5)

    def _run(self, client: Client) -> None:
        schedule, motor = self._schedule, self.parameters.motor
        turned = schedule.rest_reference
        client.bench(motor, turned)
        self._started = last_reading_at = client.view().time
        newest: BenchReadings | None = None
        while (into := client.view().time - self._started) < schedule.duration:
            if client.finished:
                break
            wanted = round(schedule.reference(into))
            if wanted != turned:
                turned = wanted
                client.bench(motor, turned)
            readings = client.bench_readings()
            if len(readings.time):
                newest, last_reading_at = readings, client.view().time
            elif client.view().time - last_reading_at > SILENCE:
                raise RefusedError(
                    f"the force/torque sensor sends nothing for {SILENCE:g} s (topic "
                    "bench_reading); the motor is stopped. Plug it in, then begin again"
                )
            client.tell(self._progress(schedule, into, turned, newest))
            ahead = (schedule.hold + schedule.rest) - into % (schedule.hold + schedule.rest)
            if ahead > schedule.hold:
                ahead -= schedule.hold
            client.wait(min(LOOK, max(ahead, 0.002)))

    def _progress(
        self, schedule: BenchSchedule, into: float, turned: int, newest: BenchReadings | None
    ) -> Progress:
        index, done = divmod(into, schedule.hold + schedule.rest)
        wanted = schedule.references[min(int(index), len(schedule.references) - 1)]
        holding = done >= schedule.rest
        doing = f"Holding {wanted} counts" if holding else f"Resting before {wanted} counts"
        live = {"reference": (float(turned), "count")}
        if newest is not None:
            live["force"] = (float(newest.force.mean()), "N")
            live["torque"] = (float(newest.torque.mean()), "N m")
            if math.isfinite(speed := float(newest.speed.mean())):
                live["speed"] = (speed, "")
        return Progress(
            f"{doing}; keep away from the propeller",
            int(index) + 1,
            len(schedule.references),
            done / (schedule.hold + schedule.rest),
            live,
        )

    # ------------------------------------------------------------------ the log
    def evaluate(self, log: Path) -> Result:
        """Judge the motor law. Raises LogFormatError, StorageError, or MeasurementError with what
        is missing.
        """
        found = self._found(log)
        law, lag = found.law, found.lag
        torque_miss = law.torque_residual / max(float(abs(law.steps.torque).max()), 1e-9)
        metrics = {
            "root_law_worst_count": law.root.worst,
            "root_law_rms_count": law.root.rms,
            "quadratic_worst_count": law.quadratic.worst,
            "quadratic_rms_count": law.quadratic.rms,
            "torque_miss_share": torque_miss,
            "time_constant_s": lag.seconds,
            "time_constant_error_share": lag.error / lag.seconds,
            "dead_time_s": found.dead_time,
            "thrust_min_N": law.thrust_min,
            "thrust_max_N": law.thrust_max,
            "steps": float(len(law.steps.reference)),
        }
        limits = {
            "root_law_worst_count": WORST_MAX,
            "torque_miss_share": TORQUE_MISS_MAX,
            "time_constant_error_share": TIME_CONSTANT_ERROR_MAX,
        }
        return judged(metrics, limits)

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the record of the motor law. Raises as `evaluate` does."""
        p = self.parameters
        conditions = {"motor": MOTORS[p.motor - 1]}
        if p.csv:
            conditions["source"] = Path(p.csv).name
        else:
            conditions["vehicle"] = "simulated" if self._simulated else "real"
            conditions["hold"], conditions["rest"] = f"{p.hold:g} s", f"{p.rest:g} s"
        return record_of(self._found(log), conditions)

    def _found(self, log: Path) -> BenchResult:
        p = self.parameters
        if p.csv:
            return from_file(read_bench_file(Path(p.csv)))
        if math.isnan(self._started):
            raise MeasurementError("no motor was turned, so there is nothing to identify")
        return from_log(log, self._vehicle, p.motor, self._schedule, self._started, self._battery)
