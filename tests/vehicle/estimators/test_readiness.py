"""An estimator in parallel may take over when nothing is lacking; how far it is."""

from __future__ import annotations

import math
from typing import Any

import pytest

from estimation.convergence import Convergence, Deviations, Difference
from vehicle.estimators.estimator_runner import Runner
from vehicle.estimators.readiness import AGREEMENT, PERIOD_NS, Lack, ShadowWatch, readiness


class Judged:
    """An estimator of which only the judgement is asked."""

    def __init__(self) -> None:
        self.convergence = Convergence(True, "", 1.0)
        self.initialized, self.stale = True, False
        self.deviations: Deviations | None = Deviations(0.012, 0.1, 0.01)


def runners(source: str = "bearings") -> tuple[Any, Runner, Runner]:
    estimator: Any = Judged()
    return estimator, Runner("mine", source, estimator), Runner("complementary", "poses", estimator)


def test_the_reason_and_the_share_are_of_what_is_lacking() -> None:
    estimator, shadow, active = runners()
    state = active.state
    assert readiness(shadow, active, state).lack is Lack.NOTHING
    shadow.state["position_w"] = 2.0 * AGREEMENT.position, 0.0, 0.0
    far = readiness(shadow, active, state)
    assert (far.lack, far.share, far.distance) == (Lack.AGREEMENT, 0.5, 0.5)
    assert "allowed 0.250 m" in far.reason
    estimator.convergence = Convergence(False, "3 measurements applied, needs 10", 0.3)
    settling = readiness(shadow, active, state)
    assert (settling.lack, settling.share) == (Lack.CONVERGENCE, 0.3)
    estimator.stale = True
    assert readiness(shadow, active, state).lack is Lack.MEASUREMENTS
    assert "measurement_timeout" in readiness(shadow, active, state).reason


def test_a_difference_never_keeps_the_tracker_from_taking_over_again() -> None:
    _, shadow, active = runners("poses")
    shadow.state["position_w"] = 3.0
    active.source = "bearings"
    assert readiness(shadow, active, active.state).lack is Lack.NOTHING


def test_the_time_counts_from_the_judgement_since_which_nothing_is_lacking() -> None:
    estimator, shadow, active = runners()
    watch = ShadowWatch()
    for step, expected in enumerate((0.0, 0.1, 0.2)):
        watch.step(PERIOD_NS * (step + 1), shadow, active, active.state)
        assert watch.status[2] == pytest.approx(expected)
    before = watch.status
    watch.step(3 * PERIOD_NS + 1, shadow, active, active.state)
    assert watch.status is before  # not due yet
    estimator.convergence, estimator.deviations = Convergence(False, "", 0.4), None
    watch.step(4 * PERIOD_NS, shadow, active, active.state)
    assert watch.status[:3] == (Lack.CONVERGENCE, 0.4, 0.0)
    assert math.isnan(watch.status[3])


def test_a_share_of_an_estimate_that_is_not_finite_is_nothing() -> None:
    assert AGREEMENT.share_of(Difference(math.nan, 0.0, 0.0)) == 0.0
    assert AGREEMENT.share_of(Difference(0.0, math.inf, 0.0)) == 0.0
    assert AGREEMENT.share_of(Difference(0.1, 0.8, 0.0)) == 0.5
