"""Flights on a failing tracking system: the vehicle's reaction, and how soon the fault is reported.

    python -m benchmarks tracking_faults [--flights 440]

The flights are those of plans/tracking_faults.toml. One is as meant if it flies on after a short
fault and lands after a long one, softly and without a large tilt.
"""

from __future__ import annotations

from benchmarks.campaigns.planned import Flown
from benchmarks.harness import Report, Row, Size, Target

REPORTED = 0.5
"""Longest time, in s, until a fault is reported."""
FAULT = "experiment.fault"


def run(size: Size = Size.FULL, flights: int = 0) -> Report:
    """Run the benchmark for `python -m benchmarks`; with a number of flights with as many seeds."""
    short = {"experiment.watched": 1.0}
    flown = Flown("tracking_faults", size, flights=flights, smoke=1, short=short)
    report = Report(
        "tracking_faults",
        "A tracking system that fails",
        [
            f"{flown.table.num_rows} flights, half of them in the figure 8, the others hovering at "
            "1 m; 100 frames a second, their clock 40 ppm off, read with 1 ms of jitter",
            "as meant: it flies on after a short fault and lands after a long one, below 1 m/s and "
            "never tilted by more than 1 rad; 12 s are watched",
        ],
    )
    late = 0.0
    for (fault,) in flown.combinations(FAULT):
        hardest = flown.values("hardest_m_s", **{FAULT: fault})
        figures: dict[str, float | str] = {
            "flights": float(len(hardest)),
            "as meant": float(flown.count("as_meant", **{FAULT: fault})),
            "hardest landing, m/s": float(hardest.max()),
        }
        for metric, words in (
            ("error_m", "largest error, m"),
            ("reported_s", "reported after, s, at most"),
        ):
            if metric in flown.metrics(**{FAULT: fault}):
                figures[words] = float(flown.values(metric, **{FAULT: fault}).max())
        late = max(late, float(figures.get("reported after, s, at most", 0.0)))
        report.rows.append(Row(fault, figures))
    wrong = flown.values("as_meant") != 1.0
    report.notes += flown.notes(wrong, "not as meant")
    report.targets = [
        Target("flights that did not do what was meant", int(wrong.sum()), 0),
        Target("reported, s after the fault, at most", late, REPORTED),
    ]
    return report
