"""Answers in time of any numbers: a plugin may have forged them, and no tick ends by one."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import numpy as np
import pytest

from control.controller import GeometricController
from estimation.parameters import EstimationParameters
from quadrotor.records import IMU_SAMPLE, new_state
from tests.support.law_bench import LawBench
from vehicle.estimators.navigation import Navigation
from vehicle.laws.contract import LAW
from vehicle.laws.external import ExternalLaw
from vehicle.plugins.contract import Contract
from vehicle.sensors.contract import SENSOR
from vehicle.sensors.external import ExternalSensor

LARGE = 1e200
"""Number whose square is not finite."""


class Forger:
    """A link whose answers have the right time, and these numbers."""

    def __init__(self, contract: Contract, numbers: dict[str, float | Iterable[float]]) -> None:
        self._contract, self._numbers = contract, numbers
        self._answer: bytes | None = None

    def ready(self) -> bool:
        return True

    def send(self, data: bytes) -> None:
        out = np.zeros(1, self._contract.outputs)
        out["time"] = np.frombuffer(data, self._contract.inputs)["time"]
        for name, value in self._numbers.items():
            out[name] = value
        self._answer = out.tobytes()

    def receive(self) -> bytes | None:
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None: ...


@pytest.mark.parametrize(
    ("numbers", "why"),
    [
        ({"thrust": LARGE}, "its thrust is .* of the weight"),
        ({"thrust": -LARGE}, "its thrust is .* of the weight"),
        ({"torque_b": (0.0, LARGE, 0.0)}, "its (thrust|torque) is"),
        ({"thrust": math.inf}, "not finite"),
    ],
)
def test_a_law(numbers: dict[str, float | Iterable[float]], why: str) -> None:
    law = ExternalLaw("mine", Forger(LAW, numbers), GeometricController(), waits=True)
    bench = LawBench(law)
    bench.ticks(3)
    assert bench.flies_built_in
    assert re.search(why, law.failure)


def test_a_law_that_is_only_compared_goes_on_whatever_it_answers() -> None:
    forger = Forger(LAW, {"thrust": LARGE})
    law = ExternalLaw("mine", forger, GeometricController(), waits=True)
    bench = LawBench(law)
    law.flown = False
    bench.ticks(3)
    assert (law.failure, law.difference) == ("", math.inf)


@pytest.mark.parametrize("count", [math.nan, math.inf, -math.inf, -1.0, 9.0, 1e9, LARGE])
def test_a_sensor_that_counts_wrongly_is_out(count: float) -> None:
    navigation = Navigation(EstimationParameters(), lambda line, level: None)
    sensor = ExternalSensor("mine", Forger(SENSOR, {"count": count}), waits=True)
    sensor.becomes_ready()
    imu, state = np.zeros(1, IMU_SAMPLE), new_state()
    for k in range(1, 3):
        everything = navigation.running.everything()
        sensor.step(2_000_000 * k, 0.002, imu, state, 1e5, False, everything)
    assert sensor.failure == f"it answered {count:g} readings; 0 to 8 are taken"
