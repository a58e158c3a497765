"""The least that a sensor must do before it flies."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vehicle.sensors.contract import INPUT_TYPE, OUTPUT_TYPE, Input, Reading, at_rest, load, step

SENSOR = Path(__file__).with_name("barometer.py")
PRESSURE = 1e5  # Pa


def flown(height: float) -> tuple[Reading | None, Input]:
    """Return what it measures at a height (m) after it has rested on the floor."""
    sensor, x = load(SENSOR), at_rest(height=0.0)
    x.pressure = PRESSURE
    sensor.reset(x)
    for _ in range(100):
        assert sensor.step(x) is None
    x.flying, x.position_w[2], x.pressure = 1.0, height, PRESSURE - 11.6 * height
    made = sensor.step(x)
    return (None if made is None else Reading(*made)), x


def test_it_measures_the_height_that_it_expects() -> None:
    reading, x = flown(1.5)
    assert reading is not None
    assert reading.value == pytest.approx(reading.expected(x.position_w, x.quaternion_wb))
    assert reading.deviation > 0.0


def test_its_rows_are_numbers_that_the_filter_can_use() -> None:
    sensor, x, out = load(SENSOR), np.zeros(1, INPUT_TYPE), np.zeros(1, OUTPUT_TYPE)
    x["reset"], x["quaternion_wb"], x["pressure"] = 1.0, (1.0, 0.0, 0.0, 0.0), PRESSURE
    for flying in (0.0, 1.0):
        x["flying"], x["pressure"] = flying, x["pressure"] - flying
        step(sensor, x.view(np.recarray)[0], out)
        x["reset"] = 0.0
    assert out["count"][0] == 1.0
    assert all(np.isfinite(out[name]).all() for name in OUTPUT_TYPE.names or ())


def test_it_is_silent_without_a_pressure() -> None:
    assert flown(math.nan)[0] is None
