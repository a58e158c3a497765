"""The least that an estimator must do before it flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vehicle.estimators.contract import Answer, at_rest, load

ESTIMATOR = Path(__file__).with_name("error_state_ekf.py")


def settled(offset_w: tuple[float, float, float], steps: int = 500) -> Answer:
    """Return the last answer at rest, with a pose in every fifth step, this far (m) from the
    start."""
    estimator, x = load(ESTIMATOR), at_rest()
    estimator.reset(x)
    x.pose_position_w[:] += offset_w
    for k in range(1, steps + 1):
        x.time, x.pose_count, x.reset = 0.002 * k, float(k % 5 == 0), 0.0
        x.pose_time = x.time
        answer = Answer(*estimator.step(x))
    return answer


def test_it_stays_where_it_is_at_rest() -> None:
    answer = settled((0.0, 0.0, 0.0))
    assert answer.position_w == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert answer.velocity_w == pytest.approx(np.zeros(3), abs=1e-6)
    assert abs(answer.quaternion_wb[0]) == pytest.approx(1.0)


def test_it_goes_to_where_the_poses_are() -> None:
    answer = settled((0.05, 0.0, -0.05))
    assert answer.position_w == pytest.approx([0.05, 0.0, 0.95], abs=0.01)
