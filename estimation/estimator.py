"""The protocol of an estimator for the flight stack; estimators in plain Python are welcome.

A new estimator is registered by name (`estimation.registry`) and then selected by parameter.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from estimation.convergence import Convergence, Deviations
from estimation.outcome import JudgedReading
from estimation.parameters import EstimationParameters
from quadrotor.records import Record


class Estimator(Protocol):
    """An estimator, which receives IMU samples, poses and bearings in the order of arrival; records
    have shape (1,).
    """

    @property
    def initialized(self) -> bool:
        """Return whether a first measurement has initialized it."""
        ...

    @property
    def measurement_age(self) -> float:
        """Return the seconds from the newest applied measurement to the newest sample; inf before
        both.
        """
        ...

    @property
    def stale(self) -> bool:
        """Return whether the newest measurement is older than the timeout, so that it only
        predicts.
        """
        ...

    @property
    def converged(self) -> bool:
        """Return whether it may be flown on."""
        ...

    @property
    def convergence(self) -> Convergence:
        """Return whether it may be flown on, with the reason."""
        ...

    @property
    def deviations(self) -> Deviations | None:
        """Return standard deviations from the estimator's own covariance; None when it has none."""
        ...

    def configure(self, parameters: EstimationParameters) -> None:
        """Set new gains; the state is kept."""
        ...

    def reset(self) -> None:
        """Forget everything, biases included; called after the gyroscope was calibrated again."""
        ...

    def initialize(self, pose: Record) -> None:
        """Restart at a POSE_SAMPLE, at rest. Raises MeasurementError."""
        ...

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE that follows the last one by `dt` s, and write the STATE."""
        ...

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE, delayed or not; write innovations. Raises MeasurementError."""
        ...

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        """Apply a BEARINGS_SAMPLE, delayed or not. Raises MeasurementError."""
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
        """Set the heading to that of the parameters, when it runs on such positions: the vehicle is
        armed.
        """
        ...


@runtime_checkable
class TakesReadings(Protocol):
    """An estimator that single numbers of further sensors can correct."""

    def correct_reading(self, reading: Record) -> JudgedReading:
        """Apply a READING_SAMPLE, delayed or not. Raises MeasurementError."""
        ...


def fewest_beacons(estimator: Estimator) -> int:
    """Return the number of beacons in a frame that an estimator needs to continue: 4 unless it has
    an attribute of this name.
    """
    return int(getattr(estimator, "fewest_beacons", 4))
