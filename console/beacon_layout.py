"""One layout of beacons for station and vehicle: bearings are meaningless with any other.

The station's `station.bearings.layout` is the authority. A change is made on the vehicle first and
refused when the vehicle refuses it; a vehicle that connects with another layout is sent this one. A
station that is restarted continues with the layout that was in force.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from quadrotor.errors import LinkError, ParameterError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.node import Node

STATION_LAYOUT = "station.bearings.layout"
VEHICLE_LAYOUT = "beacons.layout"
SERVICE = "change_parameters"
TIMEOUT = 1.0
AGAIN = 5.0
"""Seconds before a vehicle that has refused is asked again."""


def restored_layout(
    given: Mapping[str, ParameterValue], before: Mapping[str, ParameterValue]
) -> dict[str, ParameterValue]:
    """Return the values to start with: the layout known last (`before`), unless one is `given`."""
    return (
        {STATION_LAYOUT: before[STATION_LAYOUT]}
        if STATION_LAYOUT in before and STATION_LAYOUT not in given
        else {}
    )


SetLayout = Callable[[str, str], None]
"""Set the layout (text, requester) on the vehicle. Raises ParameterError or LinkError."""


def layout_setter(node: Node) -> SetLayout:
    """Return a function that sets a layout through the vehicle's command service, which logs the
    requester.
    """
    client = node.client(SERVICE, SERVICES[SERVICE])

    def set_layout(text: str, requester: str) -> None:
        parameters = to_parameters({VEHICLE_LAYOUT: text})
        try:
            client.ask(requester, timeout=TIMEOUT, parameters=parameters)
        except RefusedError as error:
            raise ParameterError(str(error)) from None

    return set_layout


class BeaconLayout:
    """Keeps the vehicle's layout equal to the station's; thread-safe.

    Args:
        ours: returns the station's layout as text.
        known: returns the vehicle's value of a parameter; None when it is not known.
        connected: returns whether the vehicle can be asked.
        set_layout: sets a layout on the vehicle, see `layout_setter`.
        clock: a steady clock, s.
    """

    def __init__(
        self,
        ours: Callable[[], str],
        known: Callable[[str], ParameterValue | None],
        connected: Callable[[], bool],
        set_layout: SetLayout,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._ours, self._known, self._connected = ours, known, connected
        self._set_layout, self._clock = set_layout, clock
        self._setting = threading.Lock()
        self._refused_at: float | None = None
        self._reason = ""

    def before_change(self, values: Mapping[str, ParameterValue], requester: str) -> None:
        """Set a new layout of the station on the vehicle first. Raises ParameterError."""
        text = str(values.get(STATION_LAYOUT, self._ours()))
        if text == self._ours() or not self._connected():
            return  # sent when the vehicle connects
        with self._setting:
            try:
                self._set_layout(text, requester)
            except ParameterError as error:
                raise ParameterError(
                    f"{STATION_LAYOUT} not changed, refused by the vehicle: {error}"
                ) from None
            except LinkError as error:
                raise ParameterError(f"{STATION_LAYOUT} not changed: {error}; try again") from None

    def agree(self) -> str:
        """Send the layout to a vehicle that has another one; return why it still differs, or "".
        Raises LinkError.
        """
        with self._setting:
            theirs, text = self._known(VEHICLE_LAYOUT), self._ours()
            if theirs is None or theirs == text:
                self._refused_at = None
                return ""
            if self._refused_at is not None and self._clock() < self._refused_at + AGAIN:
                return self._reason
            try:
                self._set_layout(text, "station")
            except ParameterError as error:
                self._refused_at = self._clock()
                self._reason = f"the vehicle has other beacons ({theirs}): {error}"
                return self._reason
            self._refused_at = None
            return ""
