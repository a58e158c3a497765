"""The judgement of the error-state filter from its covariance and its innovations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from estimation.convergence import Convergence, Deviations
from estimation.error_state.update import FIT_CONSISTENCY, FIT_UPDATES, LOST_REFUSALS

FIT = Deviations(position=0.15, velocity=0.2, attitude=math.radians(3.0))
"""Largest deviations with which the estimate may be flown on."""
REFUSED_MAX = 0.5
"""Largest share of refused measurements, lately, of a consistent filter."""


def deviations_of(m: Any) -> Deviations:
    """Return the standard deviations from the covariance of an ERROR_STATE_MEMORY item."""
    variances = np.diag(m["covariance"])
    position, attitude, velocity = np.sqrt(variances[:9].reshape(3, 3).sum(axis=1)).tolist()
    return Deviations(position, velocity, attitude)


def convergence_of(m: Any) -> Convergence:
    """Return whether an initialized filter with fresh measurements, an ERROR_STATE_MEMORY item, may
    be flown on.
    """
    applied = int(m["applied"])
    if applied < FIT_UPDATES:
        return Convergence(False, f"{applied} measurements applied, needs {FIT_UPDATES}")
    if contradicted := _refusals(m) or _innovations(m):
        return Convergence(False, contradicted)
    d = deviations_of(m)
    text = (
        f"deviations {d.position:.3f} m, {d.velocity:.3f} m/s, {math.degrees(d.attitude):.2f} deg"
    )
    fit = d.position < FIT.position and d.velocity < FIT.velocity and d.attitude < FIT.attitude
    if not fit:
        text += (
            f"; allowed {FIT.position:g} m, {FIT.velocity:g} m/s, "
            f"{math.degrees(FIT.attitude):g} deg"
        )
    return Convergence(fit, text)


def inconsistency_of(m: Any) -> str:
    """Return why its measurements contradict an ERROR_STATE_MEMORY item, with numbers; empty while
    they do not, or while there are too few since a restart.
    """
    if m["restarted"]:
        return ""
    if not np.isfinite(m["now"]).all():
        return "its estimate is not a number"
    if m["applied"] + m["refused"] < FIT_UPDATES:
        return ""
    return _refusals(m) or _refused_share(m) or _innovations(m)


def _refusals(m: Any) -> str:
    refused = int(m["refused"])
    if refused < LOST_REFUSALS:
        return ""
    return f"the last {refused} measurements did not agree with it"


def _refused_share(m: Any) -> str:
    share = float(m["refused_share"])
    if share <= REFUSED_MAX:
        return ""
    return f"{share:.0%} of its measurements refused, allowed {REFUSED_MAX:.0%}"


def _innovations(m: Any) -> str:
    consistency = float(m["consistency"])
    if consistency < FIT_CONSISTENCY:
        return ""
    return f"innovations {consistency:.1f} times their expected square, allowed {FIT_CONSISTENCY:g}"
