"""The whole stack in simulated time: plant, serial bytes, tick, tracker, beacons and log.

The same parts as in real time, joined in one thread by one clock that starts at 0, so the same
seed gives the same messages byte for byte. It is a `console.experiments.client.Client`: every
wait flies on.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bearing_sim.beacons import PAPER_BEACONS
from bearing_sim.emulator import BearingEmulator, EmulatorParameters
from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from console.experiments.client import VehicleView
from control.behaviors.table import BehaviorName
from estimation.complementary import Estimator
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, ParameterValue
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.microcontroller import Microcontroller
from vehicle.modes import Mode
from vehicle.parameters import VehicleParameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.stack import FlightStack

HEARTBEAT_NS = 50_000_000
TRUTH_NS = 10_000_000


class FlightParameters(VehicleParameters):
    """The vehicle's tree and, beside it, what only a simulated flight has."""

    simulator: SimulatorParameters = SimulatorParameters()
    tracker: TrackerParameters = TrackerParameters()
    beacons: EmulatorParameters = EmulatorParameters()


class StageClock:
    """Where the processor's time goes: seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def restart(self) -> None:
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Account the time since the last lap to `stage`."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
