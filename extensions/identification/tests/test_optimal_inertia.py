"""The doublets chosen for the inertia: what the model of the loop says, and the flight."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.evaluation.inertia import read_inertia
from estimation.identification.inertia_estimator import InertiaParameters
from extensions.identification.optimal_inertia.design import (
    FILTER_POLE,
    REPEATS,
    WASHOUT_POLE,
    Bounds,
    Candidate,
    Loop,
    candidates,
    choose,
    respond,
)
from quadrotor.errors import UsageError
from tests.support.laboratory import laboratory

ROLL = Loop(
    kp=4.0, kv=3.5, ki=1.0, kr=60.0, kw=12.0, kf=10.0, gravity=9.81, tilt_max=1.0, lag=0.047
)
YAW = Loop(kr=12.0, kw=5.0, kf=2.0, lag=0.047)


def test_the_model_has_the_filters_of_the_estimator() -> None:
    estimator = InertiaParameters()
    assert (estimator.filter_pole, estimator.washout_pole) == (FILTER_POLE, WASHOUT_POLE)


def test_information_is_the_square_of_the_amplitude_until_the_yaw_torque_is_at_its_bound() -> None:
    sizes, durations = np.array([0.005, 0.01]), np.array([0.4, 0.4])
    for loop in (ROLL, YAW):
        small, large = respond(loop, sizes, durations).information.T
        assert large / small == pytest.approx(np.full(REPEATS, 4.0), rel=1e-3)
        assert (np.diff(small) > 0.0).all()
    free = respond(YAW, 40.0 * sizes, durations).information[-1]
    held = respond(replace(YAW, torque_max=1.0), 40.0 * sizes, durations).information[-1]
    assert (held < free).all()
    assert held[1] < 2.0 * held[0]


def test_candidates_keep_the_bounds_and_none_is_beaten_by_a_shorter_one() -> None:
    bounds = Bounds(amplitude=0.6, offset=0.5, angle=math.radians(15.0), rate=2.0)
    front = candidates("x", ROLL, bounds)
    assert len(front) > 3
    for earlier, later in itertools.pairwise(front):
        assert earlier.seconds < later.seconds
        assert earlier.information < later.information
    seen = respond(
        ROLL, np.array([c.amplitude for c in front]), np.array([c.duration for c in front])
    )
    assert seen.keeps(bounds).all()
    assert candidates("x", ROLL, replace(bounds, angle=1e-4)) == []


def test_the_criterion_says_what_is_best_and_the_time_is_kept() -> None:
    def front(axis: str, *gained: float) -> list[Candidate]:
        return [Candidate(axis, 0.1, 1.0, k + 1, value) for k, value in enumerate(gained)]

    offered = {"x": front("x", 4.0, 5.0), "yaw": front("yaw", 1.0, 1.5, 1.7)}
    shortest = sum(one[0].seconds for one in offered.values())
    assert [one.information for one in choose(offered, shortest)] == [4.0, 1.0]
    longer = shortest + 6.0  # two more doublets of three seconds
    assert [one.information for one in choose(offered, longer, "worst_axis")] == [4.0, 1.7]
    assert [one.information for one in choose(offered, longer, "all_axes")] == [5.0, 1.5]
    with pytest.raises(UsageError, match=r"9\.4 s at least, and 9 s were given"):
        choose(offered, 9.0)
    with pytest.raises(UsageError, match="yaw"):
        choose(offered | {"yaw": []}, longer)


def test_the_inertia_is_found_in_ten_seconds_of_excitation(tmp_path: Path) -> None:
    log = tmp_path / "inertia.mcap"
    with laboratory("inertia_optimal", log, experiment__seconds=10.0) as (experiment, flight):
        experiment.fly(flight)
        assert flight.view().mode == "ready"
    result = experiment.evaluate(log)
    assert result.verdict == "passed"
    assert result.metrics["excited_s"] < 10.5
    assert result.metrics["error_share"] < 0.01
    found = read_inertia(log, "quad1")
    assert (found.torque_b > 0.003).all()
