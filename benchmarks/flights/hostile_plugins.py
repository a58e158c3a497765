"""Control laws and estimators that do harm in flight: does the vehicle fly on, and how soon does
the built-in one take over?

    python -m benchmarks hostile_plugins --flights 20

Each plugin is the example that `quadlab new` writes, which from a moment on raises, answers
nonsense, falls silent, dies or drifts. The vehicle hovers or flies the figure 8. It fell when it
sank below half of its height, tilted by more than 60 degrees, or stopped its motors within 3 s.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Target
from quadrotor.checkout import ROOT
from vehicle.estimators.estimators import Estimators
from vehicle.plugins.external import External

FLIGHTS = 20
"""Flights of each kind."""
WATCHED = 3.0
"""s from the beginning of the harm."""
HEIGHT, LOWEST, TILT = 1.0, 0.5, math.radians(60.0)
EXAMPLES = {
    "law": ("geometric_pid.py", "GeometricPid", "control.law", 7.0),
    "estimator": ("error_state_ekf.py", "ErrorStateEkf", "estimation.estimator", 11.0),
}
"""File, class, parameter, and the earliest time (s, the plugin's) at which harm begins: it hovers
by then."""
ANY = {
    "raises": "1 / 0",
    "stalls": "import time; time.sleep(10.0)",
    "is killed": "import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
    "crashes": "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
    "takes all memory": "self.hoard = bytearray(3 << 29)",
    "ends": "raise SystemExit",
    "wrong shape": "answer = (answer[0], np.zeros(7), *answer[2:])",
}
HARM = {
    "law": {
        **ANY,
        "NaN": "answer = (answer[0], answer[1] * np.nan)",
        "infinite": "answer = (np.inf, answer[1])",
        "too strong": "answer = (answer[0], answer[1] + [2.0, 0.0, 0.0])",
        "no thrust": "answer = (0.0, answer[1])",
        "creeps": "answer = (answer[0], answer[1] + [0.2 * since, 0.0, 0.0])",
    },
    "estimator": {
        **ANY,
        "NaN": "answer = (answer[0] * np.nan, *answer[1:])",
        "infinite": "answer = (answer[0], answer[1] + [np.inf, 0.0, 0.0], *answer[2:])",
        "jumps": "answer = (answer[0] + [1.0, 0.0, 0.0], *answer[1:])",
        "turned": "answer = (*answer[:2], answer[2][[1, 0, 3, 2]], *answer[3:])",
        "drifts": "answer = (answer[0] + [0.2 * since, 0.0, 0.0], *answer[1:])",
        "freezes": "self.kept = getattr(self, 'kept', answer); answer = self.kept",
    },
}
SOURCE = """
class Hostile({name}):
    def step(self, x):
        answer, since = super().step(x), x.time - {begin}
        if since > 0.0:
            {harm}
        return answer


{kind} = Hostile
"""


@dataclass(frozen=True)
class Outcome:
    """The outcome of one flight.

    Attributes:
        ticks: from the input at which harm begins to the tick that the built-in one flies; NaN
            when it never did. lowest: m. away: m, farthest from the reference afterwards.
    """

    fell: bool
    ticks: float
    lowest: float
    away: float
    why: str


def fly(kind: str, harm: str, seed: int) -> Outcome:
    """Fly one flight; it flies the figure 8 when the seed is odd."""
    file, name, parameter, earliest = EXAMPLES[kind]
    begin = earliest + float(np.random.default_rng((seed, 22)).uniform(0.0, 2.0))
    text = (ROOT / "examples" / f"{kind}s" / file).read_text()
    with tempfile.TemporaryDirectory() as folder:
        source = SOURCE.format(name=name, begin=begin, harm=HARM[kind][harm], kind=kind)
        (Path(folder) / "hostile.py").write_text(text + source)
        flight = _begun(kind, seed, Path(folder), {parameter: "hostile"})
        ticks = math.nan
        external = _external(flight, kind)
        try:
            while (begun := external) is not None and begun._out["time"].item() <= begin:
                flight.advance()
                external = _external(flight, kind)
            flight.forget()
            lowest, end_ns, count = math.inf, flight.robot.stamp_ns + round(WATCHED * 1e9), 0
            while flight.robot.stamp_ns < end_ns:
                flight.advance()
                count += 1
                lowest = min(lowest, flight.height)
                external = _external(flight, kind)
                if math.isnan(ticks) and (external is None or external.failure):
                    ticks = count
            _, places, wanted = flight.trace()
        finally:
            flight.stack.close()
    why = next((line for line in flight.events.texts if "disengaged" in line), "not disengaged")
    fell = lowest < LOWEST or flight.most_tilted > TILT or not flight.airborne
    away = float(np.linalg.norm(places - wanted, axis=1).max())
    return Outcome(fell, ticks, lowest, away, why)


def _begun(kind: str, seed: int, folder: Path, settings: dict[str, str]) -> WatchedFlight:
    Estimators(folder).offer()
    flight = WatchedFlight(seed, {**settings}, plugins=folder)
    Estimators().offer()
    flight.hover(HEIGHT, 0.2)
    if seed % 2:
        flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
    return flight


def _external(flight: WatchedFlight, kind: str) -> External | None:
    if kind == "law":
        return flight.stack.law.external
    return next(iter(flight.stack.navigation.externals), None)


def run(quick: bool = False, flights: int = FLIGHTS, seed: int = 1) -> Report:
    """Run the benchmark for `python -m benchmarks`, from the first seed on."""
    count = 2 if quick else flights
    found = Report(
        "hostile_plugins",
        "Control laws and estimators that do harm",
        [
            f"{count} flights of each kind, hover and figure 8 in turns, 500 Hz; ticks: from the "
            "input at which harm begins to the tick that the built-in one flies"
        ],
    )
    fallen = late = 0
    for kind, harms in HARM.items():
        for harm in harms:
            outcomes = [fly(kind, harm, seed + k) for k in range(count)]
            ticks = [o.ticks for o in outcomes]
            fell = sum(o.fell for o in outcomes)
            fallen, late = fallen + fell, late + sum(map(math.isnan, ticks))
            figures: dict[str, float | str] = {
                "flights": float(count),
                "fell": float(fell),
                "ticks, median": float(np.median(ticks)),
                "ticks, most": max(ticks),
                "farthest, m": max(o.away for o in outcomes),
            }
            found.rows.append(Row(f"{kind} {harm}", figures))
            found.notes.append(f"{kind} {harm}: {outcomes[0].why}")
    found.targets.append(Target("falls", fallen, 0))
    found.targets.append(Target("flights without a rescue", late, 0))
    return found
