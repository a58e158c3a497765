"""Station side of a link as in production: a hub on loopback, and a radio that connects."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from typing import Any

from console.base_station import BaseStation
from console.catalogue.catalogue import Catalogue
from console.station_parts import StationOptions
from tests.waiting import free_port
from vehicle_link.messages import new
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session

PATIENCE = 10.0  # s: a bound, not an expectation


class StationLink:
    """One hub and one radio, which never regards the vehicle as silent.

    Attributes:
        session: session of the hub, which the station's nodes use.
    """

    def __init__(self, vehicle_port: int, tls: TlsFiles, loopback_port: int | None = None) -> None:
        self.loopback_port = loopback_port or free_port()
        self.session: Any = hub_session(self.loopback_port)
        address = f"127.0.0.1:{vehicle_port}"
        self.radio = Radio(address, tls, self.loopback_port, session_silence=lambda: 0.0)

    def wait(self, timeout: float = PATIENCE) -> bool:
        """Wait for the link, and return whether it is connected."""
        return self.radio.wait(timeout)

    def close(self) -> None:
        """Disconnect, then close the hub."""
        self.radio.close(PATIENCE)
        self.session.close()


class LinkedStation:
    """Base station, its link, and the sessions of a vehicle and of a page.

    Attributes:
        at_vehicle, page: nodes of a scripted vehicle and of a client of the station.
    """

    def __init__(self, data: Path, settings: dict[str, Any], **arguments: Any) -> None:
        port, files = free_port(socket.SOCK_DGRAM), ensure_certificates(data / "certificates")
        self._vehicle_session = vehicle_session(port, files, "127.0.0.1")
        self.at_vehicle = Node(self._vehicle_session, "/quad1", "vehicle")
        self._link = StationLink(port, files)
        self.loopback = self._link.loopback_port
        self.catalogue = Catalogue(data)
        self.station = BaseStation(
            self._link.session, self.catalogue, StationOptions(settings=settings, **arguments)
        )
        self.station.link.follow(self._link.radio)
        self._page_session = loopback_session(self.loopback)
        self.page = Node(self._page_session, "/quad1", "page")
        self._clients: dict[str, Any] = {}

    def call(self, service: str, /, **fields: Any) -> Any:
        """Call a service of the station as ada."""
        if service not in self._clients:
            self._clients[service] = self.page.client(f"station/{service}", SERVICES[service])
        fields = {"request_id": f"{service}{time.monotonic_ns()}", "requester": "ada", **fields}
        request = new(f"{SERVICES[service]}_Request", **fields)
        return self._clients[service].call(request, timeout=PATIENCE)

    def close(self) -> None:
        self.page.close()
        self.station.close()
        self.at_vehicle.close()
        self._page_session.close()
        self._link.close()
        self._vehicle_session.close()
