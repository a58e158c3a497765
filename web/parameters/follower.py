"""Updates of the pages' replica: all parameters are read when a snapshot is due.

The parameters that the 3D view shows, flight volume, boxes and beacons, follow the replica.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from typing import Any

from bearing_sim.beacons import parse_layout
from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.observability import FieldOfView
from quadrotor.errors import QuadlabError
from quadrotor.json_object import JsonObject
from vehicle_link.messages.records import VehicleStatus
from vehicle_link.parameters.change import SIMULATOR, STATION, VEHICLE, authority_of
from web.latest import Live
from web.live.station import Station
from web.parameters.replica import PageParameters
from web.view.beacons.scene import BeaconScene
from web.view.scene import Scene

PERIOD = 0.5  # s between checks of the status
ROUND = 2.0  # s between checks for the simulator, which starts and ends independently
GLANCE = 0.05  # s between checks of what the 3D view shows
BEARINGS = "station.bearings."


class ParameterFollower:
    """Follower of one vehicle's parameters.

    Args:
        namespace: with its slash (`/quad1`).
    """

    def __init__(
        self, replica: PageParameters, station: Station, live: Live, scene: Scene, namespace: str
    ) -> None:
        self._replica = replica
        self._station = station
        self._live = live
        self._scene = scene
        self._namespace = namespace
        self._shown: JsonObject = {}
        self._surprises = 0  # checks in a row in which the simulator's presence was unexpected

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time() + PERIOD
        round_due = due
        while True:
            await asyncio.sleep(GLANCE)
            self.show_beacons()
            if loop.time() < due:
                continue
            due = loop.time() + PERIOD
            status = self._live.current("status")
            if status is None:
                self._replica.mark_incomplete()  # another vehicle may appear
            elif self._is_due(status):
                await self._read(status)
            elif loop.time() >= round_due:
                round_due = loop.time() + ROUND
                if await self.is_simulator_news():
                    await self._read(status)
            self._scene.show_parameters(self._replica.value)
            self._scene.mass = float(self._replica.value("model.mass") or 0.0)

    def show_beacons(self) -> None:
        """Show the beacons once the station's parameters are known, and whenever one changes."""
        values = bearing_values(self._replica.value)
        if "layout" not in values or values == self._shown:
            return
        self._shown = values
        show_bearings(self._scene.beacons, values)

    def _is_due(self, status: VehicleStatus) -> bool:
        self._replica.note_status(int(status.instance), int(status.parameter_revision))
        return self._replica.is_due

    async def is_simulator_news(self) -> bool:
        """Return whether the simulator was started or ended.

        Two checks must find it missing, because one missed answer may only be late.
        """
        described = self._replica.descriptions()
        is_known = any(authority_of(d.name) == SIMULATOR for d in described)
        is_there = await self._station.has_parameters(f"{self._namespace}/{SIMULATOR}")
        self._surprises = self._surprises + 1 if is_there != is_known else 0
        return self._surprises > (1 if is_known else 0)

    async def _read(self, status: VehicleStatus) -> None:
        """Read the parameters of vehicle, station and, if there is one, simulator.

        If the vehicle does not answer, the next period tries again.
        """
        instance, revision = int(status.instance), int(status.parameter_revision)
        since = self._replica.clock
        descriptions: list[Any] = []
        values: dict[str, Any] = {}
        for node in (VEHICLE, STATION, SIMULATOR):
            try:
                described, read = await self._station.read_parameters(f"{self._namespace}/{node}")
            except QuadlabError:
                if node == VEHICLE:
                    return
                continue
            descriptions += described
            values |= read
        self._replica.load(values, revision, instance, since, descriptions)


def bearing_values(value: Callable[[str], Any]) -> dict[str, Any]:
    """Return the known parameters of the simulated bearings, by their names in their group."""
    named = ((name, value(f"{BEARINGS}{name}")) for name in BearingParameters.model_fields)
    return {name: one for name, one in named if one is not None}


def show_bearings(scene: BeaconScene, values: JsonObject) -> None:
    """Show the beacons of these parameters; those of another version change nothing."""
    with contextlib.suppress(QuadlabError, ValueError):
        sensor = BearingParameters.model_validate(values)
        scene.set_beacons(
            parse_layout(sensor.layout),
            math.radians(sensor.sigma),
            FieldOfView.of(sensor),
            sensor.rate,
        )
