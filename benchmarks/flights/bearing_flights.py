"""Flights on bearings alone, closed loop: accuracy, and the outcome when bearings fail.

    python -m benchmarks bearing_flights

Every flight is the experiment `bearings` of `quadlab fly`, 60 s at 1 m, evaluated from its log. A
fault begins 5 s after the hand-over and persists, unless its name says otherwise.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from console.experiments.bearings import BearingsExperiment
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import LogFormatError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle import mailbox
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

SEEDS = 12
FAULT_AFTER_NS = 5_000_000_000
EXCHANGED = "1 -1.0 1.0 0.1; 2 1.0 1.0 0.1; 3 -1.0 -1.0 0.1; 4 1.0 -1.0 0.1"
"""The paper's beacons, with the first two exchanged."""


@dataclass(frozen=True)
class Fault:
    """A fault of emulator and tracker, which ends after `ends` s, 0 for never."""

    name: str
    bearings: dict[str, Any] = field(default_factory=dict)
    ends: float = 0.0


FAULTS = (
    *(Fault(f"late by {ms} ms", {"delay": ms / 1e3}) for ms in (50, 100, 150)),
    *(Fault(f"{share:.0%} dropped", {"drop_out": share}) for share in (0.25, 0.5)),
    Fault("identities swapped in 10 % of frames", {"swap": 0.1}),
    Fault("identities swapped in all frames", {"swap": 1.0}),
    Fault("two beacons taken for each other", {"layout": EXCHANGED}),
    Fault("turned by 8 deg", {"bias_x": 8.0}),
    Fault("one beacon lost", {"lost": "2"}),
    Fault("all lost for 2 s", {"lost": "all"}, 2.0),
)

MANOEUVRES = (
    ("error_state", "hover", "auto"),
    ("error_state", "figure_eight", "auto"),
    ("error_state", "sticks", "auto"),
    ("complementary", "hover", "auto"),
    ("complementary", "figure_eight", "auto"),
    ("complementary", "sticks", "auto"),
    ("complementary", "hover", "paper"),
    ("complementary", "figure_eight", "paper"),
)


class WatchedFlight(SimulatedFlight):
    """A flight that injects the fault and records the vehicle's true motion.

    Attributes:
        left: whether the vehicle was outside its flight volume.
        turned_over: whether it tilted beyond 60 deg.
        hardest: largest speed of a touch-down, m/s.
        farthest: m, sideways from x = y = 0.
        events: texts of the vehicle's events.
    """

    def __init__(self, *arguments: Any, fault: Fault, tracker: bool) -> None:
        super().__init__(*arguments)
        self._fault, self._keep_tracker = fault, tracker
        self.events: list[str] = []
        self._since_ns: int | None = None
        self._state = 0
        self.left = self.turned_over = False
        self.hardest = self.farthest = 0.0
        self._airborne, self._speed = False, 0.0
        p = self.parameters.behavior
        self._low = np.array([p.volume_x_min, p.volume_y_min, -0.05])
        self._high = np.array([p.volume_x_max, p.volume_y_max, p.volume_z_max])

    def advance(self) -> None:
        super().advance()
        now_ns, bearings = self.stack.stamp_ns, self.parameters.bearings
        if self._since_ns is None:
            if self.parameter("estimation.source") == "bearings":
                self._since_ns = now_ns
                self._good = {name: getattr(bearings, name) for name in self._fault.bearings}
        elif self._state == 0 and now_ns > self._since_ns + FAULT_AFTER_NS:
            self._state = 1
            for name, value in self._fault.bearings.items():
                setattr(bearings, name, value)
            if not self._keep_tracker:
                self.parameters.tracker.drop_out = 1.0
        elif (
            self._state == 1
            and self._fault.ends
            and now_ns > self._since_ns + FAULT_AFTER_NS + round(1e9 * self._fault.ends)
        ):
            self._state = 2
            for name, value in self._good.items():
                setattr(bearings, name, value)
        self._watch()

    def _drain_outbox(self) -> None:
        self.events += [m.text for m in self.stack.outbox if isinstance(m, mailbox.Event)]
        super()._drain_outbox()

    def _watch(self) -> None:
        position_w = self._true_position_w
        if not ((position_w >= self._low) & (position_w <= self._high)).all():
            self.left = True
        self.farthest = max(self.farthest, math.hypot(position_w.item(0), position_w.item(1)))
        x, y = self._true_quaternion_wb.tolist()[1:3]
        if 1.0 - 2.0 * (x * x + y * y) < 0.5:
            self.turned_over = True
        airborne = position_w.item(2) > 0.03
        if self._airborne and not airborne:
            self.hardest = max(self.hardest, self._speed)
        self._airborne = airborne
        self._speed = float(np.linalg.norm(self._simulated.truth["velocity_w"][0]))


@dataclass
class Outcome:
    """The outcome of one flight.

    `end` is "on bearings", "on the tracker", "landed by itself" or a refusal.
    """

    end: str
    metrics: dict[str, float]
    limits: dict[str, float]
    left: bool
    turned_over: bool
    hardest: float
    farthest: float


def fly(
    folder: Path,
    seed: int,
    options: dict[str, Any],
    fault: Fault | None = None,
    tracker: bool = True,
    settings: Mapping[str, ParameterValue] | None = None,
) -> Outcome:
    """Fly the experiment once with these options and settings."""
    parameters = FlightParameters().model_copy(deep=True)
    parameters.seed(seed)
    ParameterStore(parameters).preset(dict(settings or {}))
    experiment = BearingsExperiment()
    for name, value in options.items():
        setattr(experiment.parameters, name, value)
    experiment.parameters.sticks_seed = seed
    path = folder / "flight.mcap"
    path.unlink(missing_ok=True)
    simulated = SimulatedVehicle(parameters.simulator)
    log = FlightLog(path, "quad1", ParameterStore(parameters), {"experiment": "bearings"})
    flight = WatchedFlight(
        parameters, simulated, log, fault=fault or Fault("none"), tracker=tracker
    )
    end = ""
    try:
        experiment.fly(flight)
    except RefusedError as error:
        end = f"refused: {error}"
    finally:
        log.close()
    try:
        result = experiment.evaluate(path)
        metrics, limits = dict(result.metrics), dict(result.limits)
    except LogFormatError as error:
        metrics, limits, end = {}, {}, end or str(error)
    if not end:
        end = _end(flight.events)
    return Outcome(
        end, metrics, limits, flight.left, flight.turned_over, flight.hardest, flight.farthest
    )


def _rms_over_limit(outcome: Outcome) -> float:
    """Return the position error relative to the limit that the flight's own sensor allows."""
    name = "position_rms_m"
    return outcome.metrics.get(name, math.inf) / outcome.limits.get(name, math.inf)


def _end(events: list[str]) -> str:
    if any(text.startswith("emergency land") for text in events):
        return "landed by itself"
    if any(text.startswith("fell back") for text in events):
        return "on the tracker"
    return "on bearings"


def run(size: Size = Size.FULL) -> Report:
    return run_with(size, print)


def run_with(size: Size, say: Callable[[str], object]) -> Report:
    """Return the report; `say` is called with each row as it is found."""
    seeds, duration = size.of((SEEDS, 60.0), (3, 20.0), (1, 5.0))
    report = Report(
        "bearing_flights",
        "Flown on bearings alone",
        [
            f"{seeds} seeds, {duration:g} s each, h = 1 m, 4 beacons as in Sec. 7, 30 Hz, 1.5 deg, "
            "full sensors, control gains `standard`",
            "rms of a row: mean and worst of its flights; a fault begins 5 s after the hand-over",
        ],
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for estimator, manoeuvre, gains in size.some(MANOEUVRES, 3):
            options = {
                "estimator": estimator,
                "manoeuvre": manoeuvre,
                "gains": gains,
                "duration": duration,
            }
            outcomes = [fly(folder, seed, options) for seed in range(1, seeds + 1)]
            label = f"{estimator}, {manoeuvre}" + (", the paper's gains" if gains != "auto" else "")
            _add_manoeuvre(report, label, outcomes)
            if gains == "auto":
                worst = max(_rms_over_limit(one) for one in outcomes)
                report.targets.append(Target(f"{label}, worst rms over its limit", worst, 1.0))
            say(str(report.rows[-1]))
        good = total = 0
        for estimator in size.some(("error_state", "complementary")):
            for tracker in (True, False):
                for fault in size.some(FAULTS):
                    options = {"estimator": estimator, "duration": size.of(20.0, 20.0, 5.5)}
                    outcomes = [
                        fly(folder, seed, options, fault, tracker) for seed in range(1, seeds + 1)
                    ]
                    with_ = "tracker there" if tracker else "tracker lost too"
                    _add_fault(report, f"{estimator}, {fault.name}, {with_}", outcomes)
                    good += sum(_safe(one) for one in outcomes)
                    total += len(outcomes)
                    say(str(report.rows[-1]))
    report.targets.append(
        Target("share of faulty flights flown or landed inside", good / total, 1.0, at_most=False)
    )
    return report


def _safe(one: Outcome) -> bool:
    return not (one.left or one.turned_over or one.hardest > 1.0 or one.end.startswith("refused"))


def _add_manoeuvre(report: Report, label: str, outcomes: list[Outcome]) -> None:
    def values(name: str) -> list[float]:
        return [one.metrics.get(name, np.inf) for one in outcomes]

    report.rows.append(
        Row(
            label,
            {
                "tracking rms, mm": 1e3 * float(np.mean(values("position_rms_m"))),
                "worst": 1e3 * max(values("position_rms_m")),
                "largest error, mm": 1e3 * max(values("position_max_m")),
                "estimate, mm": 1e3 * float(np.mean(values("estimate_position_rms_m"))),
                "mm/s": 1e3 * float(np.mean(values("estimate_velocity_rms_m_s"))),
                "deg": float(np.mean(values("estimate_attitude_rms_deg"))),
                "saturated": max(values("saturated_share")),
                **_counts(outcomes),
            },
        )
    )


def _add_fault(report: Report, label: str, outcomes: list[Outcome]) -> None:
    figures: dict[str, float | str] = {
        "farthest from its place, mm": 1e3 * max(one.farthest for one in outcomes),
        "ground met at, m/s": max(one.hardest for one in outcomes),
    }
    report.rows.append(Row(label, figures | _counts(outcomes)))


def _counts(outcomes: list[Outcome]) -> dict[str, float | str]:
    def count(end: str) -> int:
        return sum(one.end == end for one in outcomes)

    return {
        "flown": count("on bearings"),
        "fell back": count("on the tracker"),
        "landed itself": count("landed by itself"),
        "left or crashed": sum(not _safe(one) for one in outcomes),
    }
