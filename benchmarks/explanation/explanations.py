"""Flights with one fault each, and without: whether the explanation names the fault first.

    python -m benchmarks explanations

Simulated time: real stack, simulated firmware and plant, full sensors. The fault occurs in flight,
10 s after the start; the log is read and explained as for a report.
"""

from __future__ import annotations

import random
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.harness import Report, Row, Size, Target
from console.evaluation.findings import Finding, explain_log
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.simulator.presets import ROUGH
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

SEEDS = range(101, 113)
"""Seeds that were not used while the limits were chosen (those were 1 to 9)."""
WORLDS: dict[str, dict[str, ParameterValue]] = {
    "clean": {},
    "rough": {"model.drag": 0.47, **{f"simulator.{name}": value for name, value in ROUGH.items()}},
}
MANOEUVRES = ("hover", "figure 8", "manual")
NAMES = {
    "motor": ("motor_weak",),
    "late tracker": ("tracker_late",),
    "tracker gaps": ("tracker_gaps",),
    "outliers": ("tracker_outliers",),
    "biased beacon": ("beacon_off",),
    "turned bearings": ("bearings_disagree", "fell_back"),
    "link cut": ("link_lost",),
    "battery": ("battery_sag",),
    "gust": ("off_reference", "saturation"),
    "vibration": ("vibration",),
}
"""Faults, each with the kinds of finding that name it."""
ON_BEARINGS = ("biased beacon", "turned bearings")
"""Faults that are flown on bearings."""
NONE = "nothing"


class FaultyFlight(SimulatedFlight):
    """A flight whose station can be disconnected."""

    is_cut = False

    def _station(self, now_ns: int) -> None:
        if not self.is_cut:
            super()._station(now_ns)
        else:
            self._log.truth(now_ns, self._simulated.truth)


def run(size: Size = Size.FULL) -> Report:
    """Return the confusion matrix of faults and the kinds named first."""
    return confusion(SEEDS[: size.of(len(SEEDS), 2, 1)], size.some(NAMES, 2))


def confusion(seeds: Sequence[int], faults: Sequence[str]) -> Report:
    report = Report(
        "explanations",
        "What the explanation names first",
        [
            f"simulated time, {len(seeds)} seeds of each fault, in turns in the clean and the "
            "rough world and in hover, figure 8 and flight by sticks",
            "motor 10 to 20 % weaker; poses 60 to 100 ms late; gaps of 0.5 to 0.9 s; 5 to 20 % "
            "outliers of 0.5 m; link cut for 1 to 3 s; battery 4.5 to 7 % full; a push of 6 to "
            "12 N for 1 s; vibration of 4 to 8 m/s²",
            "flown on bearings: a beacon 0.15 to 0.3 m from its place; all bearings turned by 2.5 "
            "to 5° about z",
        ],
    )
    right = total = 0
    for fault in faults:
        kinds, first = NAMES[fault], Counter[str]()
        for seed in seeds:
            found = fly(fault, seed, *condition(seed))
            first[found[0].kind if found else NONE] += 1
        right += sum(first[kind] for kind in kinds)
        total += len(seeds)
        report.rows.append(_row(fault, first, sum(first[kind] for kind in kinds)))
    first, claimed, flights = Counter(), 0, 0
    for seed in seeds:
        for other in (seed, seed + 5):  # two of the six conditions
            found = fly(NONE, seed, *condition(other))
            first[found[0].kind if found else NONE] += 1
            claimed += bool(found)
            flights += 1
    report.rows.append(_row("no fault", first, first[NONE]))
    report.targets += [
        Target("fault named first, share", right / total, 0.9, at_most=False),
        Target("flights without a fault in which anything is claimed", claimed / flights, 0.05),
    ]
    return report


def condition(seed: int) -> tuple[str, str]:
    """Return world and manoeuvre of a seed; seeds cycle through all six."""
    return list(WORLDS)[seed % 2], MANOEUVRES[seed // 2 % 3]


def _row(fault: str, first: Counter[str], right: int) -> Row:
    named = ", ".join(f"{kind} {count}" for kind, count in first.most_common())
    return Row(fault, {"flights": first.total(), "right": right, "named first": named})


def fly(fault: str, seed: int, world: str, manoeuvre: str) -> list[Finding]:
    """Fly with a fault, and return the explanation of the log."""
    chance = random.Random(seed)
    parameters = FlightParameters().model_copy(deep=True)
    parameters.seed(seed)
    settings = dict(WORLDS[world])
    if fault in ON_BEARINGS:
        settings |= {"estimation.shadow": "error_state", "estimation.shadow_source": "bearings"}
    if fault == "biased beacon":
        away = 1.0 + random.Random(seed).uniform(0.15, 0.3)
        settings["beacons.layout"] = f"1 1 1 0; 2 -1 1 0; 3 -1 -1 0; 4 {away:.3f} -1 0"
    store = ParameterStore(parameters)
    store.preset(settings)
    robot = SimulatedVehicle(parameters.simulator)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        log = FlightLog(path, "quad1", store, {"run_id": "flight"})
        flight = FaultyFlight(parameters, robot, log)
        try:
            take_off(flight, manoeuvre, on_bearings=fault in ON_BEARINGS)
        except RefusedError:
            log.close()
            raise
        try:
            flight.wait(3.0)
            for wait in _faulty(fault, flight, chance):
                _steer(flight, manoeuvre, chance, wait)
            flight.start("land")
            flight.wait_until(lambda v: not v.armed, what="landed", timeout=30.0)
        except RefusedError:
            pass  # it landed by itself
        finally:
            log.close()
        return explain_log(path)


def take_off(flight: SimulatedFlight, manoeuvre: str, *, on_bearings: bool) -> None:
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20.0)
    flight.wait(0.5)
    flight.arm()
    flight.wait(1.0)
    flight.start("take_off", height=1.2)
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30.0)
    if on_bearings:
        flight.wait(5.0)
        flight.change({"estimation.estimator": "error_state", "estimation.source": "bearings"})
    if manoeuvre == "figure 8":
        flight.start("follow_trajectory", trajectory="figure_eight", laps=4, period=8.0)
    elif manoeuvre == "manual":
        flight.start("velocity")


def _steer(flight: SimulatedFlight, manoeuvre: str, chance: random.Random, seconds: float) -> None:
    """Fly for a time; in manual flight with gentle sticks that change each second."""
    if manoeuvre != "manual" or flight.view().behavior != "velocity":
        flight.wait(seconds)
        return
    for k in range(round(10 * seconds)):
        if k % 10 == 0:
            place = flight.stack.state["position_w"][0]
            aims = [
                chance.uniform(-0.3, 0.3) - 0.4 * float(x) for x in (*place[:2], place[2] - 1.2)
            ]
        flight.sticks((*aims, 0.0))
        flight.wait(0.1)


def _faulty(fault: str, flight: FaultyFlight, chance: random.Random) -> Iterator[float]:
    """Inject a fault; yield the seconds to continue the flight."""
    tracker = flight.parameters.tracker

    def disturb(**values: float) -> None:
        changed = flight.parameters.simulator.model_copy(update=values)
        flight.parameters.simulator = changed
        flight._simulated.configure(changed)

    if fault == "motor":
        name = chance.choice(("front", "left", "rear", "right"))
        disturb(**{f"motor_gain_{name}": chance.uniform(0.8, 0.9)})
    elif fault == "late tracker":
        tracker.delay = chance.uniform(0.06, 0.1)
    elif fault == "outliers":
        tracker.outliers = chance.uniform(0.05, 0.2)
    elif fault == "battery":
        disturb(battery_charge=chance.uniform(0.045, 0.07))
    elif fault == "turned bearings":
        flight.parameters.bearings.bias_z = chance.choice((-1.0, 1.0)) * chance.uniform(2.5, 5.0)
    elif fault == "vibration":
        disturb(vibration=chance.uniform(4.0, 8.0))
    elif fault == "tracker gaps":
        for _ in range(3):
            tracker.drop_out = 1.0
            yield chance.uniform(0.5, 0.9)
            tracker.drop_out = 0.0
            yield 3.0
    elif fault == "link cut":
        flight.is_cut = True
        yield chance.uniform(1.0, 3.0)
        flight.is_cut = False
    elif fault == "gust":
        angle, force = chance.uniform(0.0, 6.28), chance.uniform(6.0, 12.0)
        flight._simulated.disturb((force, 0.0, 0.0) if angle < 3.14 else (0.0, force, 0.0))
        yield 1.0
        flight._simulated.disturb((0.0, 0.0, 0.0))
    yield 12.0
