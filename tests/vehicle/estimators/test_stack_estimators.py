"""Choice of estimator, shadow and source in the whole stack, in simulated time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from estimation import names, registry
from estimation.complementary import ComplementaryEstimator
from estimation.parameters import PRESETS, EstimationParameters
from quadrotor.errors import UnknownParameterError
from quadrotor.records import Record, bearings_sample
from tests.support.lab import Lab, refusal, shadow_state
from vehicle import mailbox


class EstimatorLab(Lab):
    """Flight whose station also sends the bearings; settings are those of `estimation`."""

    def __init__(self, **settings: Any) -> None:
        super().__init__()
        if settings:
            self.set(**settings)

    def set(self, **values: Any) -> None:
        self.change({f"estimation.{name}": value for name, value in values.items()})

    def _solve(self, seen: Record, now_ns: int) -> None:
        self.stack.measure(seen)


def test_on_the_ground_a_choice_acts_at_once_and_flies() -> None:
    lab = EstimatorLab()
    assert lab.stack.estimator.name == "complementary"  # type: ignore[attr-defined]
    lab.set(estimator="error_state")
    assert lab.stack.estimator.name == "error_state"  # type: ignore[attr-defined]
    lab.hovering()
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.03)
    assert lab.error() < 0.01
    lab.start("land")
    lab.wait_until(lambda v: not v.armed, what="disarmed", timeout=15)


def test_in_flight_the_converged_shadow_takes_over_without_a_jump() -> None:
    lab = EstimatorLab(shadow="error_state").hovering()
    lab.start("fly_to", x=0.3, y=0.2, z=1.2, yaw=0.3)
    lab.wait(0.5)
    stack = lab.stack
    reference, behavior = stack.reference.copy(), stack.behaviors.name
    apart = np.linalg.norm(shadow_state(stack)["position_w"] - stack.state["position_w"])
    lab.set(estimator="error_state")
    assert stack.estimator.name == "error_state"  # type: ignore[attr-defined]
    assert stack.store.get("estimation.shadow") == "complementary"
    assert stack.behaviors.name is behavior
    before = stack.state["position_w"][0].copy()
    lab.advance()
    assert np.linalg.norm(stack.state["position_w"][0] - before) < apart + 0.003
    moved = np.abs(stack.reference["position_w"] - reference["position_w"]).max()
    assert moved < 0.003
    lab.wait(3.0)
    assert lab.error() < 0.01
    lab.set(estimator="complementary")  # and back
    lab.wait(0.5)
    assert lab.error() < 0.02


def test_in_flight_only_the_shadow_may_be_chosen_and_a_refusal_changes_nothing() -> None:
    lab = EstimatorLab().hovering()
    store = lab.stack.store
    before, revision, active = store.values(), store.revision, lab.stack.estimator
    assert "does not run" in refusal(lambda: lab.set(estimator="error_state"))
    assert "estimation.shadow = complementary" in refusal(lambda: lab.set(shadow="complementary"))
    assert (store.values(), store.revision) == (before, revision)
    assert lab.stack.estimator is active


def test_in_flight_a_shadow_that_has_not_converged_or_disagrees_is_refused_with_numbers() -> None:
    lab = EstimatorLab(shadow="error_state").hovering()
    navigation = lab.stack.navigation
    shadow = navigation.shadow
    assert shadow is not None
    shadow.reset()
    assert "no measurement" in refusal(lambda: lab.set(estimator="error_state"))
    lab.wait(0.02)
    assert "needs 10" in refusal(lambda: lab.set(estimator="error_state"))
    lab.wait(1.0)
    assert shadow.converged
    shadow_state(lab.stack)["position_w"][0, 0] += 0.5
    reason = refusal(lambda: lab.set(estimator="error_state"))
    assert "0.5" in reason
    assert "allowed 0.250 m" in reason
    lab.wait(0.1)
    lab.set(estimator="error_state")


def test_in_flight_what_is_not_compiled_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = EstimatorLab().hovering()
    monkeypatch.setattr(registry, "ready", lambda name, bearings: False)
    monkeypatch.setattr(registry, "prepare", lambda *_: pytest.fail("compiled in flight"))
    assert "not compiled" in refusal(lambda: lab.set(shadow="error_state"))
    assert lab.stack.navigation.shadow is None
    lab.set(shadow="none")
    lab.change({"control.position.kp_xy": 3.9})  # it delays nothing else


def test_bearings_alone_fly_within_bounds() -> None:
    """The hand-over is in flight: on the floor the beacons' plane is too near."""
    lab = EstimatorLab(shadow="error_state", shadow_source="bearings").hovering()
    lab.wait(2.0)
    lab.set(source="bearings", estimator="error_state")
    lab.start("follow_trajectory", trajectory="figure_eight", laps=1)
    worst = 0.0
    for _ in range(50):
        lab.wait(0.2)
        worst = max(worst, lab.error())
        assert np.abs(lab.robot.truth["position_w"][0, :2]).max() < 1.0
    assert worst < 0.15
    assert lab.view().armed
    assert not lab.stack.estimator.stale


def test_a_gain_too_fast_for_the_measured_rate_is_said_once_and_anew_after_a_change() -> None:
    lab = EstimatorLab(**PRESETS["paper"])
    lab._tracker.parameters.rate = 30.0
    lab.wait(9.0)

    def said() -> list[str]:
        return [text for text in lab.texts() if text.startswith("position_bandwidth")]

    assert len(said()) == 1
    assert "spectral radius" in said()[0]
    assert "30" in said()[0]
    level = next(e.level for e in lab.kept.events if e.text.startswith("position_bandwidth"))
    assert level == mailbox.WARN
    lab.set(position_bandwidth=60.0)
    lab.wait(6.0)
    assert len(said()) == 2
    lab.set(position_bandwidth=8.0, attitude_bandwidth=3.0)
    lab.wait(6.0)
    assert len(said()) == 2


class Frozen(ComplementaryEstimator):
    """Plugin in plain Python that fails when requested."""

    name = "frozen"
    broken = False

    def predict(self, imu: Any, dt: float, state: Any) -> None:
        if Frozen.broken:
            raise ZeroDivisionError("by zero")
        super().predict(imu, dt, state)


def test_a_registered_plugin_can_be_chosen_and_a_broken_shadow_ends_no_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(names, "registered", {})
    for field in ("estimator", "shadow"):
        extra: Any = EstimationParameters.model_fields[field].json_schema_extra
        monkeypatch.setitem(extra, "choices", list(extra["choices"]))
    registry.register("frozen", Frozen)
    assert registry.names() == ("complementary", "error_state", "frozen")
    monkeypatch.setattr(Frozen, "broken", False)
    lab = EstimatorLab(shadow="frozen").hovering()
    Frozen.broken = True
    lab.wait(0.5)
    assert any("shadow frozen stopped: ZeroDivisionError" in text for text in lab.texts())
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.03)


def test_an_unknown_estimator_is_refused_by_name() -> None:
    lab = EstimatorLab()
    assert "one of complementary, error_state" in refusal(lambda: lab.set(estimator="magic"))
    with pytest.raises(UnknownParameterError, match="complementary, error_state"):
        registry.create("magic", EstimationParameters())


def test_unknown_beacons_are_said_once_and_ignored() -> None:
    lab = EstimatorLab(source="both")
    for k in range(5):
        frame = bearings_sample(k * 1_000_000, (77,), ((0.0, 0.0, -1.0),), 0.02)
        lab.stack.measure(frame)
        lab.advance()
    assert sum("77" in text for text in lab.texts()) == 1
    assert math.isinf(ComplementaryEstimator().measurement_age)
