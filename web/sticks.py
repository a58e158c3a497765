"""`/ws/stick`: the sticks of one page, to the station as `stick` (sensor_msgs/Joy).

A page sends 20 B at 50 Hz: four float32 axes (forward, left, up, yaw; -1 to 1) and float32 1.0
while its dead-man button is held. The sticks have one hand at a time: the page that enabled them
first keeps them until it lets go, falls silent for 250 ms or leaves. After a silence the button
must be released before it counts again, so that a page that stood still does not wake up flying.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable

from fastapi import WebSocket

from web.access.roles import Role, Session

_FRAME = struct.Struct("<5f")
SILENCE = 0.25  # s

Axes = tuple[float, float, float, float]


class Hand:
    """One page's sticks: what it sent last, and whether its dead-man counts. Pure."""

    def __init__(self) -> None:
        self._latched = False  # must see the button released first
        self._last = -math.inf

    def take(self, frame: bytes, now: float) -> tuple[Axes, bool]:
        """Axes and whether they are enabled. Raises ValueError for what is no frame."""
        if len(frame) != _FRAME.size:
            raise ValueError(f"{len(frame)} bytes; a stick frame has {_FRAME.size}")
        *axes, button = _FRAME.unpack(frame)
        if not all(math.isfinite(a) for a in (*axes, button)):
            raise ValueError("a stick frame must be finite")
        if now - self._last > SILENCE:
            self._latched = True
        self._last = now
        held = button > 0.5
        if not held:
            self._latched = False
        forward, left, up, yaw = (max(-1.0, min(1.0, a)) for a in axes)
        return (forward, left, up, yaw), held and not self._latched


class StickOutput:
    """Lets one hand through. Args: `publish(axes, enabled)`."""

    def __init__(
        self, publish: Callable[[Axes, bool], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._publish = publish
        self._clock = clock
        self._owner: object | None = None
        self._until = -math.inf

    def send(self, hand: object, axes: Axes, enabled: bool) -> bool:
        """Whether this hand has the sticks now."""
        now = self._clock()
        if self._owner is not hand and self._owner is not None and now <= self._until:
            return False
        if not enabled:
            self.release(hand)
            return True
        self._owner, self._until = hand, now + SILENCE
        self._publish(axes, True)
        return True

    def release(self, hand: object) -> None:
        """Zero and disabled, once, if this hand had the sticks."""
        if self._owner is hand:
            self._owner = None
            self._publish((0.0, 0.0, 0.0, 0.0), False)


async def serve(socket: WebSocket, output: StickOutput, session: Session) -> None:
    """One page's sticks until it leaves; answers `{"held": …}` with whose they are."""
    if not session.role.may(Role.OPERATOR):
        await socket.close(1008, "viewers have no sticks")
        return
    await socket.accept()
    hand, told = Hand(), None
    try:
        while (event := await socket.receive())["type"] != "websocket.disconnect":
            try:
                axes, enabled = hand.take(event.get("bytes") or b"", time.monotonic())
            except ValueError as error:
                await socket.close(1008, str(error))
                return
            mine = output.send(hand, axes, enabled)
            if (mine, enabled) != told:
                told = (mine, enabled)
                await socket.send_json({"mine": mine, "enabled": mine and enabled})
    finally:
        output.release(hand)
