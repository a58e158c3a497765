"""The station's start-up checks: clock, rates, disk, certificates, versions, on both ends.

They run a little after the vehicle's first status, or a little after the start without one, and
again on request. Nothing is checked while the vehicle is armed; while it is silent, and so may be
flying, everything is checked except what loads the disk.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from console.checks import station_items
from console.checks.gather import Gatherer
from console.context import StationContext
from console.link.outbox import INFO, WARN
from flight_log.provenance import provenance
from quadrotor.errors import LinkError, RefusedError
from vehicle_link.checks import Check, from_messages, to_messages
from vehicle_link.machine_checks import ClockWatch, clock_check, disk_check, governor_check
from vehicle_link.messages import new
from vehicle_link.messages.records import ChecksRequest, Message
from vehicle_link.security.certificate_checks import certificate_check
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState

log = logging.getLogger(__name__)

PERIOD = 1.0
"""Seconds between two checks of the clock."""
SETTLE, WITHOUT_TRACKER, WITHOUT_VEHICLE, WITHOUT_STATUS = 4, 10, 10, 60
"""Number of PERIOD periods from the first status of the vehicle and pose of a tracker to the checks
(rates need two seconds to count); from the status, when no pose comes; from the start, when no
vehicle connects, or when one connects and sends no status: it compiles its laws, and its simulator
the dynamics, before either measures anything."""
TIMEOUT = 2.0
"""Seconds that the vehicle has for its own checks."""
ANSWER = f"{SERVICES['checks']}_Response"


class StartupChecks:
    """Runs the start-up checks and serves `/<vehicle>/station/checks`.

    Args:
        data: the station's data folder.
        endpoints: where the station listens and what it connects to, in words.
    """

    def __init__(
        self, context: StationContext, data: Path, gatherer: Gatherer, endpoints: str = ""
    ) -> None:
        self._data, self._gatherer, self._endpoints = data, gatherer, endpoints
        self._parameters, self._outbox = context.parameters, context.outbox
        self._watch = ClockWatch()
        self._checking = threading.Lock()
        self._vehicle_client = context.node.client("checks", SERVICES["checks"])
        self._station: list[Check] = []
        self._vehicle: list[Check] = []
        self._checked = 0.0
        self._periods = self._heard_for = self._tracked_for = 0
        self._patience = WITHOUT_VEHICLE
        self._due = self._has_warned = False
        context.node.serve("station/checks", SERVICES["checks"], self._answer)

    def tick(self) -> None:
        """Compare the clocks, and check everything when that is due; called every PERIOD."""
        self._watch.compare()
        self._check_when_due()

    @property
    def found(self) -> list[Check]:
        """Return the latest results, the station's checks first."""
        return [*self._station, *self._vehicle]

    @property
    def _is_vehicle_unknown(self) -> bool:
        return all(one.state == "unknown" for one in self._vehicle)

    def run_checks(self, report: Callable[[], None] = lambda: None) -> None:
        """Check everything now, then call `report`, before the answers say that checks were made.

        May take some seconds. Raises LinkError only for our own defect.
        """
        with self._checking:
            self._station = self._check_station()
            self._vehicle = self._check_vehicle()
            report()
            self._checked = time.time()

    def _answer(self, request: ChecksRequest) -> Message:
        if request.again and self._gatherer.facts().armed:
            raise RefusedError("the vehicle is armed; checks are made on the ground")
        if request.again:
            self.run_checks()
        return new(ANSWER, accepted=True, checked=self._checked, checks=to_messages(self.found))

    def _check_station(self) -> list[Check]:
        facts, status = self._gatherer.facts(), self._gatherer.link_status
        keep_free = facts.keep_free
        runs = self._data / "runs"
        return [
            clock_check("station"),
            self._watch.check("station"),
            station_items.vehicle_clock(facts, status),
            *station_items.rates(facts, self._parameters),
            disk_check("station", "runs' disk", runs, keep_free),
            station_items.disk_speed(self._gatherer.facts(), runs, self._data),
            governor_check("station"),
            certificate_check("station", self._data / "certificates", "station"),
            Check("ports", "ok" if self._endpoints else "unknown", self._endpoints or "not known"),
            Check("version", "ok", _short(provenance()["git_revision"])),
            Check("libraries", "ok", _libraries()),
        ]

    def _check_vehicle(self) -> list[Check]:
        try:
            answer = self._vehicle_client.ask("station", timeout=TIMEOUT, again=True)
        except LinkError as error:
            advice = "connect the vehicle, then check again"
            found = "not checked: the vehicle does not answer"
            log.debug("the vehicle's checks: %s", error)
            return [Check("vehicle", "unknown", found, "connected", advice, "vehicle")]
        except RefusedError as error:
            advice = "run the checks again when it is disarmed"
            return [Check("vehicle", "unknown", str(error), "disarmed", advice, "vehicle")]
        ours = provenance()["git_revision"]
        return [_compared(one, ours) for one in from_messages(answer.checks)]

    def _check_when_due(self) -> None:
        self._periods += 1
        facts = self._gatherer.facts()
        if facts.link is not LinkState.LOST:
            self._patience = WITHOUT_STATUS
        self._heard_for = 0 if facts.mode is None else self._heard_for + 1
        self._tracked_for = min(self._heard_for, self._tracked_for + 1) if facts.tracker_rate else 0
        is_new = self._tracked_for == SETTLE or self._heard_for == WITHOUT_TRACKER
        self._due |= (is_new and self._is_vehicle_unknown) or (
            self._periods == self._patience and not self._checked
        )
        if self._due and not facts.armed:
            self._due = False
            self.run_checks(self._report)

    def _report(self) -> None:
        """Publish one line when a check needs attention, or when none does any more."""
        bad = [f"{one.name} ({one.place})" for one in self.found if one.state in ("warn", "fail")]
        if bad:
            failing = any(one.state == "fail" for one in self.found)
            line = f"start-up checks need attention: {', '.join(bad)}; see the Settings page"
            self._outbox.say(WARN if failing else INFO, line)
        elif self._has_warned:
            self._outbox.say(INFO, "start-up checks: nothing needs attention any more")
        self._has_warned = bool(bad)


def _compared(check: Check, ours: str) -> Check:
    """Return the check of the vehicle's version, compared with ours; any other check unchanged."""
    if check.name != "version":
        return check
    return replace(
        check,
        state="ok" if check.found == ours else "warn",
        found=_short(check.found),
        wanted=_short(ours),
        advice="install the same version at both ends",
    )


def _short(revision: str) -> str:
    return revision[:10]


def _libraries() -> str:
    versions: dict[str, str] = json.loads(provenance()["versions"])
    return ", ".join(f"{name} {number}" for name, number in versions.items())
