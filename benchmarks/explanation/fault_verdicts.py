"""Flights with random faults, and pairs of them: is the verdict right although the truth is hidden?

    python -m benchmarks fault_verdicts --seed 10001 --flights 1000
    python -m benchmarks.explanation.fault_verdicts --seed 17 --flights 1 --rows FILE

Simulated time: an experiment is flown as by `quadlab fly`, and two logs are written, one without
the truth, as on a real vehicle. The verdict on that one is compared with the verdict on the other:
a flight that passed although its truth fails was *silently wrong*. Faults, their sizes and their
schedules follow from the seed; seeds below 10001 were used to find what to improve.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.explanation.diagnosis import FAULTS as NAMED
from benchmarks.explanation.explanations import WORLDS
from benchmarks.explanation.random_faults import draw, settings
from benchmarks.harness import Report, Row, Size, Target
from console.evaluation.findings import explain_log
from console.evaluation.result import FAILED, PASSED, Result
from console.evaluation.verdict import evaluated
from console.experiments import watched
from console.experiments.catalogue import find
from console.experiments.client import Experiment
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadrotor.errors import QuadlabError
from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.modes import MOTORS_ON
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

FLIGHTS, FIRST_SEED = 1000, 10001
EXPERIMENTS = {"hover": (4.0, 16.0), "figure_eight": (4.0, 28.0)}
"""Experiments, with the times in s between which a fault begins."""
SHARE = 0.6
"""Share of flights that hover."""
IMPACT, TURNED, AWAY = 1.0, 80.0, 2.0
"""Limits of a crash: speed at the ground, m/s; tilt, deg; distance beyond the flight volume, m."""
KINDS: dict[str, set[str]] = {}
"""Kinds of finding that name a fault, by its name."""
for _one in NAMED:
    KINDS.setdefault(_one.text.split()[0], set()).update(_one.kinds)
_PUSH, _TURN, _MOVED = {"outside_force", "thrust_off"}, {"outside_torque"}, {"tracker_jumped"}
_STRONG = {"outside_torque", "motor_strong"}
MORE: dict[str, set[str]] = {
    "imu.gaps": {"ended_in_flight"},
    "imu.misalignment": {"gyroscope_off"},
    "motors.fade": _STRONG,
    "motors.flicker": _STRONG,
    "simulator.corrupted_bytes": {"imu_gaps"},
    "simulator.lost_samples": {"imu_gaps"},
    "simulator.push_x": _PUSH,
    "simulator.push_z": _PUSH,
    "simulator.thrust_efficiency": {"thrust_off"},
    "tracker.attitude_noise": {"tracker_noisy"},
    "tracker.position_noise": {"tracker_noisy"},
    "tracker.handedness": {*_MOVED, "tracker_moved"},
    "tracker.scale": _MOVED,
    "tracker.swapped_bodies": _MOVED,
    "tracker.tilt": _MOVED,
    "vehicle.centre": _TURN,
    "world.updraught": _PUSH,
    "world.wake": _PUSH,
    "world.wall": _PUSH,
}
"""Further kinds: of faults that are drawn here alone, and of those that last for a moment."""
for _name, _kinds in MORE.items():
    KINDS.setdefault(_name, set()).update(_kinds)


@dataclass
class Outcome:
    """One flight.

    Attributes:
        verdict, true_verdict: of the log without the truth, and of that with it.
        worst: the figure that is the farthest beyond its limit, with the ratio to it, in truth.
        named: kinds of finding, the heaviest first. said: warnings and errors of the vehicle.
        ended: why the experiment ended early, empty if it did not.
    """

    seed: int
    experiment: str
    world: str
    faults: list[str]
    verdict: str = FAILED
    true_verdict: str = FAILED
    worst: tuple[str, float] = ("", 0.0)
    impact: float = 0.0
    tilt: float = 0.0
    away: float = 0.0
    named: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    ended: str = ""

    @property
    def is_silent(self) -> bool:
        """Return whether the verdict passed a flight whose truth fails."""
        return self.verdict == PASSED and (self.true_verdict != PASSED or self.is_crashed)

    @property
    def is_crashed(self) -> bool:
        return self.impact > IMPACT or self.tilt > TURNED or self.away > AWAY

    @property
    def is_named(self) -> bool:
        """Return whether one of the first two kinds names one of the faults."""
        kinds: set[str] = set().union(*(KINDS.get(text.split()[0], set()) for text in self.faults))
        return bool(kinds & set(self.named[:2]))


class Witnessed(FlightLog):
    """A log without the truth, and beside it another one with the truth."""

    def __init__(self, hidden: Path, whole: Path, vehicle: str, store: ParameterStore) -> None:
        super().__init__(hidden, vehicle, store, {"run_id": hidden.stem})
        self._whole = FlightLog(whole, vehicle, store, {"run_id": whole.stem})
        self.said: list[str] = []
        for name in ("tick", "message", "readings", "parameter_change", "pose", "put", "bearings"):
            setattr(self, name, self._twice(getattr(self, name), getattr(self._whole, name)))

    @staticmethod
    def _twice(one: Any, other: Any) -> Any:
        def both(*arguments: Any) -> None:
            one(*arguments)
            other(*arguments)

        return both

    def truth(self, stamp_ns: int, state: Record) -> None:
        self._whole.truth(stamp_ns, state)

    def event(self, event: mailbox.Event) -> None:
        if event.level >= mailbox.WARN:
            self.said.append(event.text)
        super().event(event)
        self._whole.event(event)

    def close(self) -> None:
        super().close()
        self._whole.close()


class Flight(SimulatedFlight):
    """A flight whose truth is watched."""

    impact = tilt = away = 0.0
    _was_high = False

    def advance(self) -> None:
        sinking = -float(self._simulated.truth["velocity_w"][0, 2])
        super().advance()
        x, y, z = self._true_position_w.tolist()
        _, a, b, _ = self._true_quaternion_wb.tolist()
        self.tilt = max(self.tilt, math.degrees(math.acos(1.0 - 2.0 * min(1.0, a * a + b * b))))
        self._was_high = self._was_high or z > 0.05
        if z < 0.005 and self._was_high:
            self.impact, self._was_high = max(self.impact, sinking), False
        p = self.parameters.behavior
        beyond = (p.volume_x_min - x, x - p.volume_x_max, p.volume_y_min - y, y - p.volume_y_max)
        self.away = max(self.away, *beyond, z - p.volume_z_max)


def fly(seed: int) -> Outcome:
    """Fly once; experiment, world, faults and their schedules follow from the seed."""
    chance = np.random.default_rng((seed, 43))
    name = "hover" if chance.random() < SHARE else "figure_eight"
    world = str(chance.choice(list(WORLDS)))
    faults = draw(chance, *EXPERIMENTS[name])
    out = Outcome(seed, name, world, [one.text for one in faults])
    experiment = find(name, "quad1")
    groups = {"experiment": experiment.parameters} if experiment.parameters else {}
    parameters = with_groups(FlightParameters().model_copy(deep=True), groups)
    parameters.seed(seed)
    store = ParameterStore(parameters)
    store.preset(dict(WORLDS[world]) | dict(settings(faults)))
    robot = SimulatedVehicle(parameters.simulator)
    with tempfile.TemporaryDirectory() as folder:
        hidden, whole = Path(folder) / "hidden.mcap", Path(folder) / "whole.mcap"
        log = Witnessed(hidden, whole, "quad1", store)
        flight = Flight(parameters, robot, log)
        try:
            watched.fly(experiment, flight)
        except QuadlabError as error:
            out.ended = str(error)
            _come_down(flight)
        finally:
            log.close()
            flight.stack.close()
            robot.close()
        out.impact, out.tilt, out.away = flight.impact, flight.tilt, flight.away
        out.said = list(dict.fromkeys(log.said))
        out.named = [one.kind for one in explain_log(hidden)]
        if not out.ended:
            out.verdict = _judged(experiment, hidden).verdict
            true = _judged(experiment, whole)
            out.true_verdict = true.verdict
            over = {k: true.metrics.get(k, math.nan) / v for k, v in true.limits.items() if v > 0.0}
            out.worst = max(over.items(), key=lambda one: one[1])
    return out


def _judged(experiment: Experiment, log: Path) -> Result:
    try:
        return evaluated(experiment, log)
    except QuadlabError:
        return Result(FAILED, {})


def _come_down(flight: Flight) -> None:
    """Land, and wait until the motors are off."""
    for _ in range(2):
        try:
            flight.wait_until(lambda v: not v.armed, what="motors off", timeout=20.0)
            return
        except QuadlabError:
            if flight.stack.mode in MOTORS_ON:
                _try(flight)


def _try(flight: Flight) -> None:
    try:
        flight.start("land")
    except QuadlabError:
        return  # it lands by itself, or is no longer in the air


def run(size: Size = Size.FULL, flights: int = FLIGHTS, seed: int = FIRST_SEED) -> Report:
    """Run the benchmark for `python -m benchmarks`, from the first seed on."""
    return report([fly(seed + k) for k in range(size.of(flights, 24, 2))])


def report(outcomes: Sequence[Outcome]) -> Report:
    """Return one row for each fault, alone or in a pair."""
    found = Report(
        "fault_verdicts",
        "Verdicts and causes where the truth is hidden",
        [
            f"{len(outcomes)} flights in simulated time, hover or figure 8, clean or rough world, "
            "with none, one or two faults of the library of random size and schedule",
            f"crashed: faster than {IMPACT:g} m/s at the ground, tilted by more than {TURNED:g}°, "
            f"or more than {AWAY:g} m outside the flight volume",
        ],
    )
    faulty = [one for one in outcomes if one.faults]
    healthy = [one for one in outcomes if not one.faults]
    for name in sorted({text.split()[0] for one in faulty for text in one.faults}):
        mine = [one for one in faulty if any(t.split()[0] == name for t in one.faults)]
        found.rows.append(Row(name, _figures(mine)))
    if healthy:
        found.rows.append(Row("no fault", _figures(healthy)))
    for one in outcomes:
        if one.is_silent or one.is_crashed:
            found.notes.append(
                f"seed {one.seed}, {one.experiment}, {one.world}, {'; '.join(one.faults)}: "
                f"{one.verdict}, truth {one.true_verdict}, {one.worst[0]} {one.worst[1]:.2f} times "
                f"its limit, {one.impact:.2f} m/s, {one.tilt:.0f}°, {one.away:.1f} m; named: "
                f"{', '.join(one.named[:3]) or 'nothing'}; said: {' / '.join(one.said[-4:])}"
            )
    found.targets.append(Target("silently wrong", sum(one.is_silent for one in outcomes), 0))
    found.targets.append(Target("crashed", sum(one.is_crashed for one in outcomes), 0))
    bad = [one for one in faulty if FAILED in (one.verdict, one.true_verdict)]
    for what, some in (("fault that fails a flight", bad), ("any fault", faulty)):
        if some:
            share = sum(one.is_named for one in some) / len(some)
            text = f"{what} is named first or second, share of {len(some)}"
            found.targets.append(Target(text, share, 0.85, at_most=False))
    if healthy:
        share = sum(not one.named for one in healthy) / len(healthy)
        text = f"nothing is named without a fault, share of {len(healthy)}"
        found.targets.append(Target(text, share, 0.95, at_most=False))
    return found


def _figures(some: Sequence[Outcome]) -> dict[str, float | str]:
    named = Counter(", ".join(one.named[:2]) or "nothing" for one in some)
    return {
        "flights": len(some),
        "passed, truth too": sum(o.verdict == o.true_verdict == PASSED for o in some),
        "failed": sum(PASSED not in (o.verdict, o.true_verdict) for o in some),
        "failed, truth passed": sum(o.verdict != PASSED and o.true_verdict == PASSED for o in some),
        "silently wrong": sum(o.is_silent for o in some),
        "crashed": sum(o.is_crashed for o in some),
        "named": sum(o.is_named for o in some),
        "named most often": "; ".join(f"{kinds} {n}" for kinds, n in named.most_common(3)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flights", type=int, default=24)
    parser.add_argument("--rows", type=Path, help="file that gets a line of JSON for each flight")
    words = parser.parse_args()
    outcomes = []
    for seed in range(words.seed, words.seed + words.flights):
        outcomes.append(fly(seed))
        if words.rows:
            with words.rows.open("a") as file:
                file.write(json.dumps(asdict(outcomes[-1])) + "\n")
    print(report(outcomes).as_markdown())


if __name__ == "__main__":
    main()
