"""What the flight stack asks of any estimator; plain Python ones are welcome."""

from __future__ import annotations

from typing import Protocol

from estimation.parameters import EstimationParameters
from quadrotor.records import Record


class Estimator(Protocol):
    """Fed by IMU samples and poses in the order they arrive; all records have shape (1,)."""

    @property
    def initialized(self) -> bool:
        """A first pose was taken."""
        ...

    @property
    def measurement_age(self) -> float:
        """Seconds from the newest pose applied to the newest IMU sample; inf before both."""
        ...

    @property
    def stale(self) -> bool:
        """The newest pose is older than the time-out: the estimate is only predicted."""
        ...

    def configure(self, parameters: EstimationParameters) -> None:
        """Take new gains; the state is kept."""
        ...

    def reset(self) -> None:
        """Forget everything, biases included: after the gyroscope was calibrated anew."""
        ...

    def initialize(self, pose: Record) -> None:
        """Start anew at a POSE_SAMPLE, at rest. Raises MeasurementError."""
        ...

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE that came `dt` s after the last, and write the STATE."""
        ...

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE, late ones too; write innovations. Raises MeasurementError."""
        ...

    def report(self, estimate: Record) -> None:
        """Write biases and measurement age into an ESTIMATE."""
        ...
