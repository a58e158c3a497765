"""Spectra of evenly sampled readings.

A rotor's turns per second follow from its thrust by the propeller's static coefficient.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from quadrotor.constants import THRUST_PER_TURN
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

Values = npt.NDArray[np.floating]

LOST_MAX = 0.1
"""Largest share of missing samples; they are interpolated."""
SEGMENT = 1.0
"""Seconds of samples in one window: the resolution is about its inverse."""
SEGMENTS_MIN = 4


def evenly(time: Array, values: Values) -> tuple[float, Array]:
    """Return the rate (Hz) and the values (N, K) at even steps. Raises MeasurementError for fewer
    than 16 samples, or when more than LOST_MAX of them are missing.
    """
    if len(time) < 16:
        raise MeasurementError(f"{len(time)} samples are too few for a spectrum")
    span = float(time[-1] - time[0])
    count = round(span / float(np.median(np.diff(time)))) + 1 if span > 0.0 else 0
    if not len(time) >= (1.0 - LOST_MAX) * count > 0.0:
        raise MeasurementError(
            f"{len(time)} of {count} samples were received, {100 * (1 - LOST_MAX):.0f} % are needed"
        )
    grid = np.linspace(time[0], time[-1], count)
    columns = [np.interp(grid, time, column) for column in values.T]
    return (count - 1) / span, np.stack(columns, axis=1)


def spectrum(rate: float, values: Array, segment: float = SEGMENT) -> tuple[Array, Array]:
    """Return frequencies (M,) in Hz and the one-sided power spectral density (M, K), by Welch's
    method.

    Args:
        segment: s in one window.

    Raises MeasurementError when the values last less than SEGMENTS_MIN segments.
    """
    from scipy.signal import welch

    length = max(4, int(segment * rate))
    if len(values) < SEGMENTS_MIN * length:
        raise MeasurementError(
            f"{len(values) / rate:.1f} s are too short for a spectrum, "
            f"{SEGMENTS_MIN * segment:g} s are needed"
        )
    frequency, density = welch(values, rate, nperseg=length, axis=0)
    return frequency, density


def density_of(rate: float, values: Array) -> dict[str, list[float]]:
    """Return `frequency` (M,) in Hz and `density` (M,) of values (N, 1), in their unit/√Hz like an
    estimator's white noise (two-sided). Short series are divided into shorter segments.
    """
    segment = min(SEGMENT, len(values) / rate / SEGMENTS_MIN)
    frequency, density = spectrum(rate, values, segment)
    root = np.sqrt(0.5 * density[:, 0])
    return {
        "frequency": frequency.round(4).tolist(),
        "density": [float(f"{one:.4g}") for one in root],
    }


def spectrogram_of(
    rate: float, values: Array, first: float, turns: Sequence[tuple[Array, Array]], most: int
) -> dict[str, object]:
    """Return a signal's density over time and frequency, as `density_of` does: `times` (T,) in s,
    `frequency` (M,) in Hz, `density` (T, M), and `rotors`, their frequencies (4, T).

    Args:
        values: (N, 1), the first one at `first` (s).
        turns: times (s) and turns per second of each rotor.
        most: largest number of columns T; neighbours are averaged to keep it.
    """
    time, frequency, density = spectrogram(rate, values)
    apart = -(-len(time) // most)
    edges = np.arange(0, len(time), apart)
    counts = np.diff(edges, append=len(time))
    time = first + np.add.reduceat(time, edges) / counts
    root = np.sqrt(0.5 * np.add.reduceat(density[:, 0], edges, axis=1) / counts)
    return {
        "times": time.round(4).tolist(),
        "frequency": frequency.round(4).tolist(),
        "density": [[float(f"{one:.3g}") for one in column] for column in root.T.tolist()],
        "rotors": [np.interp(time, at, of_rotor).round(2).tolist() for at, of_rotor in turns],
    }


def spectrogram(rate: float, values: Array) -> tuple[Array, Array, Array]:
    """Return times (T,) in s since the first sample, frequencies (M,) in Hz and density (M, K, T),
    in windows of half a second.
    """
    from scipy.signal import spectrogram as of_windows

    length = min(round(0.5 * rate), len(values))
    frequency, time, density = of_windows(values, rate, nperseg=length, axis=0)
    return time, frequency, density


def rotor_frequency(thrusts: Values) -> Array:
    """Return the turns per second of rotors with these thrusts (N)."""
    turns: Array = np.sqrt(np.maximum(thrusts, 0.0) / THRUST_PER_TURN)
    return turns
