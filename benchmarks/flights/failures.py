"""Simulate the outcome of a flight when something above the microcontroller fails.

    python -m benchmarks failures [--quick]
    python -m benchmarks failures --only betaflight    # or crazyflie, c: its firmware; rough: world
    python -m benchmarks.flights.failures [--seeds 2] [--only web,station]     # real processes

Flights in simulated time are those of the plans `failures…` of benchmarks/campaigns/plans: seeds
differ in the truth's noise, wind, motors and battery, and in the moment of the failure. The
firmware, the plant and the flight stack run in one process, which exchange real bytes; a killed and
a frozen flight process are the same there: silence. Real flights are separate processes, killed,
frozen and unplugged in real time, some 25 s each.
"""

from __future__ import annotations

import argparse
import math
import signal
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.campaigns.planned import Flown
from benchmarks.flights.failing_flights import CORRUPTED
from benchmarks.flights.touch_down import IMPACT_MAX, UPRIGHT, Outcome
from benchmarks.harness import Report, Row, Size, Target
from quadrotor.records import Array

Numbers = Sequence[float] | Array
REAL_SEEDS = 2, 0, 0  # of each size
REAL_FAILURES = (
    "web",
    "station",
    "comms",
    "flight",
    "frozen",
    "port 0",
    "port 1",
    "both ports",
    CORRUPTED,
)
COLUMNS = {
    "impact, m/s": ("impact_m_s", 2),
    "tilt then, deg": ("tilt_deg", 1),
    "tilt on the way": ("tilt_max_deg", 0),
    "drift, m": ("drift_m", 2),
    "down after, s": ("down_s", 1),
    "motors off, s": ("off_s", 1),
}
"""The figures of the table: metric of a flight in simulated time, digits."""


def run(size: Size = Size.FULL, only: str = "") -> list[Report]:
    """Run the benchmark for `python -m benchmarks`: the vehicle's own plan and real processes, or
    the plan of another board, firmware or world."""
    reports = [report(Flown(f"failures_{only}" if only else "failures", size))]
    if not only and (seeds := size.of(*REAL_SEEDS)):
        reports.append(report_of_real(fly_really(seeds, REAL_FAILURES)))
    return reports


def report(flown: Flown) -> Report:
    """Return a row for each failure and start: median and worst."""
    found = Report(
        "failures",
        "Failures above the microcontroller",
        [
            f"simulated time, {flown.plan.seeds} seeds",
            "each seed: wind up to 1 m/s, gusts of 0.5 m/s, thrust ±5 %, battery 50–100 %, "
            "gyroscope drift of 1 deg/s, moment of the failure",
            "median / worst; drift: from the place of the failure to the touch-down, in that wind",
            "lap: rest to rest, leaning by 35 deg; flight killed and frozen are one in simulated "
            "time; motors off: since the failure",
        ],
    )
    factors = list(flown.plan.factors)
    for each in flown.combinations(*factors):
        chosen = dict(zip(factors, each, strict=True))
        values = {name: flown.values(of, **chosen) for name, (of, _) in COLUMNS.items()}
        landed = f"{flown.count('landed', **chosen)} of {len(values['drift, m'])}"
        figures = {name: _both(values[name], digits) for name, (_, digits) in COLUMNS.items()}
        found.rows.append(Row(", ".join(each), {"landed": landed, **figures}))
    lost = flown.values("landed") != 1.0
    found.notes += flown.notes(lost, "did not land")
    found.targets += _targets(int(lost.sum()), flown.values("impact_m_s"), flown.values("tilt_deg"))
    return found


def _targets(lost: int, impacts: Numbers, tilts: Numbers) -> list[Target]:
    return [
        Target(f"flights of {len(impacts)} that did not land", lost, 0),
        Target("hardest touch-down, m/s", max(impacts), IMPACT_MAX),
        Target("largest tilt at touch-down, deg", max(tilts), math.degrees(UPRIGHT)),
    ]


def fly_really(seeds: int, only: Sequence[str]) -> list[Outcome]:
    """Fly with the real processes in turn."""
    from benchmarks.flights.failing_processes import STARTS, fly_real

    outcomes = []
    for failure in only:
        for start in STARTS:
            for seed in range(1, seeds + 1):
                outcomes.append(fly_real(failure, start, seed))
                print(line(outcomes[-1]), file=sys.stderr, flush=True)
    return outcomes


def line(outcome: Outcome) -> str:
    """Return one flight as a line."""
    o = outcome
    return (
        f"{o.failure}, {o.start}, seed {o.seed}: {o.verdict}; "
        f"{o.impact:.2f} m/s, {math.degrees(o.tilt):.1f} deg, {o.drift:.2f} m off, "
        f"down {o.down:.1f} s, motors off {o.off:.1f} s"
    )


def report_of_real(outcomes: Sequence[Outcome]) -> Report:
    """Return the same of real processes."""
    found = Report(
        "failures_of_processes",
        "Failures of real processes",
        [
            f"real time, {len({o.seed for o in outcomes})} seeds; conditions as in simulated time",
            "motors off, where nobody hears the vehicle: when it was seen",
        ],
    )
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.failure, outcome.start), []).append(outcome)
    for (failure, start), flights in groups.items():
        landed = sum(o.verdict == "landed" for o in flights)
        found.rows.append(
            Row(
                f"{failure}, {start}",
                {
                    "landed": f"{landed} of {len(flights)}",
                    "impact, m/s": _both([_number(o.impact) for o in flights], 2),
                    "tilt then, deg": _both([_number(math.degrees(o.tilt)) for o in flights], 1),
                    "tilt on the way": _both(
                        [_number(math.degrees(o.tilt_max)) for o in flights], 0
                    ),
                    "drift, m": _both([_number(o.drift) for o in flights], 2),
                    "down after, s": _both([_number(o.down) for o in flights], 1),
                    "motors off, s": _both([_number(o.off) for o in flights], 1),
                },
            )
        )
    found.notes += [line(o) for o in outcomes if o.verdict != "landed"]
    lost = sum(o.verdict != "landed" for o in outcomes)
    impacts = [_number(o.impact) for o in outcomes]
    found.targets += _targets(lost, impacts, [_number(math.degrees(o.tilt)) for o in outcomes])
    return found


def _both(values: Numbers, digits: int) -> str:
    return f"{np.median(values):.{digits}f} / {max(values):.{digits}f}"


def _number(value: float) -> float:
    """Return the value, infinite for an event that never happened."""
    return math.inf if math.isnan(value) else value


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.flights.failures",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seeds", type=int, default=REAL_SEEDS[0], help="of real processes")
    parser.add_argument("--only", default=",".join(REAL_FAILURES), help="failures, by commas")
    options = parser.parse_args()
    only = [name.strip() for name in options.only.split(",")]
    unknown = [name for name in only if name not in REAL_FAILURES]
    if unknown:
        parser.error(f"no failure is called {unknown[0]!r}: there are {', '.join(REAL_FAILURES)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends all processes of a flight
    found = report_of_real(fly_really(options.seeds, only))
    print(found.as_markdown())
    return 0 if all(target.met for target in found.targets) else 1


if __name__ == "__main__":
    sys.exit(main())
