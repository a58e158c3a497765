"""Trajectories: velocities of positions, and one trajectory turned into the world of another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flight_log.imports.flight import Track
from flight_log.imports.frames import product_of, quaternion_of
from flight_log.imports.motion import best_turn, interpolated

Array = npt.NDArray[np.float64]

WINDOW = 0.03
"""s to either side of what a derivative is taken over; three samples at least."""


def derivative(seconds: Array, values: Array) -> Array:
    """Return the derivative of columns by a cubic through the neighbours, (N, 3)."""
    step = max(float(np.median(np.diff(seconds))), 1e-3)
    half = max(3, round(WINDOW / step))
    grid = np.arange(seconds[0], seconds[-1] + 0.5 * step, step)
    even = interpolated(grid, seconds, values)
    even = np.pad(even, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    weights = np.linalg.pinv(np.vander(np.arange(-half, half + 1) * step, 4, increasing=True))[1]
    slopes = np.stack([np.convolve(one, weights[::-1], mode="valid") for one in even.T], axis=1)
    return interpolated(seconds, grid, slopes)


def align(truth: Track, estimate: Track, notes: list[str]) -> None:
    """Turn and move the estimate into the truth's world where its own is another one."""
    inside = (estimate.stamps_ns >= truth.stamps_ns[0]) & (
        estimate.stamps_ns <= truth.stamps_ns[-1]
    )
    if inside.sum() < 50:
        return
    true = interpolated(estimate.stamps_ns[inside], truth.stamps_ns, truth.states["position_w"])
    own = estimate.states["position_w"][inside]
    matrix = best_turn(own - own.mean(axis=0), true - true.mean(axis=0)).matrix
    moved = (own - own.mean(axis=0)) @ matrix.T + true.mean(axis=0)
    before, after = (float(np.sqrt(((x - true) ** 2).sum(axis=1).mean())) for x in (own, moved))
    if before < 0.1 or before < 2.0 * after:
        return
    states = estimate.states
    states["position_w"] = (states["position_w"] - own.mean(axis=0)) @ matrix.T + true.mean(axis=0)
    states["velocity_w"] = states["velocity_w"] @ matrix.T
    if estimate.attitude_known:
        states["quaternion_wb"] = product_of(quaternion_of(matrix), states["quaternion_wb"])
    notes.append(
        f"[estimate] is of another world than the truth ({before:.3f} m rms apart): turned and "
        f"moved into it ({after:.3f} m rms)"
    )
