"""Vehicles of this page: the state of each one, and what a page shows of it.

Fast topics are subscribed to only where they are shown: for vehicles whose page someone has open;
those of signals also while such a page may come back; and all positions while someone has the
fleet's page open.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from quadrotor.errors import LinkError, QuadlabError
from quadrotor.plain_rotations import roll_pitch_yaw
from web.latest import CHARTED, FAST, Live
from web.view.shapes import point_of, wxyz_of

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

LOOK = 0.2  # s between checks of which pages are open
LINGER = 5.0  # s for which topics are kept after the last page closes: it may be reloading
POSITION = frozenset({"state"})
SEEN = FAST.difference(CHARTED)
"""Topics subscribed to while a vehicle's page is open; the other fast ones only for signals."""

Message = dict[str, Any]


class Fleet:
    """Fleet of one event loop.

    Args:
        vehicles: the vehicles; the page of the first one is at /.
    """

    def __init__(self, vehicles: Sequence[VehicleContext]) -> None:
        self._vehicles = tuple(vehicles)
        self._plots = 0
        self._seen = dict.fromkeys((one.vehicle for one in vehicles), -math.inf)
        self._taken: dict[str, frozenset[str]] = {}
        self._changing = ThreadPoolExecutor(1, thread_name_prefix="web-watch")

    @property
    def names(self) -> list[str]:
        return [one.vehicle for one in self._vehicles]

    @property
    def lives(self) -> dict[str, Live]:
        """Return the newest messages of each vehicle, by name."""
        return {one.vehicle: one.live for one in self._vehicles}

    @contextlib.contextmanager
    def plotted(self) -> Iterator[None]:
        """Count a viewer while someone watches the positions."""
        self._plots += 1
        try:
            yield
        finally:
            self._plots -= 1

    def summary(self) -> list[Message]:
        """Return the state of each vehicle."""
        return [_summary(one) for one in self._vehicles]

    def positions(self) -> list[list[float] | None]:
        """Return x, y, z (m, W) and yaw (rad) of each vehicle, None where it is not known now."""
        return [_position(one.live) for one in self._vehicles]

    async def land_all(self, requester: str, request_id: str | None = None) -> list[Message]:
        """Send an emergency landing to all vehicles not known to be on the ground with motors off.

        Return once each has accepted or refused it; `summary` reports what they show then.
        """
        landings = (self._land(one, requester, request_id) for one in self._vehicles)
        return list(await asyncio.gather(*landings))

    async def run(self) -> None:
        """Subscribe to the shown topics of each vehicle, and to no others."""
        loop = asyncio.get_running_loop()
        while True:
            for one in self._vehicles:
                now = loop.time()
                if one.is_looked_at:
                    self._seen[one.vehicle] = now
                wanted = one.wanted | one.feed.topics & FAST
                if self._plots:
                    wanted |= POSITION
                if now - self._seen[one.vehicle] <= LINGER:
                    wanted |= SEEN
                if wanted == self._taken.get(one.vehicle, frozenset()):
                    continue
                with contextlib.suppress(LinkError):  # the session is closing; tried again
                    await loop.run_in_executor(self._changing, one.station.watch, wanted)
                    self._taken[one.vehicle] = wanted
            await asyncio.sleep(LOOK)

    def stop(self) -> None:
        self._changing.shutdown(wait=False, cancel_futures=True)

    async def _land(self, one: VehicleContext, requester: str, request_id: str | None) -> Message:
        status = one.live.current("status")
        if status is not None and not status.armed:
            return {"name": one.vehicle, "outcome": "motors off", "reason": ""}
        try:
            await one.emergency.press("land", requester, request_id)
        except QuadlabError as error:
            return {"name": one.vehicle, "outcome": "failed", "reason": str(error)}
        return {"name": one.vehicle, "outcome": "accepted", "reason": ""}


def _summary(one: VehicleContext) -> Message:
    live = one.live
    status, link = live.newest("status"), live.newest("link_status")
    battery, station = live.newest("battery"), live.newest("station_status")
    holder, position = live.current("control"), _position(live)
    return {
        "name": one.vehicle,
        "age": _age(live, "status"),
        "mode": status and status.mode,
        "behavior": status and status.behavior,
        "control_mode": status and status.control_mode,
        "armed": status and bool(status.armed),
        "airborne": status and bool(status.airborne),
        "flags": list(status.flags) if status else [],
        "link": link
        and {"state": link.state, "age": _rounded(link.age, 2), "loss": _rounded(link.loss, 3)},
        "link_age": _age(live, "link_status"),
        "battery": battery and _rounded(battery.voltage, 2),
        "height": position and round(position[2], 2),
        "recording": _rounded(station.recording_duration, 0)
        if station and station.recording
        else None,
        "alarms": list(station.alarms) if station and live.fresh("station_status") else [],
        "holder": str(holder.holder) if holder else None,
        "emergency": one.emergency.state,
    }


def _position(live: Live) -> list[float] | None:
    state = live.current("state")
    if state is None:
        return None
    _, _, yaw = roll_pitch_yaw(*wxyz_of(state.pose.pose.orientation))
    where = (*point_of(state.pose.pose.position), yaw)
    return [round(float(v), 3) for v in where] if all(map(math.isfinite, where)) else None


def _age(live: Live, topic: str) -> float | None:
    """Return the age of the newest message, in s; None if there has been none."""
    return _rounded(live.age(topic), 2)


def _rounded(value: float, digits: int) -> float | None:
    """Return a rounded number, None for infinity, which JSON does not have."""
    return round(float(value), digits) if math.isfinite(value) else None
