"""The 8 with disturbances unknown to the model: payload, drag, wind, a weak motor, vibration.

    python -m benchmarks disturbances

Simulated time: real stack, simulated firmware and plant, full sensors. Each disturbance is flown
with the gains `standard` and with the gain set `observer`, which compensates what it estimates;
drag also with the coefficient fed forward, payload also on the mass estimate, vibration also on the
error-state filter configured with that noise, and a weak motor also without the integral of
position. The last row is the whole rough world of `simulator.preset=rough`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from control.margins import margins
from control.presets import PRESETS, preset
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.vehicle_model import VehicleModel
from vehicle.simulator.presets import ROUGH

Settings = Mapping[str, ParameterValue]

SEEDS = 12
LAPS, PERIOD, RAMP = 2, 8.0, 4.0
"""Laps, period and ramp (s); the ramps in and out are shorter than RAMP, the rest steady laps."""
DRAG = 0.2
"""Linear drag, in N s/m."""
MASS: Settings = {"simulator.payload": round(0.2 * VehicleModel().mass, 4)}
OBSERVER: Settings = {f"control.{name}": value for name, value in PRESETS["observer"].items()}
STIFF_OBSERVER: Settings = {
    f"control.{name}": value for name, value in PRESETS["stiff_observer"].items()
}
ROUGH_DRAG: Settings = {"model.drag": 0.47, "model.drag_lever": 0.02}
FED: Settings = {"model.drag": DRAG}
WEIGHED: Settings = {"mass.used_by": "estimate"}
VIBRATION = 3.0
"""Vibration at hover, in m/s^2 rms."""
NOISE_SET: Settings = {
    "estimation.estimator": "error_state",
    "estimation.error_state.accelerometer_noise": round(VIBRATION / math.sqrt(500.0), 3),
}
NO_INTEGRAL: Settings = {**OBSERVER, "control.position.ki_xy": 0.0}
NOMINAL = "nominal"
NOT_WORSE = 1.05

CASES: dict[str, tuple[Settings, float | None, dict[str, Settings]]] = {
    NOMINAL: ({}, None, {"on, no horizontal integral": NO_INTEGRAL}),
    "mass + 20 %": (
        MASS,
        6.0,
        {"mass estimate": WEIGHED, "on, mass estimate": {**OBSERVER, **WEIGHED}},
    ),
    "drag 0.2 N s/m": (
        {"simulator.drag": DRAG},
        6.0,
        {"fed forward": FED, "on, fed forward": {**OBSERVER, **FED}},
    ),
    "wind 5 m/s, gusts 1.5 m/s": (
        {"simulator.drag": 0.3, "simulator.wind_x": 5.0, "simulator.gust": 1.5},
        30.0,
        {},
    ),
    "one motor - 10 %": (
        {"simulator.motor_gain_left": 0.9},
        10.0,
        {"on, no horizontal integral": NO_INTEGRAL},
    ),
    "vibration 3 m/s²": (
        {"simulator.vibration": VIBRATION},
        None,
        {
            "error-state filter, noise set": NOISE_SET,
            "on, error-state filter, noise set": {**OBSERVER, **NOISE_SET},
        },
    ),
    "rough: all that recorded flights show": (
        {f"simulator.{name}": value for name, value in ROUGH.items()},
        None,
        {
            "stiff_observer, fed forward": {
                **STIFF_OBSERVER,
                "model.drag": 0.47,
                "model.drag_lever": 0.02,
            }
        },
    ),
}
"""Disturbances: the limit (mm rms) with the observer, and further settings of the flight."""


def run(size: Size = Size.FULL) -> Report:
    """Measure the position error on steady laps of the 8, with the observer off and on."""
    laps = size.of(LAPS, LAPS, 1)
    seeds = range(1, size.of(SEEDS, 2, 1) + 1)
    report = Report(
        "disturbances",
        "What the model does not know",
        [
            f"simulated time, {len(seeds)} seeds, full sensors at 500 Hz, tracker; the 8: 1 m "
            f"× 1 m in {PERIOD:g} s, steady laps, position rms, median and worst of the seeds",
            "off: gains `standard`; on: gain set `observer`; wind acts by a drag of 0.3 N s/m",
        ],
    )
    medians: dict[str, float] = {}
    for name, (disturbance, limit, further) in size.some(CASES.items(), 2):
        figures: dict[str, float | str] = {}
        ways: dict[str, Settings] = {"off": {}, "on": OBSERVER, **further}
        for way, settings in ways.items():
            errors = np.array([_fly(seed, {**disturbance, **settings}, laps) for seed in seeds])
            figures[f"{way}, mm"] = float(np.median(errors))
            figures[f"{way}, worst"] = float(errors.max())
        report.rows.append(Row(name, figures))
        medians[name] = float(figures["on, mm"])
        if name == NOMINAL:
            ratio = medians[name] / float(figures["off, mm"])
            report.targets.append(Target("nominal, on over off", ratio, NOT_WORSE))
        if limit is not None:
            report.targets.append(Target(f"{name}, on, mm rms", medians[name], limit))
    lag = VehicleModel().motor_time_constant
    before, after = (smallest_delay(name, lag) for name in ("standard", "observer"))
    report.targets.append(
        Target("delay borne by the weakest loop, on over off", after / before, 1.0, at_most=False)
    )
    return report


def smallest_delay(name: str, lag: float) -> float:
    """Return the smallest delay (s) that a loop of a gain set tolerates."""
    return min(one.delay for one in margins(preset(name), lag))


def _fly(seed: int, settings: Settings, laps: int) -> float:
    """Return the position error, mm rms, of the steady laps; inf when they were not flown."""
    flight = WatchedFlight(seed, dict(settings))
    try:
        flight.hover()
        began = flight.view().time
        flight.start("follow_trajectory", trajectory="figure_eight", laps=laps, period=PERIOD)
        flight.wait_until(
            lambda v: v.behavior == "hover", what="the end of the 8", timeout=(laps + 4) * PERIOD
        )
    except RefusedError:
        return math.inf
    times, true, wanted = flight.trace(began + RAMP)
    rows = times <= flight.view().time - RAMP
    away = np.linalg.norm(true - wanted, axis=1)[rows]
    return 1e3 * float(np.sqrt(np.mean(away**2)))
