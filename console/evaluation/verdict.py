"""The verdict: figures compared with limits, some of which are necessary for a verdict.

A figure beyond its limit fails the flight. A flight that keeps to all existing limits, but lacks
one for a deciding figure, is not judged, and the reason names the figure without a limit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from console.evaluation.explanation.finding import AT_BOUND, flagged
from console.experiments.client import FAILED, NOT_JUDGED, PASSED, Experiment, Result
from flight_log.run import read_run

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


def evaluated(experiment: Experiment, log: Path) -> Result:
    """Return the result of any experiment for a log, with the time that a bias, an integral or an
    estimate was at its bound, if any was. Raises what its `evaluate` raises.
    """
    result = settled(experiment.evaluate(log))
    held = flagged(read_run(log).topics, AT_BOUND)
    if not held:
        return result
    seconds = float(sum(end - start for start, end in held))
    return replace(result, metrics={**result.metrics, "at_bound_s": seconds})
