"""The standard error of a mean whose samples depend on each other."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Array


def mean_error(samples: Array) -> float:
    """Return the standard error of the mean of evenly spaced samples (N,).

    Their variance over N, times the samples for which a deviation lasts: 1 + 2 Σ ρ up to the first
    autocorrelation ρ that is not positive. A. Sokal, "Monte Carlo methods in statistical
    mechanics", 1997.
    """
    count, away = len(samples), samples - samples.mean()
    spectrum = np.abs(np.fft.rfft(away, 2 * count)) ** 2
    covariances = np.fft.irfft(spectrum)[:count] / count
    if not covariances[0] > 1e-24 * float(np.square(samples).mean()):  # rounding
        return 0.0
    correlations = covariances / covariances[0]
    ends = np.flatnonzero(correlations <= 0.0)
    lasting = 1.0 + 2.0 * float(correlations[1 : ends[0] if len(ends) else count].sum())
    return float(np.sqrt(covariances[0] * lasting / count))
