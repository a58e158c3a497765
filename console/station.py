"""`quadlab station`: the process that runs the base stations of its vehicles.

One hub on loopback carries all of them; each vehicle has its own radio and its own `BaseStation` in
its own namespace. They share the catalogue and nothing else.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from console.base_station import CLOSE_PATIENCE, BaseStation
from console.catalogue.catalogue import Catalogue
from console.link.known_vehicles import write_station_vehicles
from console.station_parts import StationOptions
from quadrotor.parameter_description import ParameterValue
from vehicle_link.addresses import parse_endpoint
from vehicle_link.defects import end_at_defect
from vehicle_link.process_instance import new_instance
from vehicle_link.security.authority import TlsFiles, ensure_certificates, readable_keys
from vehicle_link.termination_signal import EndSignal
from vehicle_link.transport.radio import Radio, is_hanging_up
from vehicle_link.transport.session import check_station, hub_session

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session

SWITCH_INTERVAL = 0.0005
DEAF = 4
"""Exit status of a station that hears nothing over Zenoh any more; its parent starts it again."""


def run_station(
    data: Path,
    vehicles: Mapping[str, str],
    loopback_port: int = 7447,
    settings: Mapping[str, ParameterValue] | None = None,
    *,
    follows_process: bool = False,
) -> int:
    """Run until SIGINT or SIGTERM, then close the runs' files and return 0.

    Args:
        data: data folder: `runs/`, the catalogue, `certificates/`.
        vehicles: name → `host:port` of its radio link, the main one first; none need be reachable
            yet.
        loopback_port: TCP port for web, simulator and ROS 2 nodes on this machine.
        settings: `station.*` parameters of every vehicle to start with.
        follows_process: poses come from a tracker process.

    Raises LinkError (port in use, certificate), StorageError, ParameterError or UsageError.
    """
    end_at_defect()
    # Recovering an old log computes for seconds next to the link's threads, which need the
    # interpreter for some 10 µs at a time and must not wait 5 ms for each turn. Every waiting
    # thread wakes at this interval; with the threads of eight vehicles that alone would use a whole
    # processor.
    sys.setswitchinterval(SWITCH_INTERVAL * len(vehicles))
    stopping = EndSignal()
    hosts = list(dict.fromkeys(parse_endpoint(endpoint)[0] for endpoint in vehicles.values()))
    catalogue = Catalogue(data)
    files = ensure_certificates(data / "certificates", hosts)
    for endpoint in vehicles.values():
        check_station(endpoint, files)  # refuse unusable endpoints before anything runs
    for line in readable_keys(files):
        sys.stderr.write(f"station: {line}\n")
    hub, instance = hub_session(loopback_port), new_instance()
    write_station_vehicles(data, list(vehicles))
    stations: list[BaseStation] = []
    radios: list[Radio] = []
    for name, endpoint in vehicles.items():
        options = StationOptions(
            name,
            settings=settings or {},
            housekeeping=not stations,
            vehicles=len(vehicles),
            host=parse_endpoint(endpoint)[0],
            instance=instance,
            endpoints=(
                f"connects to the vehicle at {endpoint}, serves page and ROS 2 at "
                f"127.0.0.1:{loopback_port}"
            ),
            follows_process=follows_process,
        )
        stations.append(BaseStation(hub, catalogue, options))
        radios.append(_radio(stations[-1], endpoint, files, loopback_port))
    print(
        f"station: connects to {_described(vehicles)}, serves 127.0.0.1:{loopback_port}", flush=True
    )
    while not stopping.wait(1.0):
        if any(station.link.is_deaf for station in stations):
            sys.stderr.write("station: hears a vehicle by its lane alone, and no command; ends\n")
            os._exit(DEAF)
    _close(stations, radios, catalogue, hub)
    return 0


def _radio(station: BaseStation, endpoint: str, files: TlsFiles, loopback_port: int) -> Radio:
    """Return the radio link of a vehicle, which its base station follows."""
    radio = Radio(
        endpoint,
        files,
        loopback_port,
        station.link.session_silence,
        report=station.warn,
        lane_silence=station.link.lane_silence,
        probe=station.answers,
    )
    station.link.follow(radio)
    return radio


def _close(
    stations: Sequence[BaseStation], radios: Sequence[Radio], catalogue: Catalogue, hub: Session
) -> None:
    """Close the runs' files and the links; end the process if a session cannot be closed."""
    _at_once([radio.close for radio in radios])
    _at_once([station.close for station in stations])  # several files may wait for the disk
    catalogue.close()
    # Closing a session whose peer has disappeared can take 10 s, and nothing depends on it any
    # more.
    closer = threading.Thread(target=hub.close, name="session close", daemon=True)
    closer.start()
    closer.join(CLOSE_PATIENCE)
    _at_once([partial(radio.close, CLOSE_PATIENCE) for radio in radios])
    if closer.is_alive() or is_hanging_up():
        os._exit(0)


def _at_once(acts: Sequence[Callable[[], None]]) -> None:
    threads = [threading.Thread(target=act) for act in acts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _described(vehicles: Mapping[str, str]) -> str:
    if len(vehicles) == 1:
        return next(iter(vehicles.values()))
    return ", ".join(f"{name} at {endpoint}" for name, endpoint in vehicles.items())
