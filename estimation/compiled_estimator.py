"""The common part of estimators whose state is one record that compiled functions advance."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from estimation.convergence import Convergence
from estimation.outcome import Outcome
from quadrotor.records import ESTIMATE, IMU_SAMPLE, STATE, Record


class CompiledEstimator:
    """An estimator with a memory of shape (1,), which has `stamp_ns`, of the newest IMU sample, and
    `outcomes`, the number of measurements with each Outcome.

    Args:
        memory: its record, which it keeps and changes.
        measured: the field with the stamp of the newest applied measurement.
    """

    def __init__(self, memory: Record, measured: str) -> None:
        self.memory = memory
        """The filter's memory, shape (1,), for logs and tests."""
        # Views made once: looking up a field by name takes longer than the subtraction.
        self._stamp_ns, self._measured_ns = memory["stamp_ns"], memory[measured]
        self.initialized = False
        """True once a first measurement has initialized the estimator."""
        self._timeout = math.inf

    @staticmethod
    def outputs() -> tuple[Record, Record, Record]:
        """Return IMU_SAMPLE, STATE and ESTIMATE (1,) like those of the tick, for `direct`."""
        return np.zeros(1, IMU_SAMPLE), np.zeros(1, STATE), np.zeros(1, ESTIMATE)

    @property
    def measurement_age(self) -> float:
        """Return the seconds from the newest applied measurement to the newest sample; inf before
        both.
        """
        if not self.initialized:
            return math.inf
        age_ns: int = self._stamp_ns.item() - self._measured_ns.item()
        return 1e-9 * age_ns if age_ns > 0 else 0.0

    @property
    def stale(self) -> bool:
        """Return whether the newest applied measurement is older than `measurement_timeout`."""
        return self.measurement_age > self._timeout

    @property
    def ignored(self) -> Counter[Outcome]:
        """Return the number of measurements since the reset that were not applied, by Outcome."""
        counts = self.memory["outcomes"][0].tolist()
        counts[Outcome.APPLIED] = 0
        return +Counter(dict(zip(Outcome, counts, strict=True)))

    @property
    def convergence(self) -> Convergence:
        """Return whether the estimate may be used for flight, with the reason."""
        if not self.initialized:
            return Convergence(False, "no measurement to start from yet")
        if self.stale:
            return Convergence(False, f"last measurement applied {self.measurement_age:.2f} s ago")
        return self._judge(self.memory[0])

    @property
    def converged(self) -> bool:
        """Return whether the estimate may be used for flight; `convergence` has the reason."""
        return self.convergence.reached

    def _judge(self, m: np.void) -> Convergence:
        """Return the convergence from the memory of an initialized filter with fresh
        measurements.
        """
        raise NotImplementedError
