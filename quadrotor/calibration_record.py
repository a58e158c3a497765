"""The result of a calibration, which the station sends to the vehicle, which stores it.

The same record is proposed, stored, and attached to each log for the calibrations in force.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue


class Quality(BaseModel):
    """One figure of the quality of a calibration."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(max_length=64)
    value: float
    unit: str = Field(default="", max_length=16)
    limit: float | None = None
    """Largest good value, for instance of a residual; None if there is no limit."""

    @property
    def good(self) -> bool:
        return self.limit is None or self.value <= self.limit


class CalibrationRecord(BaseModel):
    """A calibration.

    `values` are vehicle parameters, applied all or none; empty for the gyroscope, whose drift is
    measured at each start and is not a parameter. `figures` are results that are not parameters.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(min_length=1, max_length=32)
    """gyroscope, accelerometer, motor, mass, inertia, drag, vibration, tracker_delay or
    tracker_body.
    """
    values: dict[str, ParameterValue] = Field(default={}, max_length=100)
    figures: tuple[Quality, ...] = Field(default=(), max_length=50)
    quality: tuple[Quality, ...] = Field(default=(), max_length=50)
    residuals: tuple[tuple[str, float], ...] = Field(default=(), max_length=200)
    """Residual of each pose, step or axis, by its name and unit ('pose 3, m/s²')."""
    warnings: tuple[str, ...] = Field(default=(), max_length=20)
    conditions: dict[str, str] = Field(default={}, max_length=50)
    """Conditions under which it was made: sensor, rate, battery, samples, simulated or not."""
    run_id: str = Field(default="", max_length=128)
    """The run from which it was made; empty if there was none."""
    requester: str = Field(default="", max_length=64)
    """The person who accepted it; `start` when the vehicle made it by itself."""
    stamp_ns: int = 0
    """Time of the acceptance, ns since 1970 by the vehicle's clock; written by the vehicle."""
    previous: dict[str, ParameterValue] = Field(default={}, max_length=100)
    """The previous values; written by the vehicle."""

    @property
    def good(self) -> bool:
        """Return whether no figure exceeds its limit."""
        return all(figure.good for figure in self.quality)


def parse_record(text: str) -> CalibrationRecord:
    """Parse a record from JSON. Raises MeasurementError that names the first wrong field."""
    try:
        return CalibrationRecord.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the text"
        raise MeasurementError(f"not a calibration record: {where}: {first['msg']}") from None
