"""A failure above the microcontroller, at a random moment of a flight."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.campaigns.watching import Watching
from benchmarks.flights.failing_flights import (
    FAILURES,
    STARTS,
    Failing,
    bring_to,
    conditions,
    watch_failure,
)
from benchmarks.flights.touch_down import IMPACT_MAX, UPRIGHT, Outcome
from quadrotor.parameters import Parameters, parameter


class FailureOptions(Parameters):
    """Options: what fails, and when."""

    failure: str = parameter("station", choices=FAILURES)
    """what fails"""
    start: str = parameter("hover 1 m", choices=STARTS)
    """from what"""


class Failures(Watching):
    """A flight to its failure, and from there to the ground, with its motors off."""

    name, flight = "failures", Failing

    def __init__(self) -> None:
        super().__init__()
        self.parameters: FailureOptions = FailureOptions()

    def fly(self, client: Failing) -> None:
        """Fly, cause the failure, and watch the vehicle come down."""
        failure, start = self.parameters.failure, self.parameters.start
        seed = client.parameters.simulator.seed
        client.disturb(**conditions(seed))
        chance = np.random.default_rng((seed, 13, STARTS.index(start), FAILURES.index(failure)))
        bring_to(client, start, chance)
        found = Outcome(failure, start, seed, broken=True)
        watch_failure(client, failure, found, outage=float(chance.uniform(0.3, 4.0)))
        self.found = {
            "landed": float(found.verdict == "landed"),
            "impact_m_s": found.impact,
            "tilt_deg": math.degrees(max(found.tilt, found.end_tilt)),
            "tilt_max_deg": math.degrees(found.tilt_max),
            "drift_m": found.drift,
            "down_s": found.down,
            "off_s": found.off,
        }
        self.limits = {"impact_m_s": IMPACT_MAX, "tilt_deg": math.degrees(UPRIGHT)}
