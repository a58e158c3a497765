"""The permission of this station at its vehicle: whether it may command it, and if not, why.

It depends on the vehicle's heartbeats (which process, which station it follows), on its answer to
`whoami`, and on the radio. Emergencies always pass, unless the vehicle would not accept them.
"""

from __future__ import annotations

from vehicle_link.messages.records import WhoAmIResponse
from vehicle_link.process_instance import short_id
from vehicle_link.topics.control_inputs import Heartbeat
from vehicle_link.transport.protocol import disagreement

OBSERVER = "observer"
TWINS_NS = 1_000_000_000
"""Time in ns; two processes received in turns within it are two vehicles."""
HELD_NS = 1_500_000_000
"""Time in ns before another station that controls the vehicle is reported: for a second after a
station has ended the vehicle still names it, and it may have been this one before a restart."""


class CommandPermission:
    """The permission of one station. Written by several threads; every method is a few assignments
    on plain objects.

    Args:
        vehicle: its name at this station.
        instance: of this station's process.
    """

    def __init__(self, vehicle: str, instance: int) -> None:
        self._vehicle = vehicle
        self.instance = instance
        self._received_ns: dict[int, int] = {}
        self._twins_ns: int | None = None
        self._holder, self._held_ns = 0, 0  # and since when
        self._newest: int | None = None  # instance
        self.access = ""
        """Pilot or observer, once the vehicle has reported it."""
        self.identity_problem = ""
        """The reason why this vehicle may not be commanded; set by the identification."""
        self.unreachable_reason = ""
        """The reason why there has been no link for a while; set by the same thread."""

    def heartbeat(self, beat: Heartbeat, now_ns: int) -> None:
        """Handle a heartbeat of the vehicle, at this time of any steady clock."""
        recent = {k: at for k, at in self._received_ns.items() if now_ns - at < TWINS_NS}
        if beat.instance in recent and beat.instance != self._newest:
            self._twins_ns = now_ns  # received again after another process; no restart does that
        self._received_ns = {**recent, beat.instance: now_ns}
        if beat.holder != self._holder:
            self._held_ns = now_ns
        self._holder, self._newest = beat.holder, beat.instance

    def note_identity(self, whoami: WhoAmIResponse) -> None:
        """Handle the vehicle's answer to `whoami`."""
        self.access = str(whoami.access)
        self.identity_problem = disagreement(str(whoami.protocol), str(whoami.version))

    def forget_identity(self) -> None:
        """Forget the vehicle, because the link is down and another one may return.

        The identity problem stays until more is known, because a link without messages is
        reopened again and again.
        """
        self.access = ""

    @property
    def sends_heartbeats(self) -> bool:
        """Return whether to send our heartbeats to the vehicle: not while it follows another
        station.
        """
        return self._holder in (0, self.instance) and self.access != OBSERVER

    @property
    def sends_measurements(self) -> bool:
        """Return whether the vehicle accepts poses, bearings and sticks from us.

        It does not before it has reported so. A vehicle that does not report whom it follows (no
        instance) accepts them from anyone.
        """
        return self._holder == self.instance or self._newest == 0

    def problem(self, now_ns: int) -> str:
        """Return why nothing is commanded although the link is up; "" with nothing to report."""
        if self.identity_problem:
            return self.identity_problem
        if self._twins_ns is not None and now_ns - self._twins_ns < 2 * TWINS_NS:
            both = " and ".join(sorted(map(short_id, self._received_ns)))
            return (
                f"two vehicles are called {self._vehicle} ({both}): their data is mixed; land, "
                "then start one of them with another --name"
            )
        if self.access == OBSERVER:
            return f"this station's certificate lets it observe {self._vehicle}, not command it"
        return self._held() if now_ns - self._held_ns > HELD_NS else ""

    def _held(self) -> str:
        if self._holder in (0, self.instance):
            return ""
        return f"another station ({short_id(self._holder)}) flies {self._vehicle}"

    def refusal(self, command: str, now_ns: int) -> str:
        """Return why this command is not sent; "" when it is."""
        if command == "emergency" and self.access != OBSERVER:
            return ""
        reason = self.problem(now_ns) or self._held()
        return f"{reason}; nothing was sent" if reason else ""
