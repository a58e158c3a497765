"""A sensor of the user's own: its readings correct every filter that takes them."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from estimation.estimator import Estimator, TakesReadings
from estimation.outcome import LATEST_NS, JudgedReading, Outcome
from quadrotor.errors import MeasurementError, RefusedError
from quadrotor.records import JUDGED_READING, READING_SAMPLE, Record
from vehicle.plugins.external import External
from vehicle.plugins.links import Link
from vehicle.sensors.contract import SENSOR

STATE = ("position_w", "velocity_w", "quaternion_wb", "angular_velocity_b")
MEMORY, REFUSED_MAX = 0.02, 0.5
"""Weight of one reading in the share of those that the gate refused, and the share above which the
sensor is disengaged."""
JUDGEMENTS, NOT_TAKEN = {Outcome.APPLIED: 0, Outcome.OUTLIER: 1}, 2
"""Numbers of a JUDGED_READING."""
AHEAD = 1e-6
"""s by which a reading may be later than the input that it answers: rounding."""


class ExternalSensor(External):
    """A plugin that is asked in each tick, and whose readings are applied with their own time.

    The filter gates each reading like a pose. A sensor is disengaged that fails, whose readings the
    gate mostly refuses, or after whose readings the other measurements contradict the filter.

    Args:
        place: from 1, its own among the sensors that run.

    Attributes:
        used, refused: readings since the last summary, by the gate of the estimator in use.
        judged: those of the newest tick, JUDGED_READING (1,) each.
    """

    def __init__(self, name: str, link: Link, waits: bool, place: int = 1) -> None:
        super().__init__(SENSOR, name, link, waits)
        self.place, self.judged = place, list[Record]()
        self._asked_ns, self._doubt = 0, 0.0
        self.used = self.refused = 0

    def step(
        self,
        stamp_ns: int,
        dt: float,
        imu: Record,
        state: Record,
        pressure: float,
        flying: bool,
        estimators: Iterable[Estimator],
    ) -> None:
        """Apply the readings that answer the last input, and send the next."""
        self.judged.clear()
        if self.failure:
            return
        try:
            answer = self._answer()
            if answer is not None and answer["count"][0]:
                # A plugin offers whatever the one beneath it takes, which is among them itself.
                built_in = [one for one in estimators if not isinstance(one, External)]
                self._apply(answer[0], [one for one in built_in if isinstance(one, TakesReadings)])
        except (RefusedError, MeasurementError) as error:
            self.failure = str(error)
            return
        out = self._out
        out["time"] += dt
        out["dt"], out["flying"], out["pressure"] = dt, flying, pressure
        for name in STATE:
            out[name] = state[name]
        out["specific_force_b"] = imu["specific_force_b"]
        self._asked_ns = stamp_ns
        self._ask()

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        line = f"{super().summary()}; {self.used} readings used, {self.refused} refused by the gate"
        self.used = self.refused = 0
        return line

    # ------------------------------------------------------------------ parts
    def _apply(self, answer: Record, estimators: list[TakesReadings]) -> None:
        """Raises RefusedError, MeasurementError when the sensor must not be used any more."""
        count, most = float(answer["count"]), len(answer["sigma"])
        if not 0 <= count <= most:
            raise RefusedError(f"it answered {count:g} readings; 0 to {most} are taken")
        for k in range(int(count)):
            reading = np.zeros(1, READING_SAMPLE)
            since = float(answer["time"] - answer["measured"][k])
            if not -AHEAD <= since <= 1e-9 * LATEST_NS:
                raise RefusedError(
                    f"a reading is {since:.3f} s old; allowed are 0 to {1e-9 * LATEST_NS:g} s"
                )
            reading["stamp_ns"] = self._asked_ns - max(0, round(1e9 * since))
            for name in ("position_w", "quaternion_wb", "rest", "row", "sigma"):
                reading[name] = answer[name][k]
            outcomes = [one.correct_reading(reading) for one in estimators]
            first = outcomes[0] if outcomes else JudgedReading(Outcome.TOO_OLD)
            self._keep(reading, float(answer["value"][k]), first)
            if outcomes:
                self._note(first.outcome)
        for one in estimators:
            if contradicted := getattr(one, "inconsistency", ""):
                raise RefusedError(f"the filter that it corrects is contradicted: {contradicted}")

    def _keep(self, reading: Record, value: float, found: JudgedReading) -> None:
        kept = np.zeros(1, JUDGED_READING)
        kept["stamp_ns"], kept["deviation"] = reading["stamp_ns"], reading["sigma"]
        kept["place"], kept["sensor"] = self.place, self.name.encode()
        kept["reading"], kept["gate"] = value, found.gate
        kept["residual"] = reading["rest"] if math.isnan(found.residual) else found.residual
        kept["judgement"] = JUDGEMENTS.get(found.outcome, NOT_TAKEN)
        self.judged.append(kept)

    def _note(self, outcome: Outcome) -> None:
        if outcome in (Outcome.APPLIED, Outcome.OUTLIER):
            is_refused = outcome == Outcome.OUTLIER
            self.used, self.refused = self.used + (not is_refused), self.refused + is_refused
            self._doubt += MEMORY * (is_refused - self._doubt)
            if self._doubt > REFUSED_MAX:
                raise RefusedError(
                    f"the gate refused {self._doubt:.0%} of its last readings, "
                    f"allowed {REFUSED_MAX:.0%}"
                )
