"""Reasons why a Crazyflie that answers must not be armed."""

from __future__ import annotations

from extensions.crazyflie.board.messages import Info

LOST = 0.5
"""Distance, in m, of its own estimate from ours, beyond which it is not armed."""


def why_not_armed(info: Info, distance: float) -> str:
    """Return the reason by its supervisor's state and its estimate's distance from ours (m)."""
    if Info.LOCKED in info:
        return "the Crazyflie is locked after an emergency stop: switch it off and on"
    if info & (Info.TUMBLED | Info.CRASHED):
        return "the Crazyflie is turned over or has crashed: set it down level, then restart it"
    if not info & (Info.CAN_ARM | Info.ARMED):
        return "the Crazyflie's own checks do not pass: see its console in cfclient"
    if distance > LOST:
        return (
            f"its own estimate is {distance:.1f} m from ours: wait, or check "
            "board.pose_rate and that stabilizer.estimator is 2"
        )
    return ""
