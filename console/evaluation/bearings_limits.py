"""Limits of the errors on bearings: multiples of the bound of the sensor that was used.

They scale with the Cramér-Rao bound of the same flight (`console.evaluation.bearings_bound`), and
so with sigma, rate and view of the sensor, the beacons' positions and the path flown.
"""

from __future__ import annotations

import math

from console.evaluation.bearings_bound import PoseBound

ESTIMATE = {"error_state": 2.5, "complementary": 3.5}
"""Largest rms error of the estimate relative to the bound, for position and for attitude."""
FLIGHT = {"error_state": 3.0, "complementary": 5.5}
"""Largest rms error of the flight relative to the bound of position: the control law follows the
estimate."""
TRACKING = 0.005
"""Additional m rms of the control law itself: what hover and the 8 may have on the tracker."""
TUNED = ("auto", "resolved")
"""Gains of the complementary filter for which the multiples hold."""
DECIDING = ("position_rms_m", "estimate_position_rms_m", "estimate_attitude_rms_deg")
"""Figures without whose limits a flight is not judged."""


def limits(
    bound: PoseBound, estimator: str, gains: str
) -> tuple[dict[str, float], tuple[str, ...], str]:
    """Return the limits by name of the figure, the deciding figures, and why a limit of theirs is
    missing.

    Args:
        gains: of the complementary filter on bearings; "auto" for another estimator.
    """
    out = {"fallbacks": 0.0, "emergencies": 0.0}
    why = ""
    if gains not in TUNED:
        why = f"no limit is known for the gains {gains}; they are for {' and '.join(TUNED)}"
    elif not math.isfinite(bound.position + bound.attitude):
        why = "the log lacks what the sensor's bound needs: bearings and beacon positions"
    else:
        factor = ESTIMATE[estimator]
        out |= {
            "position_rms_m": TRACKING + FLIGHT[estimator] * bound.position,
            "estimate_position_rms_m": factor * bound.position,
            "estimate_attitude_rms_deg": factor * math.degrees(bound.attitude),
            "saturated_share": 0.0,
        }
    return out, DECIDING, why
