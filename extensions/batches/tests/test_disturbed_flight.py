"""Disturbance observer in the vehicle's own tick: wind and a weak motor, switched in flight."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.flights.watched_flight import WatchedFlight
from quadrotor.records import Record

FORCE, TORQUE = "control.disturbance.force", "control.disturbance.torque"


class Flight(WatchedFlight):
    """Flight that stores what the law compensates in each tick."""

    def __init__(self) -> None:
        self.taken: list[np.ndarray] = []
        super().__init__(
            3, {"simulator.motor_gain_left": 0.9, "simulator.drag": 0.3, "simulator.wind_x": 4.0}
        )

    def advance(self) -> None:
        super().advance()
        self.taken.append(self.off["force_w"][0].copy())

    @property
    def off(self) -> Record:
        found: Record = self.stack.law.controller.disturbance
        return found

    def away(self, seconds: float) -> float:
        """Return the largest distance from the reference, m, over the next seconds."""
        self.forget()
        self.run(seconds)
        _, true, wanted = self.trace()
        return float(np.linalg.norm(true - wanted, axis=1).max())


def test_switched_on_in_flight_it_finds_wind_and_weak_motor_without_a_jump() -> None:
    flight = Flight().hover()
    assert flight.stack.law.observer.idle
    assert not flight.off["force_w"].any()
    before = flight.away(1.0)
    flight.taken.clear()
    flight.change({FORCE: True, TORQUE: True})
    assert flight.away(5.0) < before + 0.03
    flight.run(10.0)
    assert flight.away(1.0) < 0.02
    push = flight.off["force_w"][0]
    assert push[0] == pytest.approx(0.3 * 4.0, abs=0.3)
    roll = float(flight.off["torque_b"][0, 0])
    assert roll == pytest.approx(-0.1 * 0.25 * 0.25 * 1.308 * 9.81, rel=0.3)
    assert np.abs(np.diff(flight.taken, axis=0)).max() < 0.1
    # Switched off, it fades to nothing; the integrals compensate wind and motor again, and that of
    # the attitude is too small for such a motor.
    flight.change({FORCE: False, TORQUE: False})
    assert flight.away(3.0) < 0.03
    flight.run(3.0)
    assert not flight.off["force_w"].any()
    assert not flight.off["torque_b"].any()
    assert np.abs(np.diff(flight.taken, axis=0)).max() < 0.1
    # Landing with it on: softly, upright, and cleared on the ground.
    flight.change({FORCE: True, TORQUE: True})
    flight.run(5.0)
    flight.start("land")
    assert flight.down()
    assert flight.hardest < 0.5
    assert not flight.off["force_w"].any()
