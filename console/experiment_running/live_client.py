"""The client API of experiments over the station's link, guided procedures included."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from console.experiment_running.live_bench import LiveBench
from console.experiment_running.live_commands import LOOK, TRIES, LiveCommands, Services
from console.experiment_running.readings_feed import ReadingsFeed
from console.experiment_running.simulated_hand import SimulatedHand
from console.experiment_running.vehicle import VehicleFeed
from console.experiments.client import ExperimentEndedError
from console.experiments.readings import BenchReadings, ImuReadings, Progress, TrackedAttitude
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import QuadlabError, RefusedError

if TYPE_CHECKING:
    from console.experiment_running.runner import ExperimentRunner

GYROSCOPE_TIMEOUT = 6.0
"""s for the vehicle's gyroscope calibration."""
BENCH_CALL = 0.25
"""s for an answer about the bench: short enough to repeat the request before the motor stops."""
BENCH_TIMEOUT = 0.5
"""s, the vehicle's timeout of the bench when it does not report its own."""
MOTORS, COUNTS = 4, 255


class LiveClient(LiveCommands):
    """The `console.experiments.client.Client` of one running experiment."""

    def __init__(
        self,
        services: Services,
        feed: VehicleFeed,
        readings: ReadingsFeed,
        hand: SimulatedHand,
        runner: ExperimentRunner,
        requester: str,
    ) -> None:
        super().__init__(services, feed, runner, requester)
        self._readings, self._hand = readings, hand
        self._yes = threading.Event()
        self._is_recorded = self._needs_imu = False
        self._bench = LiveBench(
            self._ask_bench,
            self._end_bench,
            self._bench_timeout,
            lambda: feed.mode,
            lambda: self._last_check,
        )

    # ------------------------------------------------------------------ from other threads
    def end(self, why: QuadlabError, *, taken_over: bool = False, patience: float = 0.0) -> None:
        self._bench.give_up()
        super().end(why, taken_over=taken_over, patience=patience)

    @property
    def has_begun(self) -> bool:
        """Return whether the experiment has done anything, on the ground or in the air."""
        return self.armed or self._is_recorded

    def confirmed(self) -> None:
        """Confirm the question on behalf of a person."""
        self._yes.set()

    # ------------------------------------------------------------------ guided procedures
    @property
    def simulated(self) -> bool:
        return self._hand.is_there

    def tell(self, progress: Progress) -> None:
        self._check()
        self._recorded()
        self._runner.tell(progress)

    def confirm(self, question: str) -> None:
        self._check()
        self._recorded()
        self._yes.clear()
        self._runner.ask(question)
        try:
            while not self._yes.wait(LOOK):
                self._check()
                if self.finished:
                    raise ExperimentEndedError("it was finished before the question was answered")
        finally:
            self._runner.ask("")

    def turn(self, quaternion_wb: Sequence[float] | None) -> None:
        self._check()
        self._hand.turn(quaternion_wb, self.requester)

    def imu(self) -> ImuReadings:
        self._check()
        self._recorded()
        self._needs_imu = True
        return self._readings.imu()

    def tracked(self) -> TrackedAttitude | None:
        self._check()
        self._recorded()
        return self._readings.tracked()

    def calibrate_gyroscope(self) -> CalibrationRecord:
        self._recorded()
        self._runner.step("calibrating the gyroscope")
        self._runner.asked("calibrate", self.requester)
        response = self._call("calibrate", action="gyroscope", timeout=GYROSCOPE_TIMEOUT)
        if not response.records:
            raise RefusedError("the vehicle calibrated its gyroscope but reported no result")
        return parse_record(str(response.records[0]))

    def bench(self, motor: int, reference: int) -> None:
        self._check()
        self._recorded()
        if not 0 <= motor <= MOTORS or not 0 <= reference <= COUNTS:
            raise RefusedError(
                f"motor {motor} at {reference} counts: allowed are motors 1 to {MOTORS}, 0 to end "
                f"the bench, and 0 to {COUNTS} counts"
            )
        if motor and not self._bench.is_on:
            self._hand.fix(self.requester)
        self._bench.set(motor, reference)
        if not motor:
            self._hand.let_go(self.requester)

    def bench_readings(self) -> BenchReadings:
        self._check()
        self._recorded()
        return self._readings.bench_readings()

    # ------------------------------------------------------------------ after the end
    def close(self) -> list[str]:
        """Leave the vehicle in a safe state in any case: no motor on the bench, and nothing holds a
        simulated vehicle.

        Returns a list of problems.
        """
        self._bench.close()
        problems = []
        try:
            self._hand.let_go(self.requester)
        except RefusedError as error:
            problems.append(str(error))
        lost = self._readings.end()
        if lost and self._needs_imu:
            problems.append(f"{lost} packets of telemetry were lost during the measurement")
        return problems

    def _recorded(self) -> None:
        """Record from the first guided step on, even on the ground and disarmed."""
        if not self._is_recorded:
            self._runner.record()
            self._readings.begin()  # only readings that are in the run's file are used
            self._is_recorded = True

    def _ask_bench(self, motor: int, reference: int) -> None:
        with self._sending:
            if self._ended is not None:
                raise self._ended
            self._services["bench"].ask(
                self.requester, timeout=BENCH_CALL, motor=motor, reference=reference, secured=True
            )

    def _end_bench(self) -> None:
        """End the bench in any case: this only stops a motor, which the vehicle would do by itself,
        too.
        """
        with suppress(QuadlabError):
            self._services["bench"].ask(
                self.requester, timeout=BENCH_CALL, tries=TRIES, motor=0, reference=0, secured=True
            )

    def _bench_timeout(self) -> float:
        try:
            return float(self._feed.parameter("safety.bench_timeout"))
        except QuadlabError:
            return BENCH_TIMEOUT

    def _check(self) -> None:
        super()._check()
        problem, self._bench.problem = self._bench.problem, None
        if problem is not None:
            raise problem
