"""Findings about the battery: below its warning, or weaker from one moment to the next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, within
from extensions.explanation.blocks import SETTLING, blocks, has, number

DROP, DROP_BLOCK, SAME_THRUST = 0.4, 4.0, 0.05
"""Limit in V of a fall of the voltage from one block of time (s) to the one after the next, where
the thrust differs by less than this share."""
CELL_WARNING, CELL_LAND, CELL_FULL = 3.45, 3.275, 4.25
"""V per cell, for a battery whose limits are not in the log."""


def battery_sag(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a battery voltage below its warning."""
    if not has(topics, "battery", "voltage"):
        return
    series = topics["battery"]
    volts = series.values("voltage")
    cells = max(1, int(np.ceil(np.nanmax(volts, initial=0.0) / CELL_FULL)))
    warning = number(parameters, "safety.battery_warning", cells * CELL_WARNING)
    landing = min(number(parameters, "safety.battery_land", cells * CELL_LAND), warning - 0.1)
    known = "safety.battery_warning" in parameters
    assumed = "" if known else f" ({CELL_WARNING:g} V a cell; {cells} cells assumed)"
    whole = [(start - SETTLING, end + SETTLING) for start, end in spans]
    inside = within(series.time, whole) & (volts < warning) & (volts > 0.3 * warning)
    times = series.time[inside]
    if len(times) < 2 or times[-1] - times[0] < 1.0:
        return
    least = float(np.min(volts[inside]))
    yield Finding(
        "battery_sag",
        1.0 + (warning - least) / (warning - landing),
        start=float(times[0]),
        end=float(times[-1]),
        claim=f"The battery fell to {least:.1f} V, below its warning of {warning:.1f} V{assumed}.",
        signals=("battery.voltage",),
        label="battery",
        unit="V",
        limit=warning,
        time=series.time,
        values=volts,
    )


def battery_drop(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a voltage that falls within seconds although the motors' thrust does not change."""
    if not has(topics, "battery", "voltage") or not has(topics, "actuators", "thrust"):
        return
    series, actuators = topics["battery"], topics["actuators"]
    thrust = np.interp(series.time, actuators.time, actuators.values("thrust"))
    rows = np.stack([series.values("voltage").astype(np.float64), thrust], axis=1)
    time, middle = blocks(series.time, rows, spans, _usual, DROP_BLOCK)
    if len(time) < 3:
        return
    before, after = middle[:-2], middle[2:]  # the one between may hold the moment itself
    apart = time[2:] - time[:-2] < 2.5 * DROP_BLOCK
    steady = np.abs(after[:, 1] - before[:, 1]) < SAME_THRUST * np.abs(before[:, 1])
    fell = np.where(apart & steady, before[:, 0] - after[:, 0], 0.0)
    worst = int(np.argmax(fell))
    if fell[worst] < DROP:
        return
    yield Finding(
        "battery_sag",
        float(fell[worst]) / DROP,
        start=float(time[worst]) + DROP_BLOCK,
        end=float(time[worst + 2]) + DROP_BLOCK,
        claim=f"The battery fell by {fell[worst]:.1f} V within seconds, although the thrust stayed "
        "the same: its inner resistance has grown.",
        alike=("a cold or worn battery", "a loose or burnt contact", "another load beside motors"),
        signals=("battery.voltage", "thrust"),
        label="fall of the voltage at the same thrust",
        unit="V",
        limit=DROP,
        time=time[2:],
        values=fell,
    )


def _usual(rows: Array) -> Array:
    """Return the median voltage and the mean thrust of rows (N, 2)."""
    return np.array([np.median(rows[:, 0]), rows[:, 1].mean()])
