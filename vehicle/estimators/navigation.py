"""The estimators of one vehicle: the one in use, a shadow, a reserve on the tracker's poses.

`vehicle.estimators.choice` decides when one may take over. During flight on bearings the reserve
continues with the tracker's poses, so that a fallback takes one tick, and
`vehicle.estimators.bearings_watch` judges the innovations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import PAPER_BEACONS, Beacons
from estimation.estimator import Estimator, TakesHeading
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError, UndeterminedStartError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import POSE_SAMPLE, Record, beacon_ids_of
from vehicle import mailbox
from vehicle.estimators.agreement_watch import AgreementWatch
from vehicle.estimators.bearings_watch import BearingsWatch
from vehicle.estimators.choice import ESTIMATOR, SHADOW, Choice, EstimatorSet, check
from vehicle.estimators.estimator_runner import BEARINGS, POSES, Runner
from vehicle.estimators.estimators import Estimators
from vehicle.estimators.external import ExternalEstimator
from vehicle.estimators.fade import Fade
from vehicle.estimators.frame_inspection import inspected
from vehicle.estimators.heading_watch import HeadingWatch
from vehicle.estimators.measurement_reports import MeasurementReports
from vehicle.estimators.readiness import ShadowWatch
from vehicle.estimators.suspect_beacon import SuspectBeacon
from vehicle.parameters import FallBackParameters


class Navigation:
    """Runs the estimators on their measurements and provides the estimate in use.

    Args:
        parameters: parameters of the estimation, read again by each `configure`.
        say: takes a line for the log and its level.
        plugin: replaces the estimator that the parameters name, until another name is set.
        beacons: the positions of the bearings' ids.
        fallback: parameters of the fallback from bearings to the tracker.
        estimators: those there are.

    Attributes:
        running: the running estimators.
        externals: those of them that are plugins with a process.
        active: the estimator in use.
        source: its source: "poses", "bearings" or "both".
        agreement: reports whether measurements agree with it.
        heading: reports an unknown heading.
        suspect: reports a beacon whose bearings are off.
        shadowed: judges whether the shadow may take over.
        measured: whether the last step had measurements.
    """

    def __init__(
        self,
        parameters: EstimationParameters,
        say: Callable[[str, int], None],
        plugin: Estimator | None = None,
        beacons: Beacons = PAPER_BEACONS,
        fallback: FallBackParameters | None = None,
        estimators: Estimators | None = None,
    ) -> None:
        p = self._parameters = parameters
        self._estimators = estimators or Estimators()
        self.watch = BearingsWatch(fallback or FallBackParameters())
        self.agreement = AgreementWatch(say)
        self.heading = HeadingWatch(say)
        self.suspect = SuspectBeacon(say)
        self.shadowed = ShadowWatch()
        self.measured = False
        self._fade = Fade()
        self._refuses_bearings = False
        self._say = say
        self._queue: list[Record] = []
        self._timely = -(1 << 62), 0.0
        self._reports = MeasurementReports(say)
        self._choice: Choice | None = None
        self.externals: tuple[ExternalEstimator, ...] = ()
        if plugin is None:
            for name, value in ((ESTIMATOR, p.estimator), (SHADOW, p.shadow)):
                self._estimators.check(name, value)
            self.running = EstimatorSet(self._make(p.estimator, p.source))
        else:
            self.running = EstimatorSet(Runner(p.estimator, p.source, plugin, plugged=True))
        self.place(beacons)
        self.configure(p)

    @property
    def shadow(self) -> Estimator | None:
        runner = self.running.shadow
        return None if runner is None else runner.estimator

    @property
    def shadow_on_same_source(self) -> Runner | None:
        """Return the shadow if it has the measurements of the estimator in use."""
        shadow = self.running.shadow
        return shadow if shadow is not None and shadow.source == self.source else None

    @property
    def has_pose(self) -> bool:
        """Return whether the estimator in use has a fresh measurement."""
        return not self.active.stale

    def measurement_age(self, now_ns: int) -> float:
        """Return the seconds since the newest measurement that was used in time, called in each
        tick. Measurements used when they are older than `measurement_timeout` do not count,
        however many come: an estimate that rests on them may not be flown on for long.
        """
        age = self.active.measurement_age
        if age <= self._parameters.measurement_timeout:
            self._timely = now_ns, age
            return age
        then_ns, timely = self._timely
        return max(age, timely + 1e-9 * (now_ns - then_ns))

    # ------------------------------------------------------------------ the tick
    def step(self, imu: Record, dt: float, state: Record, estimate: Record) -> None:
        """Predict by one sample, apply the measurements since the last one, and write STATE and
        ESTIMATE.
        """
        active = self.active
        active.predict(imu, dt, state)
        if self._fade.on:
            self._fade.step(dt, state)
        for runner in self._in_parallel:
            self._step_parallel(runner, imu, dt)
        if self.source != POSES:
            reserve = self.running.reserve
            tracked = None if reserve is None else reserve.state
            self.watch.remember(imu["stamp_ns"].item(), state, tracked)
        measured = self.measured = bool(self._queue)
        if measured:
            self._apply_measurements(imu["stamp_ns"].item(), state, estimate)
        active.report(estimate)
        if measured:
            self.agreement.check(estimate, imu["stamp_ns"].item())
            self.heading.check(estimate)
        if self.agreement.flags:
            self.agreement.step(imu["stamp_ns"].item())
        if (shadow := self.running.shadow) is not None:
            try:
                self.shadowed.step(imu["stamp_ns"].item(), shadow, self.running.active, state)
            except Exception as error:
                self._drop(shadow, error)

    def measure(self, measurement: Record) -> None:
        """Take one POSE_SAMPLE, or BEARINGS_SAMPLE without places, (1,); it acts at the next
        step.
        """
        if measurement.dtype == POSE_SAMPLE:
            if self._takes_poses:
                self._queue.append(self._parameters.tracker.measured(measurement))
        elif self._takes_bearings and not self._refuses_bearings:
            frame = self._beacons.with_positions(measurement)
            if frame["count"][0]:
                self._queue.append(frame)
            elif ids := beacon_ids_of(measurement):
                self._reports.unknown_beacons(ids, self._beacons.ids)

    def refuse_bearings(self) -> None:
        """Use no more bearings until another estimator or source is chosen."""
        self._refuses_bearings = True

    def take_over(self, state: Record) -> None:
        """Write the STATE of the estimator in use, which was the shadow until now, from the one
        written before without a jerk.
        """
        now = self.running.active.state
        self._fade.begin(state, now)
        state[...] = now
        if self._fade.on:
            self._fade.step(0.0, state)

    def take_heading(self) -> None:
        """Have filters that run on a marker alone take the heading stated: the vehicle is armed."""
        for runner in self.running.all():
            if isinstance(runner.estimator, TakesHeading):
                runner.estimator.take_heading()

    def reset(self) -> None:
        """Reset all estimators: the gyroscope was calibrated again."""
        for runner in self.running.all():
            runner.estimator.reset()

    def close(self) -> None:
        """End the processes of plugins."""
        for external in self.externals:
            external.close()

    # ------------------------------------------------------------------ choices
    def check(
        self, values: Mapping[str, ParameterValue], state: Record, armed: bool
    ) -> dict[str, ParameterValue]:
        """Return the parameters that a change implies; see `choice.check`. Raises RefusedError."""
        for name in values.keys() & {ESTIMATOR, SHADOW}:
            self._estimators.check(name, str(values[name]))
        return check(self.running, self._parameters, values, state, armed)

    def place(self, beacons: Beacons) -> None:
        """Set the beacons' positions; estimators in parallel that used others are reset."""
        self._beacons = KnownBeacons(beacons)
        for runner in self.running.in_parallel():
            if runner.source != POSES:
                runner.estimator.reset()

    def configure(self, parameters: EstimationParameters) -> None:
        """Apply the present parameters; `check` has accepted the choices."""
        p = self._parameters = parameters
        choice = Choice.of(p.estimator, p.source, p.shadow, p.shadow_source, p.rescue)
        before = str(self.running.active)
        if choice != self._choice:  # a failed shadow is not recreated by an unrelated change
            self._choice = choice
            self.running = self.running.rearranged(choice, self._make)
            self.shadowed.begin()
        running = self.running
        self.active, self.source = running.active.estimator, running.active.source
        if str(running.active) != before:
            self._refuses_bearings = False
            self.watch.begin()
            self.suspect.begin()
            self.agreement.begin()
            self._say(f"estimator {running.active}", mailbox.INFO)
        for runner in running.all():
            runner.estimator.configure(p)
        self._note_running()
        self._timeout_ns = round(1e9 * p.measurement_timeout)
        self._reports.restart()

    # ------------------------------------------------------------------ parts
    def _make(self, name: str, source: str) -> Runner:
        return self._estimators.start(name, source, self._parameters)

    def _note_running(self) -> None:
        runners, before = self.running.all(), self.externals
        found = [one.estimator for one in runners if isinstance(one.estimator, ExternalEstimator)]
        self.externals = tuple(found)
        for external in found:
            external.flown = external is self.running.active.estimator
        for external in before:
            if external not in found:
                external.close()
        self._in_parallel = self.running.in_parallel()
        self._takes_poses = any(one.source != BEARINGS for one in runners)
        self._takes_bearings = any(one.source != POSES for one in runners)

    def _apply_measurements(self, now_ns: int, state: Record, estimate: Record) -> None:
        runner = self.running.active
        for measurement in self._queue:
            mine: Record | None = measurement
            if self.source != POSES:
                mine = inspected(measurement, self.running, self.watch, self.suspect, state, now_ns)
            if mine is not None and runner.wants(mine, now_ns, self._timeout_ns):
                try:
                    runner.correct(mine, estimate)
                except MeasurementError as error:
                    self._reports.unusable(str(error), now_ns)
                else:
                    self._reports.used(now_ns, self.active)
            for other in self._in_parallel:
                self._correct_parallel(other, measurement, now_ns, state)
        self._queue.clear()
        # A restart of the one in use is reported by `agreement`.
        news = [each.unused(now_ns) for each in self.running.all()]
        for line in (*news, *(each.restarts(now_ns) for each in self._in_parallel)):
            if line is not None:
                self._say(line, mailbox.WARN)

    def _step_parallel(self, runner: Runner, imu: Record, dt: float) -> None:
        try:
            runner.estimator.predict(imu, dt, runner.state)
        except Exception as error:
            self._drop(runner, error)

    def _correct_parallel(
        self, runner: Runner, measurement: Record, now_ns: int, state: Record
    ) -> None:
        try:
            if runner.wants(measurement, now_ns, self._timeout_ns):
                runner.correct(measurement, runner.estimate)
        except UndeterminedStartError as error:
            if self.active.converged:  # then the vehicle's pose is known
                runner.start_at(now_ns, state)
                self._say(f"{runner} started at the pose of {self.running.active}", mailbox.INFO)
            else:
                self._reports.unusable(str(error), now_ns)
        except MeasurementError as error:
            if runner.source != self.source:  # else reported for the estimator in use
                self._reports.unusable(f"{runner}: {error}", now_ns)
        except Exception as error:
            self._drop(runner, error)

    def _drop(self, runner: Runner, error: Exception) -> None:
        """Drop an estimator that is not in use: an error in it must not end the flight."""
        running = self.running
        what = "shadow" if runner is running.shadow else "reserve"
        setattr(running, what, None)
        self.shadowed.begin()
        self._note_running()
        is_plugin = isinstance(runner.estimator, ExternalEstimator)  # whose reason is whole
        why = str(error) if is_plugin else f"{type(error).__name__}: {error}"
        self._say(f"{what} {runner.name} stopped: {why}", mailbox.WARN)
