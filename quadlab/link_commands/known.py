"""`quadlab link list` and `quadlab link forget NAME`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Flag, Folder

STATES = {
    "answers": "answers",
    "closed": "no quadlab vehicle on this port",
    "silent": "silent",
    "nameless": "its host name is unknown",
}


@dataclass
class List:
    """List the vehicles known here and whether they answer."""

    seek: Flag = False
    """also probe every address of this machine's networks"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        from console.link.known_vehicles import KnownVehicles
        from vehicle_link.addresses import VEHICLE_PORT, parse_endpoint
        from vehicle_link.transport.quic_probe import ProbeResult, own_networks, probe_all

        known = KnownVehicles(open_data_folder(self.data)).all()
        places = {name: parse_endpoint(one.address) for name, one in known.items()}
        for place, result in probe_all(list(places.values())).items():
            for name, one in known.items():
                if places[name] == place:
                    state = STATES[result]
                    print(f"{name:12} {one.address:24} {state:32} enrolled {one.enrolled}")
        if not known:
            print("no vehicle is known here; add one with `quadlab link enrol NAME ADDRESS`")
        if not self.seek:
            return 0
        networks = own_networks()
        hosts = [(str(host), VEHICLE_PORT) for network in networks for host in network.hosts()]
        found = [
            host
            for (host, port), result in probe_all(hosts).items()
            if result is ProbeResult.ANSWERS and (host, port) not in places.values()
        ]
        for host in found:
            print(f"{'?':12} {host:24} answers, not enrolled here")
        print(
            f"probed {len(hosts)} addresses of {', '.join(map(str, networks)) or 'no network'} "
            f"on UDP port {VEHICLE_PORT}: {len(found)} further vehicles"
        )
        return 0


@dataclass
class Forget:
    """Remove a vehicle from the known vehicles. Its certificate stays valid until it expires."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """name of the vehicle"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        from console.link.known_vehicles import KnownVehicles

        KnownVehicles(open_data_folder(self.data)).forget(self.name)
        print(f"{self.name} is forgotten; its certificate is still accepted until it ends")
        return 0
