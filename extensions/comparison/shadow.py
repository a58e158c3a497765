"""One estimator that runs at the station: as on board, its only input is IMU and bearings."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from quadrotor.errors import MeasurementError
from quadrotor.records import ESTIMATE, Array, Record, new_state

if TYPE_CHECKING:
    from estimation.estimator import Estimator


MEASURED_NS = 5_000_000_000
"""Time of the vehicle, in ns, over which the processor's share is measured."""


class Shadow:
    """An estimator in parallel with the vehicle's own; its estimate never reaches the vehicle.

    Args:
        timer: returns the processor time of the calling thread, s.

    Attributes:
        state: STATE (1,) after the newest sample.
        complaint: why the last frame could not be used; empty when it could.
    """

    def __init__(self, estimator: Estimator, timer: Callable[[], float] = time.thread_time) -> None:
        self.estimator = estimator
        self.state: Record = new_state()
        self.complaint = ""
        self._estimate = np.zeros(1, ESTIMATE)
        self._timer = timer
        self._spent: deque[tuple[int, float]] = deque()  # stamp and total at the end of a packet
        self._total = 0.0

    def advance(
        self, imu: Record, steps: Sequence[float], frames: Sequence[tuple[int, Record]]
    ) -> None:
        """Advance by samples (N,), each `steps` s after the previous one, with frames due after
        some.

        Args:
            frames: (index of the sample that it follows, BEARINGS_SAMPLE), in order.
        """
        began = self._timer()
        estimator, state = self.estimator, self.state
        coming = iter(frames)
        due, frame = next(coming, (-1, None))
        for k, step in enumerate(steps):
            estimator.predict(imu[k : k + 1], step, state)
            while frame is not None and due == k:
                self._correct(frame)
                due, frame = next(coming, (-1, None))
        self._total += self._timer() - began
        newest_ns = int(imu["stamp_ns"][-1])
        self._spent.append((newest_ns, self._total))
        while newest_ns - self._spent[0][0] > MEASURED_NS:
            self._spent.popleft()

    def reset(self) -> None:
        """Forget everything; the next frame that determines a pose initializes it again."""
        self.estimator.reset()
        self.state[:] = new_state()
        self._spent.clear()
        self.complaint = ""

    @property
    def initialized(self) -> bool:
        return self.estimator.initialized

    @property
    def processor(self) -> float:
        """Return the share of a core over the last seconds, NaN before it is known."""
        if len(self._spent) < 2:
            return math.nan
        (first_ns, first), (last_ns, last) = self._spent[0], self._spent[-1]
        return (last - first) / (1e-9 * (last_ns - first_ns))

    def covariance(self) -> tuple[Array, float]:
        """Return the covariance of position, (9,) m^2 world axes, and the sum of the variances of
        attitude, rad^2.

        Both are from the attribute `covariance` of an estimator that has it (position and attitude
        first), else a sphere from its `deviations`; NaN without either.
        """
        full = getattr(self.estimator, "covariance", None)
        if full is not None:
            return full[:3, :3].ravel(), float(np.trace(full[3:6, 3:6]))
        deviations = self.estimator.deviations
        if deviations is None:
            return np.full(9, math.nan), math.nan
        return np.eye(3).ravel() * deviations.position**2 / 3.0, deviations.attitude**2

    def _correct(self, frame: Record) -> None:
        try:
            self.estimator.correct_bearings(frame, self._estimate)
            self.complaint = ""
        except MeasurementError as error:
            self.complaint = str(error)
