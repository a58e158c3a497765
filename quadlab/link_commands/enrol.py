"""`quadlab link enrol NAME ADDRESS`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from quadlab.commands.option_types import Folder, optional
from quadlab.data_folder import open_data_folder
from quadlab.link_commands.certificate_bundle import REMOTE_FOLDER, how_to_copy, write_bundle
from quadlab.vehicle_names import check_name
from quadrotor.errors import UsageError


@dataclass
class Enrol:
    """Register a vehicle here, and issue the certificate with which it accepts our stations."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """of the vehicle, like quad2"""
    address: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ADDRESS")]
    """host name or address under which it is dialled, with :port unless it is 7447"""
    also: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="HOST")] = ()
    """a further name or address of it"""
    out: Annotated[Path | None, optional("DIR")] = None
    """folder, or file ending in .tar, for what the vehicle needs"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        check_name(self.name)
        from console.link.known_vehicles import KnownVehicles
        from vehicle_link.security.authority import ensure_certificates
        from vehicle_link.security.enrolment import issue_vehicle
        from vehicle_link.transport.session import parse_endpoint

        host, port = parse_endpoint(self.address)
        hosts = [host, *(parse_endpoint(other)[0] for other in self.also)]
        data = open_data_folder(self.data)
        base = data / "certificates"
        known = KnownVehicles(data)
        for other in known.all().values():
            if other.name != self.name and parse_endpoint(other.address) == (host, port):
                raise UsageError(
                    f"{self.address} is {other.name}'s address; forget that one first with "
                    f"`quadlab link forget {other.name}`, or give this one's"
                )
        ensure_certificates(base, hosts)
        out = self.out or data / "enrolled" / self.name
        made = write_bundle(out, partial(issue_vehicle, base, name=self.name, hosts=hosts))
        known.add(self.name, self.address)
        port_option = "" if port == 7447 else f" --link-port {port}"
        print(f"{self.name} at {self.address} is known here; its files are in {made}")
        print("1. copy ca.pem, vehicle.pem and vehicle.key to the vehicle, for instance:")
        for line in how_to_copy(made, host):
            print(f"     {line}")
        print(
            f"   ({REMOTE_FOLDER} is inside its data folder; if it has another, DATA/certificates)"
        )
        print(f"2. on the vehicle: quadlab vehicle --name {self.name}{port_option} …")
        print(f"3. here:           quadlab link test {self.name}")
        print(f"                   quadlab station --vehicle {self.name}")
        print(f"vehicle.key is a secret: delete {made} once it is copied")
        return 0
