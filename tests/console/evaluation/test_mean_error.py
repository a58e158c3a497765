"""The standard error of a mean, of samples that depend on each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from console.evaluation.mean_error import mean_error


@pytest.mark.parametrize("lasts", [0.0, 5.0, 40.0])
def test_it_is_how_much_means_of_such_samples_scatter(lasts: float) -> None:
    """Take 300 records of 3000 samples that are correlated for `lasts` samples."""
    generator = np.random.default_rng(3)
    keep = math.exp(-1.0 / lasts) if lasts else 0.0
    records = generator.normal(size=(300, 3000))
    for k in range(1, 3000):
        records[:, k] = keep * records[:, k - 1] + math.sqrt(1.0 - keep**2) * records[:, k]
    scatter = float(records.mean(axis=1).std())
    errors = [mean_error(record) for record in records]
    assert float(np.median(errors)) == pytest.approx(scatter, rel=0.2)


def test_of_constant_samples_it_is_zero() -> None:
    assert mean_error(np.full(10, 1.3)) == 0.0
