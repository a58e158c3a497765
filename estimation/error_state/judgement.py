"""The judgement of the error-state filter from its covariance and its innovations."""

from __future__ import annotations

import math

import numpy as np

from estimation.convergence import Convergence, Deviations, ratio
from estimation.error_state.gate import RUN_LEAST
from estimation.error_state.update import FIT_CONSISTENCY, FIT_UPDATES, LOST_REFUSALS, REFUSED_MAX
from quadrotor.records import Array

FIT = Deviations(position=0.15, velocity=0.2, attitude=math.radians(3.0))
"""Largest deviations with which the estimate may be flown on."""
NOT_YET_CONSISTENT = 2.0 * FIT_CONSISTENCY
"""Mean consistency with which a filter restarts: measurements have to reduce it."""
JUMP_WAIT_NS, DRIFT_WAIT_NS = 500_000_000, 200_000_000
"""Times in ns for which LOST_REFUSALS measurements in a row must be refused until the filter counts
as wrong: when they suddenly jumped away from it, and when none had been used for a while before;
the first also for most of them if single ones are still used. A start that fewer than FIT_UPDATES
have confirmed is wrong as soon as RUN_LEAST contradict it together."""
SHORTEST_RUN = 0.1
"""Shortest time, in s, over which the motion of such poses is computed."""


def is_lost(m: np.void, *, confirmed: bool, agree: bool) -> bool:
    """Return whether the refused measurements show that an ERROR_STATE_MEMORY item is wrong.

    Args:
        confirmed: whether enough measurements have confirmed its start.
        agree: whether those refused agree with each other.
    """
    waited = m["stamp_ns"] - m["refused_ns"] > (JUMP_WAIT_NS if m["at_once"] else DRIFT_WAIT_NS)
    all_refused = bool(m["refused"] >= LOST_REFUSALS and waited)
    return (agree and (not confirmed or is_contradicted(m))) or all_refused


def is_contradicted(m: np.void) -> bool:
    """Return whether most measurements of the last half second were refused."""
    since_ns = int(m["contradicted_ns"])
    return bool(since_ns and m["stamp_ns"] - since_ns > JUMP_WAIT_NS)


def missed_velocity(m: np.void) -> Array:
    """Return the velocity (3,) at which the run of refused poses left their prediction, m/s."""
    lasted = max(1e-9 * float(m["run_ns"] - m["run_start_ns"]), SHORTEST_RUN)
    missed_w: Array = (m["run_last"] - m["run_first"])[:3] / lasted
    return missed_w


def contradiction_of(m: np.void, *, confirmed: bool) -> str:
    """Return which measurements show that an ERROR_STATE_MEMORY item is lost."""
    if not confirmed:
        return f"the first {RUN_LEAST} measurements"
    if m["refused"] >= LOST_REFUSALS:
        lasted = 1e-9 * float(m["stamp_ns"] - m["refused_ns"])
        return f"{int(m['refused'])} measurements in {lasted:.1f} s"
    lasted = 1e-9 * float(m["stamp_ns"] - m["contradicted_ns"])
    return f"{float(m['refused_share']):.0%} of the measurements of {lasted:.1f} s"


def restart_line(m: np.void, before: Array, contradiction: str) -> str:
    """Return a line about the restart of a lost filter, whose state was `before` (16,)."""
    apart = float(np.linalg.norm(m["now"][:3] - before[:3]))
    return (
        f"error_state restarted, {apart:.2f} m from where it was: "
        f"{contradiction} did not agree with it"
    )


def deviations_of(m: np.void) -> Deviations:
    """Return the standard deviations from the covariance of an ERROR_STATE_MEMORY item."""
    variances = np.diag(m["covariance"])
    position, attitude, velocity = np.sqrt(variances[:9].reshape(3, 3).sum(axis=1)).tolist()
    return Deviations(position, velocity, attitude)


def convergence_of(m: np.void) -> Convergence:
    """Return whether an initialized filter with fresh measurements, an ERROR_STATE_MEMORY item, may
    be flown on.
    """
    applied, d = int(m["applied"]), deviations_of(m)
    share = min(
        ratio(FIT.position, d.position),
        ratio(FIT.velocity, d.velocity),
        ratio(FIT.attitude, d.attitude),
        ratio(FIT_CONSISTENCY, float(m["consistency"])),
        applied / FIT_UPDATES,
        1.0,
    )
    if applied < FIT_UPDATES:
        return Convergence(False, f"{applied} measurements applied, needs {FIT_UPDATES}", share)
    if contradicted := _refusals(m) or _refused_share(m) or _innovations(m):
        return Convergence(False, contradicted, share)
    text = f"deviations {d.position:.3f} m, {d.velocity:.3f} m/s, {math.degrees(d.attitude):.2f}°"
    fit = d.position < FIT.position and d.velocity < FIT.velocity and d.attitude < FIT.attitude
    if not fit:
        text += (
            f"; allowed {FIT.position:g} m, {FIT.velocity:g} m/s, {math.degrees(FIT.attitude):g}°"
        )
    return Convergence(fit, text, share)


def inconsistency_of(m: np.void) -> str:
    """Return why its measurements contradict an ERROR_STATE_MEMORY item, with numbers; empty while
    they do not, or while there are too few since a restart.
    """
    if m["restarted"]:
        return ""
    if not np.isfinite(m["now"]).all():
        return "its estimate is not finite"
    if m["applied"] + m["refused"] < FIT_UPDATES:
        return ""
    return _refusals(m) or _refused_share(m) or _innovations(m)


def _refusals(m: np.void) -> str:
    refused = int(m["refused"])
    if refused < LOST_REFUSALS:
        return ""
    return f"the last {refused} measurements did not agree with it"


def _refused_share(m: np.void) -> str:
    share = float(m["refused_share"])
    if share <= REFUSED_MAX:
        return ""
    return f"{share:.0%} of its measurements refused, allowed {REFUSED_MAX:.0%}"


def _innovations(m: np.void) -> str:
    consistency = float(m["consistency"])
    if consistency < FIT_CONSISTENCY:
        return ""
    return f"innovations {consistency:.1f} times their expected square, allowed {FIT_CONSISTENCY:g}"
