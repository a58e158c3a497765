"""Flights on bearings alone, closed loop: accuracy, and the outcome when bearings fail.

    python -m benchmarks bearing_flights

The flights are those of plans/bearing_flights.toml and plans/bearing_faults.toml: the experiment
`bearings` of `quadlab fly` at 1 m, evaluated from its log. A fault begins 5 s after the hand-over
and persists, unless its name says otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.campaigns.planned import Flown
from benchmarks.harness import Report, Row, Size, Target

ERROR = "position_rms_m"
ENDS = {"flown": "flown", "fell_back": "fell back", "landed_itself": "landed itself"}
ESTIMATES = {
    "estimate, mm": ("estimate_position_rms_m", 1e3),
    "mm/s": ("estimate_velocity_rms_m_s", 1e3),
    "deg": ("estimate_attitude_rms_deg", 1.0),
}
BY = "experiment.estimator", "experiment.tracker", "experiment.fault"


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    flown, faulty = (
        Flown(name, size, smoke=1, short={"experiment.duration": 5.5})
        for name in ("bearing_flights", "bearing_faults")
    )
    report = Report(
        "bearing_flights",
        "Flown on bearings alone",
        [
            f"{flown.plan.seeds} seeds, 60 s each, with a fault 20 s, h = 1 m, 4 beacons as in "
            "Sec. 7, 30 Hz, 1.5 deg, full sensors, control gains `standard`",
            "rms of a row: mean and worst of its flights; a fault begins 5 s after the hand-over",
        ],
    )
    for (flight,) in flown.combinations("flight"):
        _add_manoeuvre(report, flown, flight)
    good = 0
    for estimator, tracker, fault in faulty.combinations(*BY):
        chosen = dict(zip(BY, (estimator, tracker, fault), strict=True))
        figures: dict[str, float | str] = {
            "farthest from its place, mm": 1e3 * float(faulty.values("farthest_m", **chosen).max()),
            "ground met at, m/s": float(faulty.values("ground_m_s", **chosen).max()),
        }
        with_ = "tracker there" if tracker else "tracker lost too"
        figures |= _counts(faulty, chosen)
        report.rows.append(Row(f"{estimator}, {fault}, {with_}", figures))
        good += int((faulty.values("unsafe", **chosen) == 0.0).sum())
    report.notes += faulty.notes(faulty.values("unsafe") != 0.0, "left or crashed")
    share = good / faulty.table.num_rows
    what = "share of faulty flights flown or landed inside"
    report.targets.append(Target(what, share, 1.0, at_most=False))
    return report


def _add_manoeuvre(report: Report, flown: Flown, flight: str) -> None:
    values = flown.values(ERROR, flight=flight)
    figures: dict[str, float | str] = {
        "tracking rms, mm": 1e3 * float(values.mean()),
        "worst": 1e3 * float(values.max()),
        "largest error, mm": 1e3 * float(flown.values("position_max_m", flight=flight).max()),
        **{
            name: unit * float(np.mean(flown.values(of, flight=flight)))
            for name, (of, unit) in ESTIMATES.items()
        },
        "saturated": float(flown.values("saturated_share", flight=flight).max()),
        **_counts(flown, {"flight": flight}),
    }
    report.rows.append(Row(flight, figures))
    if "gains" not in flight:
        over = float((values / flown.values("limit_position_rms_m", flight=flight)).max())
        report.targets.append(Target(f"{flight}, worst rms over its limit", over, 1.0))


def _counts(flown: Flown, chosen: dict[str, Any]) -> dict[str, float | str]:
    unsafe = int((flown.values("unsafe", **chosen) != 0.0).sum())
    ends = {words: flown.count(end, **chosen) for end, words in ENDS.items()}
    return {**ends, "left or crashed": unsafe}
