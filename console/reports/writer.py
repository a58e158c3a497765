"""The writer of reports, which an extension offers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from console.evaluation.result import Result
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import UsageError
from quadrotor.extension import ReportWriter
from quadrotor.extensions import registry
from quadrotor.parameter_description import ParameterValue

Defaults = Callable[[], Mapping[str, ParameterValue]]
"""Function that returns name → default, called only for logs without defaults."""


class Write(Protocol):
    """Writes the report of a log into a folder, and returns its files."""

    def __call__(
        self,
        log: Path,
        folder: Path,
        *,
        pdf: bool = True,
        result: Result | None = None,
        proposal: CalibrationRecord | None = None,
        defaults: Defaults | None = None,
        progress: Callable[[float], None] = lambda share: None,
    ) -> list[Path]:
        """Write the report; earlier ones of this log are replaced.

        Args:
            result, proposal: of a flight that has just ended; otherwise the report finds them.
            defaults: returns the parameters' defaults; None for those that the station knows.
            progress: called with the share that is done, 0 to 1.

        Raises UsageError, StorageError or LogFormatError.
        """


def has_report_writer() -> bool:
    """Return whether an extension writes reports."""
    return bool(registry().offers(ReportWriter))


def report_writer() -> Write:
    """Return the writer. Raises UsageError if there is none, or if it cannot be imported."""
    for offered in registry().offers(ReportWriter).values():
        write: Write = offered.load()
        return write
    raise UsageError("no extension of this installation writes reports; install one that does")
