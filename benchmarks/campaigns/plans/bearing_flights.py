"""The experiment `bearings`, with a fault of emulator and tracker after the hand-over."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.flights.watched_flight import Observed
from console.evaluation.flight_checks import EMERGENCIES
from console.evaluation.result import Result
from console.experiments.bearings import BearingsExperiment, BearingsOptions
from console.experiments.client import Client
from quadrotor.errors import LogFormatError
from quadrotor.parameters import parameter

AFTER_NS = 5_000_000_000
EXCHANGED = "1 -1.0 1.0 0.1; 2 1.0 1.0 0.1; 3 -1.0 -1.0 0.1; 4 1.0 -1.0 0.1"
"""The paper's beacons, with the first two exchanged."""
NONE = "none"
FAULTS: dict[str, tuple[dict[str, Any], float]] = {
    NONE: ({}, 0.0),
    **{f"late by {ms} ms": ({"delay": ms / 1e3}, 0.0) for ms in (50, 100, 150)},
    **{f"{share:.0%} dropped": ({"drop_out": share}, 0.0) for share in (0.25, 0.5)},
    "identities swapped in 10 % of frames": ({"swap": 0.1}, 0.0),
    "identities swapped in all frames": ({"swap": 1.0}, 0.0),
    "two beacons taken for each other": ({"layout": EXCHANGED}, 0.0),
    "turned by 8 deg": ({"bias_x": 8.0}, 0.0),
    "one beacon lost": ({"lost": "2"}, 0.0),
    "all lost for 2 s": ({"lost": "all"}, 2.0),
}
"""Parameters of the bearings, and s after which they are as before, 0 for never."""
ENDS = "flown", "fell_back", "landed_itself"
HARD = 1.0
"""Speed of a touch-down, in m/s, beyond which it is a crash."""


class BearingFlight(Observed):
    """A flight that injects the fault, and records the vehicle's true motion.

    Attributes:
        fault: a key of FAULTS. keeps_tracker: whether the tracker stays when it begins.
        left: whether the vehicle was outside its flight volume.
        turned_over: whether it tilted beyond 60 deg.
        fastest: largest speed at a touch-down, m/s. farthest: m, sideways from x = y = 0.
    """

    fault, keeps_tracker = NONE, True

    def __init__(self, *others: Any, **named: Any) -> None:
        super().__init__(*others, **named)
        self._since_ns: int | None = None
        self._state = 0
        self._good: dict[str, Any] = {}
        self.left = self.turned_over = False
        self.fastest = self.farthest = 0.0
        self._was_up, self._speed = False, 0.0
        p = self.parameters.behavior
        self._low = np.array([p.volume_x_min, p.volume_y_min, -0.05])
        self._high = np.array([p.volume_x_max, p.volume_y_max, p.volume_z_max])

    def advance(self) -> None:
        super().advance()
        now_ns, bearings = self.stack.stamp_ns, self.parameters.bearings
        values, ends = FAULTS[self.fault]
        if self._since_ns is None:
            if self.parameter("estimation.source") == "bearings":
                self._since_ns = now_ns
                self._good = {name: getattr(bearings, name) for name in values}
        elif self._state == 0 and now_ns > self._since_ns + AFTER_NS:
            self._state = 1
            for name, value in values.items():
                setattr(bearings, name, value)
            if not self.keeps_tracker:
                self.parameters.tracker.drop_out = 1.0
        elif self._state == 1 and ends and now_ns > self._since_ns + AFTER_NS + round(1e9 * ends):
            self._state = 2
            for name, value in self._good.items():
                setattr(bearings, name, value)
        self._watch()

    def _watch(self) -> None:
        position_w = self._true_position_w
        if not ((position_w >= self._low) & (position_w <= self._high)).all():
            self.left = True
        self.farthest = max(self.farthest, math.hypot(position_w.item(0), position_w.item(1)))
        self.turned_over = self.turned_over or self.tilt > math.radians(60.0)
        is_up = position_w.item(2) > 0.03
        if self._was_up and not is_up:
            self.fastest = max(self.fastest, self._speed)
        self._was_up = is_up
        self._speed = float(np.linalg.norm(self.robot.truth["velocity_w"][0]))

    @property
    def end(self) -> str:
        """Return how it ended: a metric of which 1 is true."""
        if any(text.startswith("emergency land") for text in self.events.texts):
            return "landed_itself"
        if any(text.startswith("fell back") for text in self.events.texts):
            return "fell_back"
        return "flown"


class BearingFlightOptions(BearingsOptions):
    """Options: those of the experiment `bearings`, and the fault."""

    fault: str = parameter(NONE, choices=tuple(FAULTS))
    """that begins 5 s after the hand-over, and persists unless its name says otherwise"""
    tracker: bool = parameter(True)
    """whether the tracker stays when it begins"""


class BearingFlights(BearingsExperiment):
    """The experiment `bearings` with a fault, and with what its flight has seen of the truth."""

    name, flight = "bearing_flights", BearingFlight

    def __init__(self) -> None:
        super().__init__()
        self.parameters: BearingFlightOptions = BearingFlightOptions()
        self._seen: dict[str, float] = {}

    def fly(self, client: Client) -> None:
        """Fly the experiment; keep what was seen."""
        assert isinstance(client, BearingFlight)
        client.fault, client.keeps_tracker = self.parameters.fault, self.parameters.tracker
        self.parameters.sticks_seed = client.parameters.simulator.seed
        super().fly(client)
        unsafe = client.left or client.turned_over or client.fastest > HARD
        self._seen = {
            name: float(name == client.end) for name in ("flown", "fell_back", "landed_itself")
        }
        self._seen |= {
            "unsafe": float(unsafe),
            "farthest_m": client.farthest,
            "ground_m_s": client.fastest,
        }

    def evaluate(self, log: Path) -> Result:
        """Return the experiment's result, as far as the flight came, with what was seen."""
        try:
            result = super().evaluate(log)
        except LogFormatError as error:
            result = Result("not_judged", {}, {}, str(error))
        own = {f"limit_{name}": limit for name, limit in result.limits.items()}
        limits = result.limits | {"unsafe": 0.0, EMERGENCIES: 100.0}
        return Result(result.verdict, result.metrics | self._seen | own, limits, result.reason)
