"""A verdict needs limits: a figure beyond one fails; without a decisive one it is not judged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from console.evaluation.bearings_bound import UNKNOWN, Frame, PoseBound, posterior_bound
from console.evaluation.bearings_limits import DECIDING, limits
from console.evaluation.verdict import judged, settled
from console.experiments.client import Result
from estimation.error_state_parameters import ErrorStateParameters

FIGURES = {"rms": 1.0, "most": 2.0}


def test_figures_within_their_limits_pass() -> None:
    assert judged(FIGURES, {"rms": 1.0}, ["rms"]) == Result("passed", FIGURES, {"rms": 1.0})


@pytest.mark.parametrize("value", [1.1, math.nan, None])
def test_a_figure_beyond_its_limit_or_missing_fails_whatever_else_has_no_limit(
    value: float | None,
) -> None:
    figures = FIGURES if value is None else {**FIGURES, "worst": value}
    assert judged(figures, {"worst": 1.0}, ["rms"]).verdict == "failed"


def test_a_deciding_figure_without_limit_is_not_judged_and_named() -> None:
    result = judged(FIGURES, {"most": 3.0}, ["rms", "most"], "no sensor")
    assert result.verdict == "not_judged"
    assert "rms" in result.reason
    assert "most" not in result.reason
    assert "no sensor" in result.reason


def test_a_pass_without_any_limit_is_not_judged_and_a_failure_stays_one() -> None:
    assert settled(Result("passed", FIGURES)).verdict == "not_judged"
    assert settled(Result("failed", FIGURES)) == Result("failed", FIGURES)


def test_limits_of_a_flight_on_bearings_follow_the_bound() -> None:
    small, _, _ = limits(PoseBound(0.01, 0.003), "error_state", "auto")
    large, deciding, why = limits(PoseBound(0.02, 0.006), "error_state", "auto")
    assert (set(DECIDING), why) == (set(deciding), "")
    assert set(DECIDING) <= set(large)
    for name in DECIDING:
        grown = large[name] / small[name]
        assert 1.5 < grown <= 2.0, name


@pytest.mark.parametrize(("bound", "gains"), [(UNKNOWN, "auto"), (PoseBound(0.01, 0.003), "paper")])
def test_without_bound_or_known_gains_the_figures_that_decide_have_no_limit(
    bound: PoseBound, gains: str
) -> None:
    found, deciding, why = limits(bound, "complementary", gains)
    assert not set(found) & set(deciding)
    assert why


def hovered(sigma: float, rate: float = 30.0, seconds: float = 20.0) -> PoseBound:
    """Return the bound above four beacons."""
    count = round(seconds * rate)
    frames = [Frame(k / rate, (1, 2, 3, 4), sigma) for k in range(count)]
    corners = {1: (1.0, 1.0, 0.1), 2: (-1.0, 1.0, 0.1), 3: (-1.0, -1.0, 0.1), 4: (1.0, -1.0, 0.1)}
    return posterior_bound(
        frames,
        np.tile([0.0, 0.0, 1.0], (count, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        corners,
        ErrorStateParameters(),
        (0.5 * seconds, seconds),
    )


def test_the_bound_grows_with_sigma_and_falls_with_rate_and_memory() -> None:
    fine, plain, rare = (
        hovered(math.radians(0.5)),
        hovered(math.radians(1.5)),
        hovered(math.radians(1.5), 10.0),
    )
    assert fine.position < plain.position < rare.position
    assert fine.attitude < plain.attitude < rare.attitude
    # One frame at this place has 5 cm and 2 deg. The filter remembers some dozens of them.
    assert 0.005 < plain.position < 0.02
    assert math.radians(0.05) < plain.attitude < math.radians(0.4)


def test_beacons_of_unknown_places_make_no_bound() -> None:
    frames = [Frame(0.0, (1, 2, 3, 4), 0.02)]
    here, level = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    found = posterior_bound(frames, here, level, {}, ErrorStateParameters(), (0.0, 1.0))
    assert math.isnan(found.position)
