"""Which estimator the vehicle flies on, which runs beside it, and what both are given.

On the ground a choice acts at once. In flight the only change is to the shadow, which has seen the
same measurements, and only when it has converged and agrees with what is flown on; everything
else is refused and changes nothing. An estimator is compiled before it is accepted, never in
flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from estimation import registry
from estimation.convergence import Difference, difference
from estimation.estimator import Estimator
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError, RefusedError
from quadrotor.parameters import ParameterValue
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    MAX_BEACONS,
    POSE_SAMPLE,
    Record,
    new_state,
)
from vehicle import mailbox
from vehicle.measurement_rate import MeasurementRate

AGREEMENT = Difference(position=0.25, velocity=0.4, attitude=math.radians(6.0))
"""How far the shadow may be from the estimate in use to take its place in flight."""
COMPLAIN_NS = 1_000_000_000
"""Between two lines about measurements that cannot be used: 30 frames a second may be such."""
ESTIMATOR, SHADOW, SOURCE = "estimation.estimator", "estimation.shadow", "estimation.source"
NONE = "none"


class Navigation:
    """The estimators of one vehicle.

    Args:
        parameters: of the estimation, read again by each `configure`.
        say: takes a line for the log and its level.
        plugin: flown on in place of the estimator named in the parameters, until another
            name is set.
        beacons: where the bearings' ids stand.
    """

    def __init__(
        self,
        parameters: EstimationParameters,
        say: Callable[[str, int], None],
        plugin: Estimator | None = None,
        beacons: Beacons = PAPER_BEACONS,
    ) -> None:
        self.shadow: Estimator | None = None
        self.shadow_state, self.shadow_estimate = new_state(), np.zeros(1, ESTIMATE)
        self._say = say
        self._places = dict(zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True))
        self._queue: list[Record] = []
        self._last_pose_ns = self._complained_ns = -(1 << 62)
        self._rate = MeasurementRate()
        self._name, self._shadow_name = parameters.estimator, NONE
        self._plugged = plugin is not None  # of unknown make: nothing to compile
        if plugin is None:
            registry.prepare(self._name, parameters.source != "poses")
            plugin = registry.create(self._name, parameters)
        self.active: Estimator = plugin
        self.configure(parameters)

    # ------------------------------------------------------------------ the tick
    def step(self, imu: Record, dt: float, state: Record, estimate: Record) -> None:
        """Predict by one sample, apply what came since the last; write STATE and ESTIMATE."""
        active = self.active
        active.predict(imu, dt, state)
        if self.shadow is not None:
            self._step_shadow(imu, dt)
        if self._queue:
            self._take_measurements(imu["stamp_ns"].item(), estimate)
        active.report(estimate)

    def measure(self, measurement: mailbox.Pose | mailbox.Bearings) -> None:
        """Take one measurement; it acts at the next step."""
        if isinstance(measurement, mailbox.Pose):
            if self._source != "bearings":
                pose = np.zeros(1, POSE_SAMPLE)
                pose[0] = measurement.stamp_ns, measurement.position_w, measurement.quaternion_wb
                self._queue.append(pose)
        elif self._source != "poses":
            frame = self._frame(measurement)
            if frame is not None:
                self._queue.append(frame)

    def reset(self) -> None:
        """Forget everything: the gyroscope was calibrated anew."""
        self.active.reset()
        if self.shadow is not None:
            self.shadow.reset()

    # ------------------------------------------------------------------ choices
    def check(
        self, values: Mapping[str, ParameterValue], state: Record, armed: bool
    ) -> dict[str, ParameterValue]:
        """What else a change of parameters changes; compiles what it asks for on the ground.

        In flight, the estimator and its shadow change places. Raises RefusedError with the
        reason and its numbers.
        """
        name = str(values.get(ESTIMATOR, self._name))
        shadow = str(values.get(SHADOW, self._shadow_name))
        bearings = str(values.get(SOURCE, self._source)) != "poses"
        extra: dict[str, ParameterValue] = {}
        if not values.keys() & {ESTIMATOR, SHADOW, SOURCE}:
            return extra
        if name != self._name:
            if armed:
                self._check_shadow(name, state)
            if shadow == name:
                shadow = self._name if armed else NONE
                extra[SHADOW] = shadow
        elif shadow == name:
            raise RefusedError(
                f"{SHADOW} = {name} is what the vehicle flies on; choose another, or {NONE}"
            )
        for one in self._new(name, shadow, bearings):
            if not registry.ready(one, bearings):
                if armed:
                    raise RefusedError(
                        f"estimator {one} is not compiled for these measurements, which takes "
                        "seconds; disarm, or choose it before arming"
                    )
                registry.prepare(one, bearings)
        return extra

    def configure(self, parameters: EstimationParameters) -> None:
        """Take the present parameters; `check` has seen the choices."""
        p = parameters
        self._source = p.source
        if p.estimator != self._name:
            if p.estimator == self._shadow_name and self.shadow is not None:
                self.active, self.shadow = self.shadow, self.active
                self._shadow_name = self._name
            else:
                self.active = registry.create(p.estimator, p)
            self._name, self._plugged = p.estimator, False
            self._say(f"estimator {self._name}", mailbox.INFO)
        if p.shadow != self._shadow_name:
            self.shadow = None if p.shadow == NONE else registry.create(p.shadow, p)
            self._shadow_name = p.shadow
        self.active.configure(p)
        if self.shadow is not None:
            self.shadow.configure(p)
        self._timeout_ns = round(1e9 * p.measurement_timeout)
        self._rate.forget_warnings()

    # ------------------------------------------------------------------ parts
    def _new(self, name: str, shadow: str, bearings: bool) -> set[str]:
        """Names of the estimators that would meet what they have not met so far."""
        more = bearings and self._source == "poses"
        found = set()
        if name != self._name or (more and not self._plugged):
            found.add(name)
        if shadow not in (NONE, self._name) and (more or shadow != self._shadow_name):
            found.add(shadow)
        return found

    def _take_measurements(self, now_ns: int, estimate: Record) -> None:
        for measurement in self._queue:
            is_pose = measurement.dtype == POSE_SAMPLE
            if is_pose:
                self._last_pose_ns = now_ns
            taken = is_pose or self._wants_bearings(self.active, now_ns)
            try:
                if taken and is_pose:
                    self.active.correct(measurement, estimate)
                elif taken:
                    self.active.correct_bearings(measurement, estimate)
            except MeasurementError as error:
                if now_ns - self._complained_ns > COMPLAIN_NS:
                    self._complained_ns = now_ns
                    self._say(str(error), mailbox.WARN)
                continue
            if taken:
                self._warn(now_ns)
            if self.shadow is not None:
                self._correct_shadow(measurement, is_pose, now_ns)
        self._queue.clear()

    def _wants_bearings(self, estimator: Estimator, now_ns: int) -> bool:
        """A filter of fixed gains would take bearings for as good as poses: only without them."""
        if self._source == "bearings" or estimator.deviations is not None:
            return True
        return now_ns - self._last_pose_ns > self._timeout_ns

    def _warn(self, now_ns: int) -> None:
        rate = self._rate.add(now_ns)
        if rate is not None:
            for line in self._rate.unsaid(self.active.warnings(rate)):
                self._say(line, mailbox.WARN)

    def _step_shadow(self, imu: Record, dt: float) -> None:
        assert self.shadow is not None
        try:
            self.shadow.predict(imu, dt, self.shadow_state)
        except Exception as error:
            self._drop_shadow(error)

    def _correct_shadow(self, measurement: Record, is_pose: bool, now_ns: int) -> None:
        shadow = self.shadow
        assert shadow is not None
        try:
            if is_pose:
                shadow.correct(measurement, self.shadow_estimate)
            elif self._wants_bearings(shadow, now_ns):
                shadow.correct_bearings(measurement, self.shadow_estimate)
        except MeasurementError:
            pass  # said of the estimator in use
        except Exception as error:
            self._drop_shadow(error)

    def _drop_shadow(self, error: Exception) -> None:
        """A defect in what is only compared must not end the flight."""
        self.shadow = None
        self._say(
            f"shadow {self._shadow_name} stopped: {type(error).__name__}: {error}", mailbox.WARN
        )

    def _check_shadow(self, name: str, state: Record) -> None:
        if self.shadow is None or name != self._shadow_name:
            raise RefusedError(
                f"estimator {name} does not run: in flight only the shadow "
                f"({self._shadow_name}) may be chosen; set {SHADOW} = {name} first"
            )
        convergence = self.shadow.convergence
        if not convergence.reached:
            raise RefusedError(f"estimator {name} has not converged: {convergence.reason}")
        apart = difference(self.shadow_state, state)
        if not apart.within(AGREEMENT):
            raise RefusedError(
                f"estimator {name} is {apart} away from {self._name}; allowed {AGREEMENT}"
            )

    def _frame(self, measurement: mailbox.Bearings) -> Record | None:
        """As BEARINGS_SAMPLE with the known beacons' places; None when none is known."""
        places = self._places
        seen = [
            (places[one], bearing)
            for one, bearing in zip(measurement.beacon_ids, measurement.bearings_b, strict=False)
            if one in places
        ][:MAX_BEACONS]
        if not seen:
            if measurement.beacon_ids:
                line = f"no known beacon among {list(measurement.beacon_ids)}"
                for unsaid in self._rate.unsaid([line]):
                    self._say(f"{unsaid}; known are {sorted(places)}", mailbox.WARN)
            return None
        frame = np.zeros(1, BEARINGS_SAMPLE)
        item = frame[0]
        item["stamp_ns"], item["count"], item["sigma"] = (
            measurement.stamp_ns,
            len(seen),
            measurement.sigma,
        )
        item["beacon_w"][: len(seen)] = [place for place, _ in seen]
        item["bearing_b"][: len(seen)] = [bearing for _, bearing in seen]
        return frame
