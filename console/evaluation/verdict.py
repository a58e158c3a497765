"""The verdict: figures compared with limits, some of which are necessary for a verdict.

A figure beyond its limit fails the flight. A flight that keeps to all existing limits, but lacks
one for a deciding figure, is not judged, and the reason names the figure without a limit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from console.evaluation.flight_checks import flight_checks, with_checks
from console.evaluation.result import FAILED, NOT_JUDGED, PASSED, VERDICTS, Evaluable, Result
from quadrotor.errors import MeasurementError

NO_LIMITS = "no figure has a limit"


def judged(
    metrics: Mapping[str, float],
    limits: Mapping[str, float],
    deciding: Collection[str] = (),
    because: str = "",
) -> Result:
    """Return the result of comparing figures with their largest allowed values.

    Args:
        metrics, limits: by name. A figure that is missing or NaN exceeds its limit.
        deciding: names of figures without whose limits there is no verdict.
        because: why one of them has no limit.
    """
    metrics, limits = dict(metrics), dict(limits)
    if not all(metrics.get(name, float("nan")) <= limit for name, limit in limits.items()):
        return Result(FAILED, metrics, limits)
    without = [name for name in deciding if name not in limits]
    if without:
        reason = f"no limit for {', '.join(without)}"
        return Result(NOT_JUDGED, metrics, limits, f"{reason}: {because}" if because else reason)
    return settled(Result(PASSED, metrics, limits))


def settled(result: Result) -> Result:
    """Return the result; a pass without any limit becomes "not judged"."""
    if result.verdict == PASSED and not result.limits:
        return replace(result, verdict=NOT_JUDGED, reason=NO_LIMITS)
    return result


def evaluated(experiment: Evaluable, log: Path) -> Result:
    """Return the result of any experiment for a log, which its flight's end and emergencies can
    fail.

    Raises what its `evaluate` raises, MeasurementError for a result that is none, LogFormatError
    or StorageError.
    """
    result = _plain(experiment.name, experiment.evaluate(log))
    return with_checks(settled(result), flight_checks(log))


def _plain(name: str, result: Result) -> Result:
    """Return a result with plain numbers: numpy's are fine, texts are not."""
    if result.verdict not in VERDICTS:
        raise MeasurementError(
            f"the verdict of {name} is {result.verdict!r:.40}; allowed are {', '.join(VERDICTS)}"
        )
    try:
        metrics = {str(key): float(value) for key, value in result.metrics.items()}
        limits = {str(key): float(value) for key, value in result.limits.items()}
    except (TypeError, ValueError, AttributeError) as error:
        raise MeasurementError(
            f"metrics and limits of {name} are numbers by name: {error}"
        ) from error
    return Result(result.verdict, metrics, limits, result.reason)
