"""Plugins that do harm in flight: does the vehicle fly on, and how soon is the plugin out?

    python -m benchmarks hostile_plugins --flights 20
    python -m benchmarks hostile_plugins --flights 4 --only sensor
    python -m benchmarks hostile_plugins --flights 20 --only "law raises"

Each plugin is the example that `quadlab new` writes, which from a moment on raises, answers
nonsense, falls silent, dies or drifts. The vehicle hovers or flies the figure 8, with a behavior
the path of the plugin. It fell when it sank below half of its height, or with a behavior to 5 cm,
tilted by more than 60 degrees, or stopped its motors within 3 s. Answers that are late by a number
of ticks are those of a vehicle in real time, which waits for nothing; elsewhere simulated time
waits up to 1 s.

An answer that is merely wrong is usable until it is beyond a bound (`control.plugin`,
`estimation.plugin`). For laws and estimators that drift there is therefore a second count: from the
first tick in which the answer, or the flight on it, is beyond a bound by the benchmark's own
arithmetic; 0 is that tick.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from quadrotor.checkout import ROOT
from quadrotor.records import Record
from vehicle.estimators.external import ExternalEstimator
from vehicle.laws.external import ExternalLaw
from vehicle.plugins.external import External

PERIOD = 0.002
FLIGHTS = 20
"""Flights of each kind."""
WATCHED = 3.0, 3.0, 0.2
"""s from the beginning of the harm."""
HEIGHT, TILT = 1.0, math.radians(60.0)
LOWEST = {"law": 0.5, "estimator": 0.5, "behavior": 0.05, "sensor": 0.5}
"""Height, m, below which it fell; a behavior may lead it down to the floor of the flight volume."""
EXAMPLES = {
    "law": ("geometric_pid.py", "GeometricPid", "control.law", 7.0),
    "estimator": ("error_state_ekf.py", "ErrorStateEkf", "estimation.estimator", 11.0),
    "behavior": ("sway.py", "Sway", "behavior.plugin", 1.0),
    "sensor": ("barometer.py", "Barometer", "estimation.sensors", 11.0),
}
"""File, class, parameter, and the earliest time (s, the plugin's) at which harm begins: it hovers
by then. The time of a behavior passes only while it flies."""
LATE = {"answers after 1 ms": 0, "answers after 5 ms": 2, "answers after 100 ms": 50}
"""Ticks by which every answer comes too late in real time."""
HARMLESS = ("answers after 1 ms", "answers a little off")
"""Kinds that must not be disengaged."""
ANY = {
    "raises": "1 / 0",
    "stalls": "import time; time.sleep(10.0)",
    "is killed": "import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
    "crashes": "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
    "takes all memory": "self.hoard = bytearray(3 << 29)",
    "ends": "raise SystemExit",
    "wrong shape": "answer = (answer[0], np.zeros(7), *answer[2:])",
    **dict.fromkeys(LATE, "pass"),
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
    "behavior": {
        **ANY,
        "NaN": "answer = (answer[0] * np.nan, *answer[1:])",
        "infinite": "answer = (answer[0], answer[1] + [np.inf, 0.0, 0.0], *answer[2:])",
        "jumps": "answer = (answer[0] + [0.5, 0.0, 0.0], *answer[1:])",
        "runs away": "answer = (answer[0] + [4.0 * since, 0.0, 0.0], *answer[1:])",
        "sinks": "answer = (answer[0] - [0.0, 0.0, 4.0 * since], *answer[1:])",
    },
    "sensor": {
        **ANY,
        "wrong shape": "answer = [Reading(np.zeros(7), height, 0.1)]",
        "NaN": "answer = Reading(np.nan, height, 0.1)",
        "infinite": "answer = Reading(np.inf, height, 0.1)",
        "jumps": "answer = Reading(x.position_w[2] + 1.0, height, 0.01)",
        "drifts": "answer = Reading(1.0 + 0.2 * since, height, 0.001)",
        "creeps": "answer = Reading(x.position_w[2] + 0.02, height, 0.001)",
        "from the future": "answer = Reading(1.0, height, 0.1, x.time + 1.0)",
        "answers a little off": "answer = Reading(x.position_w[2] + 0.01, height, 0.1)",
    },
}
SOURCE = """
import numpy as np


def height(position_w, quaternion_wb):
    return position_w[2]


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
            when it never did. beyond: the same from the first tick beyond a bound; NaN when the
            benchmark knows none. lowest: m. away: m, farthest from the reference afterwards.
    """

    fell: bool
    ticks: float
    beyond: float
    lowest: float
    away: float
    why: str


class Seen:
    """A link that keeps the newest answer."""

    def __init__(self, external: External) -> None:
        self._link, self._type = external._link, external._contract.outputs
        self.answer: Record | None = None

    def ready(self) -> bool:
        return self._link.ready()

    def send(self, data: bytes) -> None:
        self._link.send(data)

    def receive(self) -> bytes | None:
        data = self._link.receive()
        if data is not None and len(data) == self._type.itemsize:
            self.answer = np.frombuffer(data, self._type)[0]
        return data

    def close(self) -> None:
        self._link.close()


class Late:
    """A link whose answers come later by a number of ticks; nothing waits for them."""

    def __init__(self, external: External, ticks: int) -> None:
        self._link, self._ticks = external._link, ticks
        # The answer to the last input, which was sent over the link itself, is on its way.
        self._answers: list[bytes | None] = [*[None] * ticks, self._link.receive()]
        external._waits = False

    def ready(self) -> bool:
        return self._link.ready()

    def send(self, data: bytes) -> None:
        self._link.send(data)
        self._answers.append(self._link.receive())

    def receive(self) -> bytes | None:
        return self._answers.pop(0) if len(self._answers) > self._ticks else None

    def close(self) -> None:
        self._link.close()


def fly(kind: str, harm: str, seed: int, watched: float) -> Outcome:
    """Fly one flight; it flies the figure 8 when the seed is odd."""
    file, name, parameter, earliest = EXAMPLES[kind]
    begin = earliest + float(np.random.default_rng((seed, 22)).uniform(0.0, 2.0))
    text = (ROOT / "examples" / f"{kind}s" / file).read_text()
    with tempfile.TemporaryDirectory() as folder:
        source = SOURCE.format(name=name, begin=begin, harm=HARM[kind][harm], kind=kind)
        (Path(folder) / "hostile.py").write_text(text + source)
        flight = _begun(kind, seed, Path(folder), {parameter: "hostile"})
        ticks = first = math.nan
        external = _external(flight, kind)
        try:
            while (begun := external) is not None and begun._out["time"].item() <= begin:
                flight.advance()
                external = _external(flight, kind)
            if external is not None and harm in LATE:
                external._link = Late(external, LATE[harm])
            seen = Seen(begun) if begun is not None else None
            if begun is not None and seen is not None and external is not None:
                external._link = seen
            flight.forget()
            lowest, end_ns, count = math.inf, flight.robot.stamp_ns + round(watched * 1e9), 0
            while flight.robot.stamp_ns < end_ns:
                flight.advance()
                count += 1
                lowest = min(lowest, flight.height)
                external = _external(flight, kind)
                if math.isnan(ticks) and begun is not None and seen is not None:
                    if math.isnan(first) and _is_beyond(flight, begun, seen.answer):
                        first = count
                    if external is None or external.failure:
                        ticks = count
            _, places, wanted = flight.trace()
        finally:
            flight.stack.close()
    why = next((line for line in flight.events.texts if "disengaged" in line), "not disengaged")
    fell = lowest < LOWEST[kind] or flight.most_tilted > TILT or not flight.airborne
    away = float(np.linalg.norm(places - wanted, axis=1).max())
    return Outcome(fell, ticks, ticks - first, lowest, away, why)


def _is_beyond(flight: WatchedFlight, external: External, answer: Record | None) -> bool:
    """Return whether what was answered, or the flight on it, is beyond a bound in this tick."""
    p = flight.stack.parameters
    if isinstance(external, ExternalLaw):
        away = flight.stack.reference["position_w"] - flight.stack.state["position_w"]
        return float(np.linalg.norm(away)) > p.control.plugin.distance_max
    if not isinstance(external, ExternalEstimator) or answer is None:
        return False
    built_in, bounds = external.built_in.state[0], p.estimation.plugin
    now_w = answer["position_w"] + answer["velocity_w"] * PERIOD
    position = float(np.linalg.norm(now_w - built_in["position_w"]))
    velocity = float(np.linalg.norm(answer["velocity_w"] - built_in["velocity_w"]))
    return position > bounds.position_max or velocity > bounds.velocity_max


def _begun(kind: str, seed: int, folder: Path, settings: dict[str, str]) -> WatchedFlight:
    if kind == "sensor":
        settings["estimation.estimator"] = "error_state"
    flight = WatchedFlight(seed, {**settings}, plugins=folder)
    flight.hover(HEIGHT, 0.2)
    if kind == "behavior":
        flight.start("external")
    elif seed % 2:
        flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
    return flight


def _external(flight: WatchedFlight, kind: str) -> External | None:
    stack = flight.stack
    if kind == "law":
        return stack.law.external
    if kind == "behavior":
        return stack.own_behaviors.external
    several = stack.own_sensors.externals if kind == "sensor" else stack.navigation.externals
    return next(iter(several), None)


def _of(values: Sequence[float], figure: Callable[[list[float]], Any]) -> float | str:
    """Return the figure of those values that exist, "-" if there are none."""
    known = [value for value in values if not math.isnan(value)]
    return float(figure(known)) if known else "-"


def run(size: Size = Size.FULL, flights: int = FLIGHTS, seed: int = 1, only: str = "") -> Report:
    """Run the benchmark for `python -m benchmarks`, from the first seed on; of one kind of plugin,
    or one harm ("law raises"), if it is named."""
    count = size.of(flights, 2, 1)
    found = Report(
        "hostile_plugins",
        "Plugins that do harm",
        [
            f"{count} flights of each kind, hover and figure 8 in turns, 500 Hz; ticks: from the "
            "input at which harm begins to the tick that flies without the plugin; after a bound: "
            "from the tick in which it was exceeded"
        ],
    )
    fallen = late = 0
    chosen, _, one = only.partition(" ")
    for kind, harms in size.some(HARM.items(), 2) if not only else ((chosen, HARM[chosen]),):
        for harm in [one] if one else size.some(harms):
            outcomes = [fly(kind, harm, seed + k, size.of(*WATCHED)) for k in range(count)]
            ticks = [o.ticks for o in outcomes]
            fell, kept = sum(o.fell for o in outcomes), sum(map(math.isnan, ticks))
            fallen, late = fallen + fell, late + (count - kept if harm in HARMLESS else kept)
            figures: dict[str, float | str] = {
                "flights": float(count),
                "fell": float(fell),
                "ticks, median": _of(ticks, np.median),
                "ticks, most": _of(ticks, np.max),
                "after a bound, most": _of([o.beyond for o in outcomes], np.max),
                "farthest, m": max(o.away for o in outcomes),
            }
            found.rows.append(Row(f"{kind} {harm}", figures))
            reasons = dict.fromkeys(
                o.why for o in outcomes if math.isnan(o.ticks) or o is outcomes[0]
            )
            found.notes += [f"{kind} {harm}: {why}" for why in reasons]
    found.targets.append(Target("falls", fallen, 0))
    found.targets.append(Target("flights with a wrong judgement of the plugin", late, 0))
    return found
