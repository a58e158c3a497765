"""The verdict on the figures of a link: good, usable or bad, why, and what to try."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from extensions.link_test.measurement import Figures

Grade = Literal["good", "usable", "bad"]
GRADES: tuple[Grade, ...] = ("good", "usable", "bad")


@dataclass(frozen=True, slots=True)
class Limit:
    """Bounds of a figure: above `good` the link is usable, above `usable` it is bad."""

    name: str
    good: float
    usable: float
    scale: float
    unit: str
    advice: str


ROUND_TRIP = Limit(
    "round trip p99",
    0.05,
    0.25,
    1e3,
    "ms",
    "move closer, use 5 GHz, and turn Wi-Fi power saving off at both ends",
)
UNANSWERED = Limit(
    "requests not answered",
    0.0,
    0.02,
    100.0,
    "%",
    "commands would have to be repeated: look for interference and other traffic",
)
LOSS = Limit(
    "telemetry lost", 0.02, 0.2, 100.0, "%", "move closer, or choose a channel that is free"
)
JITTER = Limit(
    "jitter",
    0.01,
    0.05,
    1e3,
    "ms",
    "another sender holds the channel: choose another, and end downloads on it",
)
LEAST_THROUGHPUT = 1e6, 0.25e6  # bit/s, next to telemetry's own 0.9e6
LATE_CLOCK = 1.0  # s


def verdict(figures: Figures) -> tuple[Grade, list[str]]:
    """Return the grade, and a line for each finding."""
    worst, lines = 0, []
    if figures.disagreement:
        worst = 2
        lines.append(f"bad: {figures.disagreement}")
    for limit, value in _values(figures):
        step = _step(limit, value)
        if step:
            worst = max(worst, step)
            lines.append(
                f"{GRADES[step]}: {limit.name} {_shown(limit, value)}, good is up to "
                f"{_shown(limit, limit.good)}: {limit.advice}"
            )
    for what, why in _not_measured(figures):
        worst = 2
        lines.append(f"{'note' if figures.disagreement else 'bad'}: {what} not measured: {why}")
    if figures.throughput < LEAST_THROUGHPUT[0]:
        step = 1 if figures.throughput >= LEAST_THROUGHPUT[1] else 2
        worst = max(worst, step)
        lines.append(
            f"{GRADES[step]}: throughput {figures.throughput / 1e6:.1f} Mbit/s, good is from "
            f"{LEAST_THROUGHPUT[0] / 1e6:g}: telemetry and downloads will hinder each other"
        )
    return GRADES[worst], [*lines, *_notes(figures)]


def _values(figures: Figures) -> list[tuple[Limit, float]]:
    """Return the limits of the measured figures, with their values."""
    asked = len(figures.round_trips) + figures.unanswered
    if figures.disagreement and not figures.round_trips:
        asked = 0  # the questions were not understood: none of them was lost
    values = [
        (ROUND_TRIP, percentile(figures.round_trips, 99)),
        (UNANSWERED, figures.unanswered / asked if asked else math.nan),
        (LOSS, figures.loss),
        (JITTER, figures.jitter),
    ]
    return [(limit, value) for limit, value in values if not math.isnan(value)]


def _not_measured(figures: Figures) -> list[tuple[str, str]]:
    """Return (what, why); without advice on the radio, which need not be the cause."""
    trip = [] if figures.round_trips else ["round trip"]
    numbers = (("telemetry loss", figures.loss), ("jitter", figures.jitter))
    telemetry = [name for name, value in numbers if math.isnan(value)]
    if figures.disagreement:
        hidden = trip + telemetry
        if math.isnan(figures.throughput) and not figures.armed:
            hidden.append("throughput")
        return [(_list(hidden), "the vehicle speaks another protocol")] if hidden else []
    found = [(name, "no request was answered") for name in trip]
    if telemetry:
        came = "one packet" if figures.packets == 1 else "no packet"
        why = f"{came} of telemetry received; its terminal may say why"
        found.append((_list(telemetry), why))
    return found


def _list(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def _step(limit: Limit, value: float) -> int:
    return 0 if value <= limit.good else 1 if value <= limit.usable else 2


def _shown(limit: Limit, value: float) -> str:
    return f"{value * limit.scale:.3g} {limit.unit}"


def _notes(figures: Figures) -> list[str]:
    notes = []
    if abs(figures.clock_offset) > LATE_CLOCK:
        notes.append(
            f"note: the clocks differ by {abs(figures.clock_offset):.0f} s; all stamps are of the "
            "vehicle's clock, so this does no harm, but logs will have its date"
        )
    if figures.held_by_another:
        notes.append(
            "note: another station is connected to the vehicle; "
            "its traffic was there during the measurement"
        )
    if figures.access == "observer":
        notes.append("note: our certificate lets us observe, not command")
    if figures.armed:
        notes.append("note: the vehicle is armed, so throughput was not measured")
    elif math.isnan(figures.throughput) and not figures.disagreement:
        notes.append(
            "note: throughput could not be measured, no parameters were received from the vehicle"
        )
    if figures.packets and figures.rate < 50.0:
        notes.append(
            f"note: {figures.packets} packets of telemetry only; loss and jitter are rough"
        )
    return notes


def percentile(values: list[float], percent: float) -> float:
    """Return the percentile; NaN for an empty list."""
    if not values:
        return math.nan
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, round(percent / 100 * (len(ordered) - 1)))]
