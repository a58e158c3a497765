"""The condition that a flight shows, with and without a fault."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from extensions.explanation.levels import levels
from extensions.explanation.tests.made_flight import Columns, Flight
from flight_log.run import Run


def of(topics: dict[str, Any]) -> dict[str, float]:
    return levels(cast("Run", SimpleNamespace(topics=topics)))


def test_levels_are_those_of_the_flight() -> None:
    flight = Flight()
    topics = flight.topics()
    volts = np.where(flight.airborne, 15.0, 16.0)[::50]
    topics["battery"] = Columns(flight.time[::50], {"voltage": volts})
    thrust = np.where(flight.airborne, 10.0, 0.0)
    topics["actuators"] = Columns(flight.time, {"thrust": thrust})
    found = of(topics)
    assert found["airborne_s"] == pytest.approx(30.0, abs=0.2)
    assert found["vibration_m_s2"] == pytest.approx(0.1, rel=0.2)  # the flight's own noise
    assert found["tracker_gap_max_s"] == pytest.approx(0.01, abs=1e-6)
    assert (found["battery_start_v"], found["battery_end_v"]) == (15.0, 15.0)
    assert found["battery_fall_v_n"] == pytest.approx(0.1)


def test_a_log_without_a_flight_has_no_levels() -> None:
    flight = Flight()
    still = Columns(flight.time[::50], {"airborne": np.zeros(len(flight.time[::50]))})
    assert of({"status": still}) == {}
    assert of({}) == {}
