"""Flights with wrong measurements: whether the estimate recovers, is handed over, or is lost
silently.

    python -m benchmarks hostile_flights --flights 1000

The flights are those of plans/hostile_poses.toml and plans/hostile_bearings.toml, and what they are
called is said in plans/hostile_flights.py. Half of them are in the rough world, half in the figure
8. Each that is silent or lost is noted with the command that flies it again, with its log.
"""

from __future__ import annotations

from benchmarks.campaigns.planned import Flown
from benchmarks.harness import Report, Row, Size, Target

VERDICTS = "recovered", "handed_over", "reported", "refused", "silent", "lost"
PLANS = "hostile_poses", "hostile_bearings"
WAY, FAULT = "way", "experiment.fault"


def run(size: Size = Size.FULL, flights: int = 0) -> Report:
    """Run the benchmark for `python -m benchmarks`; with a number of flights with as many seeds."""
    short = {"experiment.watched": 1.0}
    several = [Flown(name, size, flights=flights // 2, smoke=1, short=short) for name in PLANS]
    count = sum(one.table.num_rows for one in several)
    found = Report(
        "hostile_flights",
        "Flights whose measurements lie",
        [
            f"{count} flights, hover or figure 8, half of them in the rough world; watched for 8 s",
            "near the truth: 0.1 m, 10 deg on poses, 0.3 m, 10 deg on bearings; silent: farther "
            "for 0.5 s while converged and without a flag",
        ],
    )
    for flown in several:
        for way, fault in flown.combinations(WAY, FAULT):
            chosen = {WAY: way, FAULT: fault}
            counts = {v: float(flown.count(v, **chosen)) for v in VERDICTS}
            largest = flown.values("largest_m", **chosen)
            figures = {"flights": float(len(largest)), **counts}
            figures["largest error, m"] = float(largest.max())
            found.rows.append(Row(f"{way}: {fault}", {**figures}))
        for verdict in ("silent", "lost"):
            found.notes += flown.notes(flown.values(verdict) != 0.0, verdict)
    for verdict in ("silent", "lost"):
        wrong = sum(int((one.values(verdict) != 0.0).sum()) for one in several)
        found.targets.append(Target(f"flights of {count} {verdict}", wrong, 0))
    return found
