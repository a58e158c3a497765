"""Identifies the vehicle whenever the link comes up, and reports why when none answers."""

from __future__ import annotations

import logging
import time

from console.link.monitor import LinkMonitor
from console.link.permission import OBSERVER
from quadrotor.errors import LinkError
from vehicle_link.addresses import parse_endpoint
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.node import Node
from vehicle_link.transport.quic_probe import EXPLANATIONS, ProbeResult, probe
from vehicle_link.transport.whoami import WhoAmI

log = logging.getLogger(__name__)

PERIOD = 0.25
REPEAT = 5.0
"""Seconds between requests to a vehicle that has answered: another may have its address by now."""
SILENT_FOR = 3.0
"""Seconds for which a link is up without an answer before the reason is reported."""
DOWN_FOR = 3.0
"""Seconds without a link before the reason is reported."""


class VehicleIdentification:
    """Identifies the vehicle; an answer may take a second."""

    def __init__(self, node: Node, vehicle: str, link: LinkMonitor) -> None:
        self._vehicle, self._link = vehicle, link
        self._whoami = WhoAmI(node)
        self._due = self._down_since = self._probe_due = 0.0
        self._probed: ProbeResult | None = None

    def update(self) -> None:
        """Identify the vehicle if that is due."""
        permission, now = self._link.permission, time.monotonic()
        if not self._link.is_up:
            permission.forget_identity()
            self._due = 0.0
            self._down_since = self._down_since or now
            if now >= max(self._down_since + DOWN_FOR, self._probe_due):
                self._probe_due = now + REPEAT
                permission.unreachable_reason = self._unreachable()
                permission.identity_problem = ""
            return
        self._down_since, self._probed = 0.0, None
        permission.unreachable_reason = ""
        if now < self._due:
            return
        try:
            permission.note_identity(self._whoami.ask())
            self._due = now + (REPEAT if permission.access != OBSERVER else SILENT_FOR)
        except LinkError:
            log.debug("the vehicle did not identify itself", exc_info=True)
            # With access, only one answer was lost, and nothing has changed.
            if not permission.access and (found := self._identity_problem()) is not None:
                permission.identity_problem = found

    def _unreachable(self) -> str:
        """Return why there is no link, as far as our files and a packet without certificates can
        show.
        """
        radio = self._link.radio
        if radio is None:
            return ""
        if reason := radio.problem():
            return f"no link to {radio.address}: {reason}"
        before, result = self._probed, probe(*parse_endpoint(radio.address))
        self._probed = result
        if result is ProbeResult.ANSWERS is not before:
            return ""  # it may have come up just now
        return f"no link to {radio.address}: {EXPLANATIONS[result]}"

    def _identity_problem(self) -> str | None:
        """Return what is known about a vehicle that does not answer; None while it may
        still do so.
        """
        radio = self._link.radio
        is_received = self._link.state() is not LinkState.LOST
        if radio is None or is_received or self._whoami.is_there:
            return ""  # it would understand, but is busy
        if radio.connected_for < SILENT_FOR:
            return None
        names = radio.names()
        if names and self._vehicle not in names:
            found = ", ".join(sorted(names))
            return (
                f"the vehicle at {radio.address} is called {found}, not {self._vehicle}: start it "
                f"with --name {self._vehicle}, or enrol it as {found}"
            )
        if not names:
            return (
                f"the vehicle at {radio.address} sends nothing to this station: its certificate "
                "may be of a vehicle (copy station.pem and station.key from the base), or its "
                "quadlab is another version"
            )
        return (
            f"the vehicle at {radio.address} does not understand this station: it runs another "
            "version of quadlab (install the same one on both), or is still starting"
        )
