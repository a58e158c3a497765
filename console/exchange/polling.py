"""Periodic requests to the vehicle: its clock, its parameters, its beacons, its calibrations."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from console.beacon_layout import BeaconLayout
from console.calibrations import Calibrations
from console.context import StationContext
from console.parameters.vehicle import VehicleParameters
from quadrotor.errors import LinkError
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.time_sync import TIME_SYNC, exchange

log = logging.getLogger(__name__)

PERIOD, EAGER_PERIOD = 1.0, 0.2
"""Seconds between requests to the vehicle; eager until its clock and its calibrations are known,
which the next run is to carry."""


class VehiclePolling:
    """Polls the vehicle in its own thread, because an answer may take a second."""

    def __init__(
        self,
        context: StationContext,
        parameters: VehicleParameters,
        layout: BeaconLayout,
        calibrations: Calibrations,
    ) -> None:
        self._link, self._recorder = context.link, context.recorder
        self._alarms, self._parameters = context.alarms, parameters
        self._layout, self._calibrations = layout, calibrations
        self._time_sync = context.node.client("time_sync", TIME_SYNC)

    def run(self, closing: threading.Event, guard: Callable[[Callable[[], None]], None]) -> None:
        """Run until `closing`; `guard` calls a function and survives its defects."""
        while not closing.wait(EAGER_PERIOD if self._is_eager else PERIOD):
            if self._link.state() is not LinkState.LOST:
                guard(self._poll)
            else:
                self._calibrations.lost()
                self._parameters.mark_incomplete()

    @property
    def _is_eager(self) -> bool:
        knows_all = bool(self._recorder.run_id) or not self._calibrations.is_due
        return not (self._link.clock_known and knows_all)

    def _poll(self) -> None:
        try:
            self._link.exchanged(exchange(self._time_sync))
            if not self._recorder.run_id:
                self._parameters.refresh()
                self._calibrations.look(shown[0] if (shown := self._parameters.shown) else 0)
                self._parameters.learn_defaults()  # last, as it takes longest
            self._alarms.set("beacons", self._layout.agree() or None)
        except LinkError:
            # The page shows the state of the link; retried in a second.
            log.debug("the vehicle did not answer", exc_info=True)
