"""Monitors from the innovations whether flight on bearings may continue.

It is independent of the estimator: each bearing is compared with the direction to the beacon
according to the estimate at the frame's stamp. The squared angle over its expected variance, from
the sensor's noise and the estimate's own deviations, has mean 1 for a consistent estimate.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from estimation.convergence import Deviations, Difference
from estimation.outcome import LATEST_NS
from quadrotor.records import Record
from vehicle.estimators.beacon_offsets import BeaconOffsets
from vehicle.parameters import FallBackParameters

Array = npt.NDArray[np.float64]

Past = tuple[int, Array, Array]
"""Stamp (ns), position_w (3,) m and quaternion_wb (4,) of an estimate."""

UNKNOWN = Deviations(position=0.1, velocity=0.2, attitude=math.radians(1.5))
"""Deviations assumed for an estimator without a covariance."""
FEWEST_FRAMES = 5
"""Least number of bearings in the window for a judgement."""
IN_A_ROW = 10
"""Number of successive poses that must disagree: 0.1 s of a 100 Hz tracker."""


class BearingsWatch:
    """Judges the estimate in use during flight on bearings.

    Args:
        parameters: read at each frame.

    Attributes:
        verdict: why flight on bearings has to end, with numbers; None while all is well. It
        stays until `begin`.
        offsets: whether the bearings of one beacon are off on average.
    """

    def __init__(self, parameters: FallBackParameters) -> None:
        self.parameters = parameters
        self.verdict: str | None = None
        self.offsets = BeaconOffsets()
        self._past: deque[Past] = deque()
        self._tracked: deque[Past] = deque()
        self._frames: deque[tuple[int, int, int, float]] = deque()
        self._apart = 0

    def begin(self) -> None:
        """Clear the history: flight on bearings begins now."""
        self.verdict = None
        self.offsets.begin()
        self._past.clear()
        self._tracked.clear()
        self._frames.clear()
        self._apart = 0

    def remember(self, stamp_ns: int, state: Record, tracked: Record | None = None) -> None:
        """Store the estimate of one tick, a STATE of shape (1,), and the one from the tracker's
        poses.
        """
        for past, one in ((self._past, state), (self._tracked, tracked)):
            if one is not None:
                pose = one["position_w"][0].copy(), one["quaternion_wb"][0].copy()
                past.append((stamp_ns, *pose))
            while past and past[0][0] < stamp_ns - LATEST_NS:  # frames this late are not used
                past.popleft()

    def frame(self, frame: Record, deviations: Deviations | None, now_ns: int) -> list[int]:
        """Judge one BEARINGS_SAMPLE (1,) before it is applied.

        Returns the rows of the bearings that passed the gate; all of them when the estimate at
        the frame's stamp is not known, or when judging is off.
        """
        f = frame[0]
        count = int(f["count"])
        then = _at(self._past, int(f["stamp_ns"])) if self.parameters.enabled else None
        if then is None:
            return list(range(count))
        p = self.parameters
        squares = normalised_squares(
            then[1],
            then[2],
            f["beacon_w"][:count],
            f["bearing_b"][:count],
            float(f["sigma"]),
            deviations or UNKNOWN,
        )
        gate = 0.5 * p.gate**2  # the mean of two squares
        passed = [k for k, square in enumerate(squares) if square < gate]  # NaN does not pass
        total = sum(squares[k] for k in passed)
        self._frames.append((now_ns, count, count - len(passed), total))
        while self._frames[0][0] < now_ns - 1e9 * p.window:
            self._frames.popleft()
        self._judge(deviations)
        return passed

    def average(self, frame: Record, ids: Sequence[int], tracked: bool) -> None:
        """Add one BEARINGS_SAMPLE (1,) to the mean residual of each beacon.

        Args:
            ids: of its bearings. tracked: whether the estimate from the tracker's poses is good
            and therefore used for the residuals.
        """
        f = frame[0]
        stamp_ns, count = int(f["stamp_ns"]), int(f["count"])
        then = _at(self._tracked if tracked else self._past, stamp_ns)
        if then is None:
            return
        offsets, p = self.offsets, self.parameters
        offsets.window, offsets.largest = p.beacon_window, math.radians(p.beacon_offset_max)
        offsets.frame(
            1e-9 * stamp_ns,
            ids,
            f["beacon_w"][:count],
            f["bearing_b"][:count],
            float(f["sigma"]),
            position_w=then[1],
            quaternion_wb=then[2],
            tracked=tracked,
        )

    def age(self, age: float) -> None:
        """Return the time (s) since the newest frame applied was true."""
        if age > self.parameters.age_max:
            self._say(f"no frame of bearings applied for {age:.2f} s")

    def pose(self, apart: Difference) -> None:
        """Check the distance between the estimate and that of the tracker's poses, once a pose."""
        p = self.parameters
        near = apart.position <= p.disagreement_max and apart.attitude <= math.radians(
            p.disagreement_attitude_max
        )
        self._apart = 0 if near else self._apart + 1
        if self._apart >= IN_A_ROW:
            self._say(
                f"{apart} away from the tracker's poses, allowed {p.disagreement_max:g} m, "
                f"{p.disagreement_attitude_max:g}°"
            )

    @property
    def rejected(self) -> float:
        """Return the share of the bearings in the window that were beyond the gate."""
        seen = sum(count for _, count, _, _ in self._frames)
        return sum(frame[2] for frame in self._frames) / max(seen, 1)

    @property
    def consistency(self) -> float:
        """Return the mean of the normalised squares in the window that passed the gate; about 1
        or below.
        """
        passed = sum(count - rejected for _, count, rejected, _ in self._frames)
        return sum(frame[3] for frame in self._frames) / max(passed, 1)

    # ------------------------------------------------------------------ parts
    def _judge(self, deviations: Deviations | None) -> None:
        p = self.parameters
        if deviations is not None and not (
            deviations.position < p.position_deviation_max
            and deviations.attitude < math.radians(p.attitude_deviation_max)
        ):
            self._say(
                f"deviations {deviations.position:.3f} m, "
                f"{math.degrees(deviations.attitude):.2f}°, allowed "
                f"{p.position_deviation_max:g} m, {p.attitude_deviation_max:g}°"
            )
        if len(self._frames) < FEWEST_FRAMES:
            return
        rejected, consistency = self.rejected, self.consistency
        if rejected > p.rejected_max:
            self._say(f"{rejected:.0%} of the bearings rejected, allowed {p.rejected_max:.0%}")
        elif consistency > p.consistency_max:
            self._say(
                f"innovations {consistency:.1f} times their expected square, "
                f"allowed {p.consistency_max:g}"
            )

    def _say(self, why: str) -> None:
        if self.verdict is None and self.parameters.enabled:
            self.verdict = why


def _at(kept: deque[Past], stamp_ns: int) -> Past | None:
    """Return the newest stored estimate not after this time."""
    for past in reversed(kept):
        if past[0] <= stamp_ns:
            return past
    return None


def normalised_squares(
    position_w: Array,
    quaternion_wb: Array,
    beacons_w: Array,
    bearings_b: Array,
    sigma: float,
    deviations: Deviations,
) -> list[float]:
    """Return the squared angle between each bearing and its prediction over its expected value.

    Args:
        position_w: (3,) m. quaternion_wb: (4,). beacons_w: (N, 3) m. bearings_b: (N, 3) unit.
        sigma: rad on each tangent axis. deviations: of the pose predicted from.
    """
    x, y, z = position_w.tolist()
    qw, qx, qy, qz = quaternion_wb.tolist()
    # Variance of one axis out of the three that the deviations sum up.
    turn, move = deviations.attitude**2 / 3.0, deviations.position**2 / 3.0
    out = []
    for (bx, by, bz), seen in zip(beacons_w.tolist(), bearings_b.tolist(), strict=True):
        u, v, w = bx - x, by - y, bz - z
        far2 = max(u * u + v * v + w * w, 1e-6)
        # R^T d = d + 2 q x (q x d - w d), q the vector part.
        a, b, c = qy * w - qz * v - qw * u, qz * u - qx * w - qw * v, qx * v - qy * u - qw * w
        wanted = (
            u + 2.0 * (qy * c - qz * b),
            v + 2.0 * (qz * a - qx * c),
            w + 2.0 * (qx * b - qy * a),
        )
        angle = _angle(wanted, seen)
        out.append(0.5 * angle * angle / (sigma * sigma + turn + move / far2))
    return out


def _angle(one: Sequence[float], other: Sequence[float]) -> float:
    a, b, c = one
    d, e, f = other
    sine = math.sqrt((b * f - c * e) ** 2 + (c * d - a * f) ** 2 + (a * e - b * d) ** 2)
    return math.atan2(sine, a * d + b * e + c * f)
