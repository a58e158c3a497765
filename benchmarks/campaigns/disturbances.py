"""The 8 with disturbances unknown to the model: payload, drag, wind, a weak motor, vibration.

    python -m benchmarks disturbances

Simulated time: real stack, simulated firmware and plant, full sensors. The flights are those of
plans/disturbances.toml: each disturbance with the gains `standard` and with the gain set
`observer`, which compensates what it estimates, and with what helps further. The last row is the
whole rough world of `simulator.preset=rough`.
"""

from __future__ import annotations

import numpy as np

from benchmarks.campaigns.planned import Flown
from benchmarks.harness import Report, Size, Target
from control.margins import margins
from control.presets import preset
from quadrotor.vehicle_model import VehicleModel

NOMINAL, ERROR = "nominal", "position_rms_m"
NOT_WORSE = 1.05
LIMITS = {
    "mass + 20 %": 6.0,
    "drag 0.2 N s/m": 6.0,
    "wind 5 m/s, gusts 1.5 m/s": 30.0,
    "one motor - 10 %": 10.0,
}
"""Largest median error with the observer, in mm rms."""


def run(size: Size = Size.FULL) -> Report:
    """Measure the position error on steady laps of the 8, with the observer off and on."""
    flown = Flown("disturbances", size)
    report = Report(
        "disturbances",
        "What the model does not know",
        [
            f"simulated time, {flown.plan.seeds} seeds, full sensors at 500 Hz, tracker; the 8 of "
            "`quadlab fly figure_eight`, steady laps, position rms, median and worst of the seeds",
            "off: gains `standard`; on: gain set `observer`; wind acts by a drag of 0.3 N s/m",
        ],
    )
    report.rows = flown.rows("world", "gains", ERROR, 1e3, "mm")
    on = {
        world: 1e3 * float(np.median(flown.values(ERROR, world=world, gains="on")))
        for world, gains in flown.combinations("world", "gains")
        if gains == "on"
    }
    off = 1e3 * float(np.median(flown.values(ERROR, world=NOMINAL, gains="off")))
    report.targets = [Target("nominal, on over off", on[NOMINAL] / off, NOT_WORSE)]
    for world, limit in LIMITS.items():
        if world in on:
            report.targets.append(Target(f"{world}, on, mm rms", on[world], limit))
    lag = VehicleModel().motor_time_constant
    before, after = (smallest_delay(name, lag) for name in ("standard", "observer"))
    report.targets.append(
        Target("delay borne by the weakest loop, on over off", after / before, 1.0, at_most=False)
    )
    return report


def smallest_delay(name: str, lag: float) -> float:
    """Return the smallest delay (s) that a loop of a gain set tolerates."""
    return min(one.delay for one in margins(preset(name), lag))
