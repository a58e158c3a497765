"""The shadow takes over from an error-state filter that its measurements contradict."""

from __future__ import annotations

import numpy as np
import pytest

from tests.vehicle.estimators.test_stack_estimators import EstimatorLab
from vehicle.modes import Flag


def flown(lab: EstimatorLab) -> str:
    return str(lab.stack.estimator.name)  # type: ignore[attr-defined]


def break_filter(lab: EstimatorLab, metres: float) -> None:
    """Move the filter, whose covariance stays small."""
    memory = lab.stack.estimator.memory  # type: ignore[attr-defined]
    for name in ("base", "now"):
        memory[name][0, 0] += metres
    memory["after_state"][0, :, 0] += metres


def test_it_takes_over_hands_back_and_says_both() -> None:
    lab = EstimatorLab(estimator="error_state").hovering()
    break_filter(lab, 0.5)
    seen: list[str] = []
    steps: list[float] = []
    for _ in range(100):
        before = lab.stack.state["position_w"][0].copy()
        lab.advance()
        steps.append(float(np.linalg.norm(lab.stack.state["position_w"][0] - before)))
        seen.append(flown(lab))
    assert "complementary" in seen
    taken = seen.index("complementary")
    assert max(steps[taken - 1 : taken + 2]) < 0.02  # 0.5 m are faded out
    assert lab.stack.store.get("estimation.shadow") == "error_state"
    assert Flag.RESCUED in Flag(int(lab.stack.status["flags"][0]))
    [line] = [text for text in lab.texts() if "took over" in text]
    assert "0.5" in line
    lab.wait(4.0)
    assert flown(lab) == "error_state"
    assert lab.stack.store.get("estimation.shadow") == "none"
    assert Flag.RESCUED not in Flag(int(lab.stack.status["flags"][0]))
    assert len([text for text in lab.texts() if "handed back" in text]) == 1
    assert lab.error() < 0.02
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.05)


def test_an_estimate_that_is_not_a_number_is_left_at_the_next_pose() -> None:
    lab = EstimatorLab(estimator="error_state").hovering()
    break_filter(lab, np.nan)
    lab.wait(0.03)
    assert flown(lab) == "complementary"
    assert np.isfinite(lab.stack.state["position_w"]).all()


def test_it_may_be_switched_off() -> None:
    lab = EstimatorLab(estimator="error_state", rescue=False).hovering()
    assert lab.stack.navigation.shadow is None
    break_filter(lab, 0.3)
    lab.wait(2.0)
    assert flown(lab) == "error_state"
    assert not [text for text in lab.texts() if "took over" in text]


def test_a_choice_made_meanwhile_stays() -> None:
    lab = EstimatorLab(estimator="error_state").hovering()
    break_filter(lab, 0.5)
    lab.wait(0.3)
    assert flown(lab) == "complementary"
    lab.set(shadow="none")
    lab.wait(4.0)
    assert flown(lab) == "complementary"
    assert Flag.RESCUED not in Flag(int(lab.stack.status["flags"][0]))


def test_a_tracker_that_jumps_contradicts_both_and_nothing_is_changed() -> None:
    lab = EstimatorLab(estimator="error_state").hovering()
    measure = lab.stack.measure

    def moved(measurement: object) -> None:
        if isinstance(measurement, np.ndarray) and "position_w" in (measurement.dtype.names or ()):
            measurement = measurement.copy()
            measurement["position_w"] += (0.3, 0.0, 0.0)
        measure(measurement)  # type: ignore[arg-type]

    lab.stack.measure = moved  # type: ignore[method-assign]
    for _ in range(500):
        lab.advance()
        assert flown(lab) == "error_state"
    assert [text for text in lab.texts() if "was moved by 0.3" in text]
