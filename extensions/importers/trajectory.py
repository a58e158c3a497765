"""Trajectories: velocities from positions, and alignment of one trajectory to another's world."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from estimation.calibration.motion import angular_velocity, best_turn, interpolated
from estimation.calibration.segmented_fit import solve_segments
from extensions.importers.flight import Track
from extensions.importers.flights import FEWEST
from extensions.importers.frames import quaternion_of
from extensions.importers.rows import blocks
from extensions.importers.track_clock import SURE
from quadrotor.plain_rotations import product_of
from quadrotor.records import Array, Record, Stamps

GAP_NS = 100_000_000
"""Longest gap of the truth, in ns, across which it is compared."""
EDGE = 0.5
"""Seconds beside a gap within which smoothed accelerations are those of its interpolation."""
MOVING = 0.1
"""m/s, speed from which a distance tells something about worlds and clocks."""
PARTS = 16
"""Number of parts of a flight whose errors count as independent."""
CLOCK_PRIOR = (1.0, 0.05)
"""Prior deviations of a clock's offset (s) and rate."""
ROUNDS = 4
"""Number of rounds in which outliers are left out."""
MOST_SAMPLES = 100_000
"""Number of samples of a gyroscope above which neighbours are averaged."""
COARSEST = 0.004
"""Largest step, in s, of averaged samples: within it a vehicle turns about one axis."""
WINDOW = 0.03
"""Time, in s, to either side over which a derivative is taken; at least three samples."""
MARGIN = 4096
"""Rows beside a block that its values depend on, at most: WINDOW at 100 kHz."""


def averaged(seconds: Array, rate: Array) -> tuple[Array, Array]:
    """Return times (M,) and rates (M, 3) of a gyroscope, those of neighbours averaged in a long
    flight.
    """
    step = max(float(np.median(np.diff(seconds))), 1e-6)
    each = max(1, min(-(-len(seconds) // MOST_SAMPLES), int(COARSEST / step)))
    rows = len(seconds) // each * each
    return (
        seconds[:rows].reshape(-1, each).mean(axis=1),
        rate[:rows].reshape(-1, each, 3).mean(axis=1),
    )


def away_from_gaps(grid: Array, at: Array) -> npt.NDArray[np.bool_]:
    """Return which times of a grid are at least EDGE from a gap of a table's stamps, (N,)."""
    steps = np.diff(at)
    gaps = np.flatnonzero(steps > max(1e-9 * GAP_NS, 3.0 * float(np.median(steps))))
    begun = np.searchsorted(at[gaps] - EDGE, grid, "right")
    found: npt.NDArray[np.bool_] = begun == np.searchsorted(at[gaps + 1] + EDGE, grid, "right")
    return found


def derivative(seconds: Array, values: Array) -> Array:
    """Return the derivative of columns from cubics fitted to the neighbours, (N, K)."""
    step = max(float(np.median(np.diff(seconds))), 1e-3)
    half = max(3, round(WINDOW / step))
    weights = np.linalg.pinv(np.vander(np.arange(-half, half + 1) * step, 4, increasing=True))[1]

    def slopes(at: Array, some: Array) -> Array:
        grid = np.arange(at[0], at[-1] + 0.5 * step, step)
        even = np.stack([np.interp(grid, at, column) for column in some.T])
        even = np.pad(even, ((0, 0), (half, half)), mode="reflect", reflect_type="odd")
        found = [np.convolve(row, weights[::-1], mode="valid") for row in even]
        return np.stack([np.interp(at, grid, row) for row in found], axis=1)

    return _in_blocks(slopes, seconds, values, values.shape[1])


def rates_of(seconds: Array, quaternions: Array) -> Array:
    """Return the angular velocity (rad/s, body axes) of attitudes, (N, 3)."""
    return _in_blocks(angular_velocity, seconds, quaternions, 3)


def _in_blocks(
    made: Callable[[Array, Array], Array], seconds: Array, values: Array, width: int
) -> Array:
    """Return (N, width) what is made of each block of rows with those beside it: a flight may have
    millions.
    """
    found = np.empty((len(seconds), width))
    for some in blocks(found):
        near = slice(max(some.start - MARGIN, 0), some.stop + MARGIN)
        block = made(seconds[near], values[near])
        found[some] = block[some.start - near.start :][: some.stop - some.start]
    return found


def world_turn(own: Array, true: Array) -> Array:
    """Return the rotation from one world with z up to the other, (3, 3).

    A tilt that the motion does not surely show would turn gravity in all that follows: without it
    the rotation is about z.
    """
    parts = np.array_split(np.arange(len(own)), PARTS)
    without = [np.setdiff1d(np.arange(len(own)), rows) for rows in parts]
    tilts = np.array([best_turn(own[rows], true[rows]).matrix[:, 2] for rows in without])
    spread = math.sqrt((PARTS - 1) * ((tilts - tilts.mean(axis=0)) ** 2).sum(axis=1).mean())
    whole = best_turn(own, true).matrix
    if np.hypot(*whole[:2, 2]) > SURE * spread or whole[2, 2] < 0.0 < 1.0 - SURE * spread:
        return whole
    one, other = (values[:, :2] - values[:, :2].mean(axis=0) for values in (own, true))
    c, s = (one * other).sum(), (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    length = max(math.hypot(c, s), 1e-12)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, length]]) / length


def _lateness(velocity_w: Array, seconds: Array, error_w: Array) -> tuple[float, float]:
    """Return by how much a clock is late, in s, and how fast that grows, each 0 unless it is sure.

    Args:
        velocity_w: (N, 3); seconds: (N,), from the middle; error_w: (N, 3), of the positions in m.
    """
    lead = np.stack([velocity_w, velocity_w * seconds[:, None]], axis=2)
    parts = np.array_split(np.arange(len(error_w)), PARTS)
    free = [np.empty((len(rows), 0)) for rows in parts]
    fit = solve_segments(-lead, error_w, parts, free, CLOCK_PRIOR, None)
    late, rate = np.where(np.abs(fit.values) > SURE * fit.deviations, fit.values, 0.0)
    return float(late), float(rate)


def _set_clock(truth: Track, at_ns: Stamps, error_w: Array) -> float:
    """Set the clock of the truth by the errors (N, 3) of an estimate at N stamps of its own.

    Return by how much it was moved in the middle, s; 0 where nothing is sure.
    """
    stamps = truth.stamps_ns
    velocity_w = interpolated(at_ns, stamps, truth.states["velocity_w"])
    seconds = (at_ns - at_ns[0]) * 1e-9
    late, rate = _lateness(velocity_w, seconds - 0.5 * seconds[-1], error_w)
    if late == 0.0 and rate == 0.0:
        return 0.0
    shift = -(late + rate * ((stamps - at_ns[0]) * 1e-9 - 0.5 * seconds[-1]))
    truth.stamps_ns = stamps + np.round(1e9 * shift).astype(np.int64)
    return float(shift[len(shift) // 2])


def align(truth: Track, estimate: Track, sweeps: Record | None, notes: list[str]) -> None:
    """Rotate and move the estimate into the truth's world if its world is another one, and with it
    the planes of the sweeps from which it was made.

    If the truth has no attitude, its clock is fitted too: offset and rate, each where it is surely
    not 0.
    """
    at, moved = estimate.stamps_ns, 0.0
    states = estimate.states
    for _ in range(ROUNDS):
        stamps = truth.stamps_ns
        after_it = np.clip(np.searchsorted(stamps, at), 1, len(stamps) - 1)
        inside = (at >= stamps[0]) & (at <= stamps[-1])
        inside &= stamps[after_it] - stamps[after_it - 1] < GAP_NS
        if inside.sum() < FEWEST:
            return
        true = interpolated(at[inside], stamps, truth.states["position_w"])
        own = states["position_w"][inside]
        moving = interpolated(at[inside], stamps, truth.states["velocity_w"])
        moving = np.linalg.norm(moving, axis=1) > MOVING
        moving |= moving.sum() < FEWEST
        near = np.ones(len(own), bool)
        for _ in range(ROUNDS):  # an estimate may be wrong for a while at its start
            here, there = own[near].mean(axis=0), true[near].mean(axis=0)
            matrix = world_turn(own[near], true[near])
            error = (own - here) @ matrix.T + there - true
            length = np.linalg.norm(error, axis=1)
            near = length <= max(3.0 * float(np.median(length[moving])), 1e-6)
        late = 0.0 if truth.attitude_known else _set_clock(truth, at[inside][near], error[near])
        if late == 0.0:
            break
        moved += late
    before, after = (
        float(np.sqrt((one[near] ** 2).mean()))
        for one in (np.linalg.norm(own - true, axis=1), length)
    )
    if moved:
        notes.append(f"[truth] its clock was moved by {1e3 * moved:.1f} ms more by its positions")
    if before < 0.1 or before < 2.0 * after:
        return
    states["position_w"] = (states["position_w"] - here) @ matrix.T + there
    states["velocity_w"] = states["velocity_w"] @ matrix.T
    if estimate.attitude_known:
        states["quaternion_wb"] = product_of(quaternion_of(matrix), states["quaternion_wb"])
    if sweeps is not None:
        plane, turn = sweeps["plane"], quaternion_of(matrix)
        plane["origin_w"] = (plane["origin_w"] - here) @ matrix.T + there
        plane["quaternion_wr"] = product_of(turn, plane["quaternion_wr"])
    notes.append(
        f"[estimate] is of another world than the truth ({before:.3f} m rms apart): turned and "
        f"moved into it ({after:.3f} m rms)"
    )
