"""Detects a beacon whose bearings have a mean error, and identifies it.

Noise averages out; a misplaced beacon or a biased measurement does not. Over the last seconds
each beacon has a mean residual e (tangent, 2 numbers of variance sigma^2 / N). An error
delta of the pose used for the residuals appears in all of them, e = H delta with
H = [-(I - d d^T) / rho, -[d] cross] at the direction d and distance rho, so that one beacon that
is off pulls the estimate and spreads over the residuals of all. Hence two questions:

- *Do the beacons fit together?* The chi-square of the residuals that no delta explains has
  2 n - 6 degrees of freedom for n beacons. Errors of the pose, a common turn of all bearings and
  their delay do not count in it.
- *Which one does not?* The one without which the others fit best, clearly better than without any
  other. With the tracker's pose delta is nearly known, and this is a matter of some degrees.
  Without it five beacons are needed: with four, any one left out leaves 6 numbers for the 6 of
  the pose, and the others always fit.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.plain_rotations import matrix_of

Array = npt.NDArray[np.float64]

FALSE_ALARM = 1e-6
"""Probability that good Gaussian bearings exceed the bound of one window."""
_DEVIATIONS = 4.753
"""Standard deviations that a Gaussian exceeds with that probability."""
MARGIN = 20.0
"""Margin by which a beacon must explain more chi-square than any other: odds of e^10."""
TRACKER = np.repeat([0.02, math.radians(1.0)], 3)
"""Deviations (m, rad) of the tracker's pose, including its delay and alignment to the body."""
ANYWHERE = np.repeat([1.0, 1.0], 3)
"""Variance of a pose that is only known roughly."""
LEAST = 4
"""Least number of beacons for meaningful residuals."""
FEWEST_FRAMES = 15.0
"""Least number of frames in the means before anything is judged."""
LARGEST = 10.0
"""sigma, the limit that residuals are clipped to, so that one swapped id does not look like a
bias."""
PERIOD = 0.2
"""s between two tests."""
NEAREST = 0.05
"""m; the direction to a nearer beacon is not used."""


@dataclass(frozen=True, slots=True)
class Offset:
    """A beacon whose bearings are off by `angle` (rad); None when it cannot be identified."""

    beacon: Hashable | None
    angle: float


class BeaconOffsets:
    """Mean residuals of each beacon over an exponential window, tested several times a second.

    Attributes:
        window: s, time constant of the means. largest: rad, the largest acceptable mean offset.
        suspect: the beacon that is off, None while all are consistent.
    """

    def __init__(self, window: float = 2.0, largest: float = math.radians(1.5)) -> None:
        self.window, self.largest = window, largest
        self.begin()

    def begin(self) -> None:
        """Discard all means."""
        self.suspect: Offset | None = None
        self._rows: dict[Hashable, int] = {}
        self._tracked = False
        self._clear()
        self._time = self._judged = -math.inf
        self._doubted: float | None = None
        self._fitted: float | None = None

    def frame(
        self,
        time: float,
        beacons: Sequence[Hashable],
        places_w: Array,
        bearings_b: Array,
        sigma: float,
        position_w: Array,
        quaternion_wb: Array,
        tracked: bool,
    ) -> None:
        """Add one frame.

        Args:
            time: s. beacons: (N,) their ids. places_w: (N, 3) m.
            bearings_b: (N, 3) unit. sigma: rad. position_w: (3,) m and quaternion_wb: (4,), the
                pose at that time. tracked: whether that is the tracker's, else an estimate from
                bearings.
        """
        if tracked is not self._tracked or not 0.0 <= time - self._time <= self.window:
            self._clear()
        self._tracked = tracked
        decay = math.exp(-(time - self._time) / self.window) if len(self._sums) else 1.0
        self._time, self._sigma = time, sigma
        rows = [self._row(one) for one in beacons]
        away = places_w - position_w
        distance = np.sqrt((away * away).sum(axis=1, keepdims=True))
        d = away / np.maximum(distance, NEAREST)
        seen = bearings_b @ matrix_of(quaternion_wb).T
        along = (seen * d).sum(axis=1, keepdims=True)
        e = seen - along * d
        sine = np.sqrt((e * e).sum(axis=1, keepdims=True))
        angle = np.minimum(np.arctan2(sine, along), LARGEST * sigma)
        self._sums *= decay
        self._squares *= decay * decay
        ones = np.ones_like(distance)
        parts = [e * (angle / np.maximum(sine, 1e-12)), d, 1.0 / np.maximum(distance, NEAREST)]
        self._sums[rows] += np.concatenate([*parts, ones], axis=1)
        self._squares[rows] += 1.0
        if time - self._judged >= PERIOD:
            self._judged = time
            self._judge()

    # ------------------------------------------------------------------ parts
    def _clear(self) -> None:
        self._rows = {}
        self._sums = np.zeros((0, 8))  # residual, direction, 1/distance, weight
        self._squares = np.zeros(0)  # of the weights
        self._doubted = self._fitted = None

    def _row(self, beacon: Hashable) -> int:
        row = self._rows.get(beacon)
        if row is None:
            row = self._rows[beacon] = len(self._rows)
            self._sums = np.concatenate([self._sums, np.zeros((1, 8))])
            self._squares = np.append(self._squares, 0.0)
        return row

    def _judge(self) -> None:
        weight = self._sums[:, 7]
        count = weight * weight / np.maximum(self._squares, 1e-12)
        known = (count >= FEWEST_FRAMES) & (weight >= 0.1 * weight.max(initial=0.0))
        if known.sum() < LEAST:
            return
        names = [name for name, row in self._rows.items() if known[row]]
        means = self._sums[known] / weight[known, None]
        fit = _Fit(means, self._sigma / np.sqrt(count[known]))
        unexplained = fit.chi_square(ANYWHERE)
        n = len(names)
        bound = _bound(2 * n - 6)
        if unexplained <= bound:
            self._doubted = None
            if self.suspect is None or unexplained > 0.5 * bound:
                self._fitted = None
            elif self._fitted is None:
                self._fitted = self._time
            elif self._time - self._fitted >= self.window:
                self.suspect = None
            return
        self._fitted = None
        left, angles = fit.without_each(TRACKER if self._tracked else ANYWHERE)
        order = np.argsort(left)
        best = int(order[0])
        others = fit.without_each(ANYWHERE)[0][best]
        if left[order[1]] - left[best] > MARGIN and others <= _bound(2 * n - 8):
            if angles[best] > self.largest:
                self.suspect = Offset(names[best], float(angles[best]))
            return
        if self._doubted is None:
            self._doubted = self._time
        named = self.suspect is not None and self.suspect.beacon is not None
        waited = self._time - self._doubted >= self.window
        if waited and not named and angles.max() > self.largest:
            self.suspect = Offset(None, float(angles.max()))


class _Fit:
    """Fits a pose error to the mean residuals of n beacons by least squares."""

    def __init__(self, means: Array, deviations: Array) -> None:
        e, d, inverse_distance = means[:, :3], means[:, 3:6], means[:, 6]
        d = d / np.sqrt((d * d).sum(axis=1, keepdims=True))
        t = np.cross(d, np.eye(3)[np.abs(d).argmin(axis=1)])
        t /= np.sqrt((t * t).sum(axis=1, keepdims=True))
        T = np.stack([t, np.cross(d, t)], axis=1)  # (n, 2, 3)
        self.e = np.einsum("nij,nj->ni", T, e)
        # A rotation phi moves the direction by phi x d: along t by phi . (d x t).
        across = np.cross(d[:, None, :], T)
        self.H = np.concatenate([-T * inverse_distance[:, None, None], across], axis=2)
        weights = 1.0 / deviations**2
        self._information = np.einsum("nia,nib,n->nab", self.H, self.H, weights)
        self._gradient = np.einsum("nia,ni,n->na", self.H, self.e, weights)
        self._costs = (self.e**2).sum(axis=1) * weights

    def chi_square(self, deviations: Array) -> float:
        """Return the chi-square that no pose error of these deviations (6,) explains."""
        A = self._information.sum(axis=0) + np.diag(1.0 / deviations**2)
        g = self._gradient.sum(axis=0)
        return float(self._costs.sum() - g @ np.linalg.solve(A, g))

    def without_each(self, deviations: Array) -> tuple[Array, Array]:
        """Return the chi-square that is left without each beacon, (n,), and by how much its mean
        bearing is off where the others' pose expects it, (n,) rad."""
        A = self._information.sum(axis=0) - self._information + np.diag(1.0 / deviations**2)
        g = self._gradient.sum(axis=0) - self._gradient
        delta = np.linalg.solve(A, g[:, :, None])[:, :, 0]
        left = self._costs.sum() - self._costs - (g * delta).sum(axis=1)
        off = self.e - np.einsum("nia,na->ni", self.H, delta)
        return left, np.sqrt((off * off).sum(axis=1))


def _bound(freedom: int) -> float:
    """Return the chi-square quantile for FALSE_ALARM (Wilson and Hilferty, 1931)."""
    if freedom <= 0:
        return math.inf
    share = 2.0 / (9.0 * freedom)
    return freedom * (1.0 - share + _DEVIATIONS * math.sqrt(share)) ** 3
