"""The supervisor of a simulated Crazyflie: who may fly, and what happens without set-points.

The states, times and their consequences are the firmware's (Bitcraze's documentation, "The
supervisor"): 0.5 s after the last set-point it levels out with the same thrust, after 2 s it stops
its motors and stays locked.
"""

from __future__ import annotations

from extensions.crazyflie.board.messages import Info

LEVEL_OUT_MS, SHUT_DOWN_MS = 500, 2000
FLYING_FOR_MS = 2000
"""Time without thrust after which it no longer counts as flying."""
TUMBLED_COS, TUMBLED_MS = 0.5, 1000
"""Cosine of the tilt (60 degrees), and time in ms, beyond which the vehicle is turned over."""


class Supervisor:
    """The supervisor of one Crazyflie.

    Attributes:
        armed, locked: its states.
        levels_out: whether it replaces roll and pitch of the set-point by 0.
    """

    def __init__(self) -> None:
        self.armed = self.locked = self.levels_out = False
        self._tumbled = self._crashed = False
        self._upright_ms = 0
        self._thrust_ms = -FLYING_FOR_MS - 1
        self._now_ms = 0

    @property
    def is_flying(self) -> bool:
        return self.can_fly and self._now_ms - self._thrust_ms <= FLYING_FOR_MS

    @property
    def can_fly(self) -> bool:
        return self.armed and not (self.locked or self._crashed)

    @property
    def info(self) -> Info:
        """Return `supervisor.info`."""
        bits = {
            Info.CAN_ARM: not (self.armed or self.locked or self._tumbled or self._crashed),
            Info.ARMED: self.armed,
            Info.CAN_FLY: self.can_fly,
            Info.FLYING: self.is_flying,
            Info.TUMBLED: self._tumbled,
            Info.LOCKED: self.locked,
            Info.CRASHED: self._crashed,
        }
        info = Info(0)
        for bit, on in bits.items():
            info |= bit if on else Info(0)
        return info

    def arm(self, on: bool) -> bool:
        """Arm or disarm; return whether that was done."""
        if on and not self.armed and Info.CAN_ARM not in self.info:
            return False
        self.armed = on
        return True

    def step(self, now_ms: int, setpoint_ms: int, cos_tilt: float, has_thrust: bool) -> None:
        """Look at the state of this millisecond.

        Args:
            setpoint_ms: when the last set-point came.
        """
        self._now_ms = now_ms
        if has_thrust:
            self._thrust_ms = now_ms
        if cos_tilt > TUMBLED_COS:
            self._upright_ms = now_ms
        self._tumbled = now_ms - self._upright_ms > TUMBLED_MS
        age_ms = now_ms - setpoint_ms
        self.levels_out = self.is_flying and age_ms > LEVEL_OUT_MS
        if self.is_flying:
            self._crashed = self._tumbled
            self.locked |= age_ms > SHUT_DOWN_MS
