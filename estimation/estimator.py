"""The protocol of an estimator for the flight stack; plain Python ones are welcome.

A new one is registered by name (`estimation.registry`) and then chosen by parameter.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from estimation.convergence import Convergence, Deviations
from estimation.parameters import EstimationParameters
from quadrotor.records import Record


class Estimator(Protocol):
    """Fed by IMU samples, poses and bearings in the order they arrive; records have shape (1,)."""

    @property
    def initialized(self) -> bool:
        """Return whether a first measurement gave it a start."""
        ...

    @property
    def measurement_age(self) -> float:
        """Return seconds from the newest measurement applied to the newest sample; inf before
        both.
        """
        ...

    @property
    def stale(self) -> bool:
        """Return whether the newest measurement is older than the time-out: it only predicts."""
        ...

    @property
    def converged(self) -> bool:
        """Return whether it is fit to be flown on."""
        ...

    @property
    def convergence(self) -> Convergence:
        """Return whether it is fit to be flown on, with the reason."""
        ...

    @property
    def deviations(self) -> Deviations | None:
        """Return standard deviations by the estimator's own covariance; None when it has none."""
        ...

    def configure(self, parameters: EstimationParameters) -> None:
        """Take new gains; the state is kept."""
        ...

    def reset(self) -> None:
        """Forget everything, biases included: after the gyroscope was calibrated again."""
        ...

    def initialize(self, pose: Record) -> None:
        """Start again at a POSE_SAMPLE, at rest. Raises MeasurementError."""
        ...

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE that came `dt` s after the last, and write the STATE."""
        ...

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE, late ones too; write innovations. Raises MeasurementError."""
        ...

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        """Apply a BEARINGS_SAMPLE, late ones too. Raises MeasurementError."""
        ...

    def report(self, estimate: Record) -> None:
        """Write biases, measurement age and counts of measurements into an ESTIMATE."""
        ...

    def warnings(self, rate: float) -> list[str]:
        """Return what is wrong with the gains at this rate (Hz) of measurements."""
        ...


@runtime_checkable
class TakesHeading(Protocol):
    """An estimator that can run on the positions of a marker."""

    def take_heading(self) -> None:
        """Take the heading stated, on such positions: the vehicle is armed."""
        ...


def fewest_beacons(estimator: Estimator) -> int:
    """Return how many beacons in a frame an estimator can go on with: 4 unless it says otherwise
    by an attribute of this name."""
    return int(getattr(estimator, "fewest_beacons", 4))
