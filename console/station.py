"""`quadlab station`: the process around the base station."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Mapping
from pathlib import Path

from console.base_station import CLOSE_PATIENCE, BaseStation
from console.catalogue import Catalogue
from quadrotor.parameters import ParameterValue
from vehicle_link.authority import ensure_certificates
from vehicle_link.session import parse_endpoint, station_session

SWITCH_INTERVAL = 0.0005


def run_station(
    data: Path,
    vehicle_endpoint: str,
    loopback_port: int = 7447,
    name: str = "quad1",
    operator: str = "",
    settings: Mapping[str, ParameterValue] | None = None,
    database_url: str | None = None,
) -> int:
    """Runs until SIGINT or SIGTERM, then closes the run's file and returns 0.

    Args:
        data: data folder: `runs/`, the catalogue, `certificates/`.
        vehicle_endpoint: `host:port` of the vehicle's radio link; it need not be there yet.
        loopback_port: TCP port for web, simulator and ROS 2 nodes on this machine.
        operator: written into runs nobody asked for by name.
        settings: `station.*` parameters to start with.

    Raises LinkError (port in use, certificate), StorageError, ParameterError or UsageError.
    """
    # Recovering an old log computes for seconds beside the link's threads, which need the
    # interpreter for some 10 µs at a time and must not wait 5 ms for each turn.
    sys.setswitchinterval(SWITCH_INTERVAL)
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    host, _ = parse_endpoint(vehicle_endpoint)
    catalogue = Catalogue(data, database_url)
    files = ensure_certificates(data / "certificates", [host])
    session = station_session(vehicle_endpoint, loopback_port, files)
    station = BaseStation(session, catalogue, name, operator, settings)
    station.checks.startup.endpoints = (
        f"dials the vehicle at {vehicle_endpoint}, serves page and ROS 2 at "
        f"127.0.0.1:{loopback_port}"
    )
    print(f"station: dials {vehicle_endpoint}, serves 127.0.0.1:{loopback_port}", flush=True)
    while not stopping.wait(1.0):
        pass
    station.close()
    # Closing a session whose peer is gone can take 10 s, and nothing depends on it any more.
    closer = threading.Thread(target=session.close, name="session close", daemon=True)
    closer.start()
    closer.join(CLOSE_PATIENCE)
    if closer.is_alive():
        os._exit(0)
    return 0
