"""The base station between one vehicle and everything on the base.

Zenoh's threads deliver messages, each topic in its own; one thread sends the heartbeat, one polls
the vehicle for slow data, and the recorder and the tracker have their own. Nothing here waits for
the disk or the radio except the thread whose job it is.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from console.catalogue.catalogue import Catalogue
from console.checks.preflight import PERIOD as PREFLIGHT
from console.checks.startup import PERIOD as CHECKS
from console.link.identification import PERIOD as IDENTIFICATION
from console.link.outbox import WARN
from console.rounds import run_rounds
from console.runs.housekeeping import PERIOD as HOUSEKEEPING
from console.station_parts import StationOptions, StationParts
from quadrotor.errors import LinkError
from vehicle_link.transport import time_sync

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
log = logging.getLogger(__name__)

CLOSE_PATIENCE = 3.0


class BaseStation:
    """Base station of one vehicle: all parts of this process, on one Zenoh session.

    Args:
        session: from vehicle_link.transport.session.hub_session.
        catalogue: of the runs.
    """

    def __init__(
        self, session: Session, catalogue: Catalogue, options: StationOptions | None = None
    ) -> None:
        self.parts = parts = StationParts(session, catalogue, options or StationOptions())
        problem = parts.restore_layout()
        self.link, self.runs, self.control = parts.link, parts.runs, parts.control
        self.experiments = parts.experiments
        clock = parts.node.client("time_sync", time_sync.TIME_SYNC)
        self.answers = partial(time_sync.answers, clock)
        if problem:
            self.warn(f"the previous beacon layout was not restored: {problem}")
        # What may wait for an answer of the vehicle, or for a disk that hangs, has its own thread.
        loops: dict[str, Callable[..., None]] = {
            "beat": parts.heartbeat.run,
            "polling": parts.polling.run,
            "tidying": parts.housekeeping.begin,
            "identification": partial(run_rounds, {parts.identification.update: IDENTIFICATION}),
            "preflight": partial(run_rounds, {parts.preflight.tick: PREFLIGHT}),
            "checks": partial(
                run_rounds,
                {parts.startup_checks.tick: CHECKS, parts.housekeeping.check: HOUSEKEEPING},
            ),
        }
        parts.serve()
        parts.subscriptions.begin()
        self._threads = [
            threading.Thread(target=run, args=(parts.closing, self._guard), name=name, daemon=True)
            for name, run in loops.items()
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Close the station, the run's file first: nothing else matters as much."""
        parts = self.parts
        parts.closing.set()
        parts.runs.close()
        parts.transfers.close()
        parts.experiments.close()
        parts.sticks.close()
        parts.tracker.close()
        parts.added.close()
        for thread in self._threads:
            thread.join(CLOSE_PATIENCE)
        parts.pictures.close()
        parts.subscriptions.close()
        parts.node.close()
        parts.history_writer.close()

    def warn(self, line: str) -> None:
        """Publish a warning event of this vehicle."""
        self.parts.outbox.say(WARN, line)

    def _guard(self, act: Callable[[], None]) -> None:
        """Call `act` and turn a defect in it into an alarm: it must not stop the heartbeat of a
        flight.
        """
        try:
            act()
        except Exception as error:
            if self.parts.closing.is_set() and isinstance(error, LinkError):
                return  # the session was closed first
            log.exception("station")
            self.parts.alarms.set("defect", f"station: defect, see its log: {error!r}")
