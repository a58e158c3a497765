"""Rounded motor references whose mean is the requested value."""

from __future__ import annotations

import numpy as np
import pytest

from vehicle.boards.reference_rounding import ReferenceRounding


def test_the_mean_of_the_counts_is_the_wanted_reference() -> None:
    wanted = np.array([100.3, 120.75, 30.01, 179.5])
    rounding = ReferenceRounding()
    sent = [rounding.round(wanted.copy()) for _ in range(1000)]
    assert np.asarray(sent).mean(axis=0) == pytest.approx(wanted, abs=1e-3)


def test_the_sum_of_what_was_sent_never_strays_by_more_than_half_a_count() -> None:
    random = np.random.default_rng(11)
    rounding, asked, sent = ReferenceRounding(), np.zeros(4), np.zeros(4)
    for _ in range(2000):
        wanted = random.uniform(30.0, 180.0, 4)
        asked += wanted
        sent += rounding.round(wanted)
        assert np.abs(asked - sent).max() <= 0.5 + 1e-6


def test_what_the_motors_cannot_do_is_not_carried_on() -> None:
    rounding = ReferenceRounding()
    for _ in range(100):
        assert rounding.round(np.full(4, 400.0)) == (255, 255, 255, 255)
    assert rounding.round(np.full(4, 100.0)) == (100, 100, 100, 100)
    assert rounding.round(np.full(4, -50.0)) == (0, 0, 0, 0)


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_a_reference_that_is_no_number_is_refused(broken: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        ReferenceRounding().round(np.array([100.0, broken, 100.0, 100.0]))


def test_counts_are_written_over_the_wanted_references() -> None:
    wanted = np.array([99.6, 0.2, 300.0, -0.1])
    assert ReferenceRounding().round(wanted) == (100, 0, 255, 0)
    assert wanted.tolist() == [100.0, 0.0, 255.0, 0.0]
