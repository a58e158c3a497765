"""Missing IMU samples: the estimate advances by the time that has really passed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from quadrotor.records import POSE_SAMPLE, Record
from quadrotor.vehicle_model import GRAVITY
from tests.support.lab import Lab, flight_parameters
from vehicle.mailbox import Measurement
from vehicle.safety.barometric_height import PASCALS_PER_METRE, BarometricHeight

GAP = 0.2
"""Length of the gap, s: four times the longest step of the laws."""


class DeafLab(Lab):
    """Flight whose samples and poses can be withheld from the stack."""

    def __init__(self, estimator: str) -> None:
        parameters = flight_parameters()
        parameters.estimation.estimator = estimator
        super().__init__(parameters)
        self.deaf = False
        tick, measure = self.stack.tick, self.stack.measure

        def hear(sample: Any) -> Any:
            return None if self.deaf else tick(sample)

        def take(measurement: Measurement | Record) -> None:
            pose = isinstance(measurement, np.ndarray) and measurement.dtype == POSE_SAMPLE
            if not (self.deaf and pose):
                measure(measurement)

        self.stack.tick = hear  # type: ignore[method-assign]
        self.stack.measure = take  # type: ignore[method-assign]
        self.hovering(settling=0.0)

    def errors(self) -> tuple[float, float]:
        """Return the errors of position (m) and velocity (m/s)."""
        state, truth = self.stack.state[0], self.robot.truth[0]
        return (
            float(np.linalg.norm(state["position_w"] - truth["position_w"])),
            float(np.linalg.norm(state["velocity_w"] - truth["velocity_w"])),
        )


@pytest.mark.parametrize("estimator", ["complementary", "error_state"])
def test_a_gap_of_a_fifth_of_a_second_at_a_metre_a_second_costs_next_to_nothing(
    estimator: str,
) -> None:
    """The complementary filter was off by 0.147 m and 0.47 m/s with the gap cut to 50 ms."""
    lab = DeafLab(estimator)
    lab.start("fly_to", x=1.8, y=0.0, z=1.0, speed=1.0)
    lab.wait_until(lambda v: v.position_w[0] > 0.8, what="half the way", timeout=10)
    speed = float(lab.robot.truth["velocity_w"][0, 0])
    assert speed > 0.9
    before_ns = lab.stack.stamp_ns
    lab.deaf = True
    while lab.robot.stamp_ns < before_ns + GAP * 1e9:
        lab.advance()
    lab.deaf = False
    lab.advance()
    assert lab.stack.stamp_ns - before_ns == pytest.approx(GAP * 1e9, abs=5e6)
    position, velocity = lab.errors()
    assert position < 0.02
    assert velocity < 0.1
    worst = np.zeros(2)
    for _ in range(100):
        lab.advance()
        worst = np.maximum(worst, lab.errors())
    assert worst[0] < 0.02
    assert worst[1] < 0.15
    assert lab.stack.estimate["measurements_refused"][0] == 0
    assert "the board sent no samples for 0.20 s in flight" in lab.said


def test_the_barometric_height_climbs_on_over_a_gap() -> None:
    height, pressure = BarometricHeight(), 101_325.0
    height.set_ground(pressure, 0.002)
    height.climb = 1.0
    height.step(pressure - GAP * PASCALS_PER_METRE, GRAVITY, GAP)
    assert height.height == pytest.approx(GAP, abs=1e-9)
    assert height.climb == pytest.approx(1.0, abs=1e-9)


def test_one_reading_after_a_gap_does_not_throw_the_barometric_height_beyond_it() -> None:
    height, pressure = BarometricHeight(), 101_325.0
    height.set_ground(pressure, 0.002)
    height.step(pressure - PASCALS_PER_METRE, GRAVITY, 1.0)
    assert 0.0 < height.height < 1.0
