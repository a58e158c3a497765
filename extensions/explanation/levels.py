"""The condition of a vehicle in one flight, as figures that can be compared between flights."""

from __future__ import annotations

import numpy as np

from console.evaluation.findings import Spans, Topics
from extensions.explanation.blocks import SETTLING, airborne, has, tracker_of
from extensions.explanation.causes import vibrating
from flight_log.run import Run, Series

BIASES = {"gyroscope_bias": "gyroscope_bias_rad_s", "accelerometer_bias": "accelerometer_bias_m_s2"}
LOADED = 0.5
"""Share of the thrust in flight below which a battery is taken to be at rest."""


def levels(run: Run) -> dict[str, float]:
    """Return the condition that a flight shows, whether or not it is beyond a limit.

    These are vibration, the tracker's longest gap, age and consistency of the measurements, biases
    of the IMU, and what the battery's voltage falls by under load. Those whose topics the log lacks
    are left out; a log without a flight has none.
    """
    topics = {name: one for name, one in run.topics.items() if len(one)}
    spans = airborne(topics)
    if not spans:
        return {}
    found = {"airborne_s": sum(end - start + 2.0 * SETTLING for start, end in spans)}
    _, rms = vibrating(topics, spans)
    if len(rms):
        found["vibration_m_s2"] = float(np.median(rms))
    times = topics[tracker_of(topics)[0]].time if tracker_of(topics)[0] in topics else np.zeros(0)
    flown = [times[(times >= start) & (times <= end)] for start, end in spans]
    if any(len(one) > 1 for one in flown):
        found["tracker_gap_max_s"] = max(float(np.diff(one).max(initial=0.0)) for one in flown)
    if "estimator" in topics:
        found |= _of_estimator(topics["estimator"], spans)
    return found | _of_battery(topics, spans)


def _of_estimator(series: Series, spans: Spans) -> dict[str, float]:
    found = {
        name: _usual(series, field, spans)
        for field, name in (
            ("measurement_age", "measurement_age_s"),
            ("consistency", "consistency"),
            ("refused_share", "refused_share"),
        )
        if field in series
    }
    for field, name in BIASES.items():
        axes = [f"{field}.{axis}" for axis in "xyz"]
        if all(axis in series for axis in axes):
            found[name] = float(np.linalg.norm([_usual(series, axis, spans) for axis in axes]))
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _usual(series: Series, field: str, spans: Spans) -> float:
    """Return the median of a field in flight; NaN without values."""
    inside = np.zeros(len(series.time), bool)
    for start, end in spans:
        inside |= (series.time >= start) & (series.time <= end)
    values = series.values(field)[inside].astype(np.float64)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else float("nan")


def _of_battery(topics: Topics, spans: Spans) -> dict[str, float]:
    """Return the voltage at the beginning of the flight, and its fall from rest by the thrust.

    The fall over the thrust stands for the inner resistance, of which boards without a sensor of
    current tell nothing.
    """
    if not has(topics, "battery", "voltage"):
        return {}
    battery = topics["battery"]
    start = spans[0][0]
    volts = _usual(battery, "voltage", [(start, start + 2.0 * SETTLING)])
    found = {"battery_start_v": volts, "battery_end_v": _last(battery, spans)}
    if has(topics, "actuators", "thrust"):
        actuators = topics["actuators"]
        thrust = _usual(actuators, "thrust", [(start, start + 2.0 * SETTLING)])
        carried = np.interp(battery.time, actuators.time, actuators.values("thrust"))
        rest = battery.values("voltage")[(battery.time < start) & (carried < LOADED * thrust)]
        if len(rest):
            found["battery_fall_v_n"] = (float(np.median(rest)) - volts) / thrust
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _last(battery: Series, spans: Spans) -> float:
    end = spans[-1][1]
    return _usual(battery, "voltage", [(end - 2.0 * SETTLING, end)])
