"""Simulate the outcome of a flight when something above the microcontroller fails.

    python -m benchmarks failures [--quick]
    python -m benchmarks.flights.failures [--seeds 20] [--real 2] [--only web,station] [--json FILE]
    python -m benchmarks.flights.failures --world rough [--seeds 5]
    python -m benchmarks.flights.failures --board betaflight [--minutes 4 --json FILE]
    python -m benchmarks.flights.failures --firmware c [--minutes 4 --json FILE]

With --json and --minutes a long run is flown in parts: flights that FILE has are not repeated.

Seeds differ in the truth's noise, wind, motors and battery, and in the moment of the failure. In
simulated time the firmware, the plant and the flight stack run in one process, which exchange real
bytes; a killed and a frozen flight process are the same there: silence. Real flights are separate
processes, killed, frozen and unplugged in real time, some 25 s each.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from benchmarks.flights import failing_flights
from benchmarks.flights.rough_world import CLEAN, WORLDS
from benchmarks.flights.touch_down import IMPACT_MAX, UPRIGHT, Outcome
from benchmarks.harness import Report, Row, Size, Target
from extensions.betaflight import NAME as BETAFLIGHT
from extensions.crazyflie import NAME as CRAZYFLIE
from vehicle.boards.kind import MIKROKOPTER

SEEDS, REAL_SEEDS = 20, 2
OF_OTHER_BOARDS = ("flight", "port 0", "station", "tracker")
STARTS_OF_OTHER_BOARDS = ("hover 1 m", "hover 2 m", "hover 3 m", "figure 8")
REAL_FAILURES = (
    "web",
    "station",
    "comms",
    "flight",
    "frozen",
    "port 0",
    "port 1",
    "both ports",
    failing_flights.CORRUPTED,
)
TRACKER = "tracker"
"""The failure that is flown in simulated time alone."""


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    seeds, real_seeds = size.of((SEEDS, REAL_SEEDS), (2, 0), (1, 0))
    names = simulated(REAL_FAILURES)
    outcomes = failing_flights.fly_all(seeds, names, size.some(failing_flights.STARTS), {})
    return report([*outcomes, *fly_really(real_seeds, REAL_FAILURES)])


def simulated(only: Sequence[str]) -> tuple[str, ...]:
    """Return what these failures are in simulated time, where the page has no part."""
    silent = ("flight", "frozen")
    names = (failing_flights.SILENT if name in silent else name for name in only if name != "web")
    return tuple(dict.fromkeys(names))


def fly_really(seeds: int, only: Sequence[str]) -> list[Outcome]:
    """Fly with the real processes in turn."""
    from benchmarks.flights.failing_processes import STARTS, fly_real

    outcomes = []
    for failure in (name for name in only if name != TRACKER):
        for start in STARTS:
            for seed in range(1, seeds + 1):
                outcomes.append(fly_real(failure, start, seed))
                print(line(outcomes[-1]), file=sys.stderr, flush=True)
    return outcomes


def line(outcome: Outcome) -> str:
    """Return one flight as a line."""
    o = outcome
    return (
        f"{'real' if o.real else 'simulated'} {o.failure}, {o.start}, seed {o.seed}: {o.verdict}; "
        f"{o.impact:.2f} m/s, {math.degrees(o.tilt):.1f} deg, {o.drift:.2f} m off, "
        f"down {o.down:.1f} s, motors off {o.off:.1f} s"
    )


def report(outcomes: Sequence[Outcome]) -> Report:
    """Return one row per failure and start: median and worst."""
    seeds = [{o.seed for o in outcomes if o.real is real} for real in (False, True)]
    found = Report(
        "failures",
        "Failures above the microcontroller",
        [
            f"simulated time: {len(seeds[0])} seeds; real processes in real time: {len(seeds[1])}",
            "each seed: wind up to 1 m/s, gusts of 0.5 m/s, thrust ±5 %, battery 50–100 %, "
            "gyroscope drift of 1 deg/s, moment of the failure",
            "median / worst; drift: from the place of the failure to the touch-down, in that wind",
            "lap: rest to rest, leaning by 35 deg; flight killed and frozen are one in simulated "
            "time",
            "motors off: since the failure; of real flights that nobody hears, when it was seen",
        ],
    )
    groups: dict[tuple[bool, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.real, outcome.failure, outcome.start), []).append(outcome)
    for (real, failure, start), flights in groups.items():
        landed = sum(o.verdict == "landed" for o in flights)
        found.rows.append(
            Row(
                f"{failure}, {start}",
                {
                    "flown in": "real time" if real else "simulated time",
                    "landed": f"{landed} of {len(flights)}",
                    "impact, m/s": _both(flights, lambda o: o.impact, 2),
                    "tilt then, deg": _both(flights, lambda o: math.degrees(o.tilt), 1),
                    "tilt on the way": _both(flights, lambda o: math.degrees(o.tilt_max), 0),
                    "drift, m": _both(flights, lambda o: o.drift, 2),
                    "down after, s": _both(flights, lambda o: o.down, 1),
                    "motors off, s": _both(flights, lambda o: o.off, 1),
                },
            )
        )
    found.notes += [line(o) for o in outcomes if o.verdict != "landed"]
    if outcomes:
        lost = sum(o.verdict != "landed" for o in outcomes)
        hardest = max(_number(o.impact) for o in outcomes)
        tilted = max(math.degrees(_number(o.tilt)) for o in outcomes)
        found.targets += [
            Target(f"flights of {len(outcomes)} that did not land", lost, 0),
            Target("hardest touch-down, m/s", hardest, IMPACT_MAX),
            Target("largest tilt at touch-down, deg", tilted, math.degrees(UPRIGHT)),
        ]
    return found


def _both(flights: Sequence[Outcome], of: Callable[[Outcome], float], digits: int) -> str:
    values = [_number(of(one)) for one in flights]
    return f"{statistics.median(values):.{digits}f} / {max(values):.{digits}f}"


def _number(value: float) -> float:
    """Return the value, infinite for an event that never happened."""
    return math.inf if math.isnan(value) else value


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.flights.failures",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seeds", type=int, default=SEEDS, help="in simulated time")
    parser.add_argument("--real", type=int, default=REAL_SEEDS, help="seeds of real processes")
    parser.add_argument("--only", help="failures, by commas; all that the board is judged by")
    parser.add_argument("--world", choices=tuple(WORLDS), default=CLEAN, help="simulated time only")
    boards = (MIKROKOPTER, BETAFLIGHT, CRAZYFLIE)
    parser.add_argument("--board", choices=boards, default=MIKROKOPTER)
    parser.add_argument("--firmware", choices=("python", "c"), default="python")
    parser.add_argument("--minutes", type=float, default=math.inf, help="in simulated time")
    parser.add_argument("--json", type=Path, help="write every flight there")
    options = parser.parse_args()
    is_other = options.board != MIKROKOPTER
    known = OF_OTHER_BOARDS if is_other else (*REAL_FAILURES, TRACKER)
    usual = OF_OTHER_BOARDS if is_other else REAL_FAILURES
    only = [name.strip() for name in options.only.split(",")] if options.only else list(usual)
    unknown = [name for name in only if name not in known]
    if unknown:
        parser.error(f"no failure is called {unknown[0]!r}: there are {', '.join(known)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends all processes of a flight
    outcomes = failing_flights.fly_all(
        options.seeds,
        simulated(only),
        STARTS_OF_OTHER_BOARDS if is_other else failing_flights.STARTS,
        {**WORLDS[options.world], "simulator.firmware": options.firmware},
        options.board,
        flown=_flown(options.json),
        minutes=options.minutes,
        keep=lambda outcomes: _write(options.json, outcomes),
    )
    if options.world == CLEAN and not is_other:
        outcomes += fly_really(options.real, only)
    found = report(outcomes)
    print(found.as_markdown())
    _write(options.json, outcomes)
    return 0 if all(target.met for target in found.targets) else 1


def _write(file: Path | None, outcomes: Sequence[Outcome]) -> None:
    """Write the report with every flight; NaN: it never happened."""
    if file is not None:
        flights = [{**asdict(o), "verdict": o.verdict} for o in outcomes]
        document = {**report(outcomes).as_json(), "flights": flights}
        file.write_text(json.dumps(document, indent=1) + "\n")


def _flown(file: Path | None) -> list[Outcome]:
    """Return the flights of a file that `_write` wrote; none if there is no file yet."""
    if file is None or not file.exists():
        return []
    names = [field.name for field in fields(Outcome)]
    flights = json.loads(file.read_text())["flights"]
    return [Outcome(**{name: one[name] for name in names}) for one in flights]


if __name__ == "__main__":
    sys.exit(main())
