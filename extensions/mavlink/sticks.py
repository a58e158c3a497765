"""Sticks of a ground station (MANUAL_CONTROL), for the behavior `velocity`.

They count while button 1 of the joystick is held, from a press with all sticks near their middle,
as on the page. The station's lease decides whose sticks are flown, and its watchdog drops those
that fall silent.
"""

from __future__ import annotations

from extensions.mavlink.dialect import MAVLink_message
from extensions.mavlink.offboard import Sender
from extensions.mavlink.peer import Peer
from quadrotor.errors import RefusedError
from vehicle_link.clock import monotonic_ns
from vehicle_link.messages import encode, header, new

FULL, MIDDLE_UP = 1000.0, 500.0
"""Numbers of a stick that is fully deflected; that of the thrust goes from 0 to 1000."""
MISSING = 32767
"""Stands for an axis that the joystick does not have."""
DEAD_MAN, CENTRED = 1, 0.15
"""Bit of the button, and the deflection below which a stick counts as centred."""


class Sticks:
    """Passes on the sticks of all ground stations under their names."""

    def __init__(self, publisher: Sender) -> None:
        self._publisher = publisher
        self._held: dict[str, bool] = {}

    def take(self, peer: Peer, message: MAVLink_message) -> None:
        """Publish a MANUAL_CONTROL. Raises RefusedError when the button is pressed with a stick
        that is not centred.
        """
        x, y, z, r = (
            middle if number == MISSING else float(number)
            for number, middle in zip(
                (message.x, message.y, message.z, message.r), (0, 0, MIDDLE_UP, 0), strict=True
            )
        )
        given = (x / FULL, -y / FULL, (z - MIDDLE_UP) / MIDDLE_UP, -r / FULL)
        axes = [max(-1.0, min(1.0, axis)) for axis in given]
        is_pressed, was_held = bool(message.buttons & DEAD_MAN), self._held.get(peer.name)
        is_held = is_pressed and (was_held or max(map(abs, axes)) < CENTRED)
        if is_held or was_held:
            joy = new(
                "sensor_msgs/Joy",
                header=header(monotonic_ns(), peer.name),
                axes=axes if is_held else [0.0] * 4,
                buttons=[int(is_held)],
            )
            self._publisher.put(encode(joy))
        self._held[peer.name] = is_held
        if is_pressed and not is_held:
            raise RefusedError("sticks count from a press of button 1 with all of them centred")

    def left(self, peer: Peer) -> None:
        """Forget a ground station."""
        self._held.pop(peer.name, None)
