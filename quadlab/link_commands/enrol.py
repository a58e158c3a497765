"""`quadlab link enrol NAME ADDRESS`, `quadlab link observer NAME` and `quadlab link pilot NAME`:
certificates for vehicles and further stations.
"""

from __future__ import annotations

import re
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Folder, optional
from quadlab.vehicle_names import check_name
from quadrotor.errors import UsageError, os_errors
from vehicle_link.security.authority import TlsFiles

if TYPE_CHECKING:
    from vehicle_link.security.access import Access

REMOTE_FOLDER = ".local/share/quadlab/certificates"
"""Default folder of the certificates on another machine, below its home folder."""


def write_bundle(out: Path, issue: Callable[[Path], TlsFiles]) -> Path:
    """Issue files for another machine; return where they are: a folder, or a file ending in .tar.

    Raises StorageError or LinkError.
    """
    out = out.expanduser().absolute()
    if out.suffix != ".tar":
        return issue(out).folder
    with os_errors(lambda why: f"cannot write {out}: {why}"):
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            files = issue(Path(folder))
            out.touch(mode=0o600)
            out.chmod(0o600)  # if the file existed already
            with tarfile.open(out, "w") as tar:
                for path in sorted(files.folder.iterdir()):
                    tar.add(path, path.name)
    return out


def how_to_copy(made: Path, host: str) -> list[str]:
    """Return lines with commands that copy the files to the machine `host` by ssh."""
    begin = f"ssh {host} 'mkdir -p -m 700 {REMOTE_FOLDER}"
    if made.suffix == ".tar":
        return [f"{begin} && tar -x -C {REMOTE_FOLDER}' < {made}"]
    return [f"{begin}'", f"scp -p {made}/* {host}:{REMOTE_FOLDER}/"]


@dataclass
class Enrol:
    """Register a vehicle here, and issue the certificate with which it accepts our stations."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """name of the vehicle, like quad2"""
    address: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ADDRESS")]
    """host name or address at which it is reached, with :port unless it is 7447"""
    also: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="HOST")] = ()
    """another host name or address of it"""
    out: Annotated[Path | None, optional("DIR")] = None
    """folder, or file ending in .tar, for the vehicle's files"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        check_name(self.name)
        from console.link.known_vehicles import KnownVehicles
        from vehicle_link.addresses import parse_endpoint
        from vehicle_link.security.authority import ensure_certificates
        from vehicle_link.security.enrolment import issue_vehicle

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


MAY = {
    "observer": "receives and reads everything, and can command nothing",
    "pilot": "may do everything that this base may",
}


@dataclass
class _Station:
    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """name of the person or machine, like ben"""
    out: Annotated[Path | None, optional("DIR")] = None
    """folder, or file ending in .tar, for the station's files"""
    data: Folder = None
    """data folder"""

    def issue(self, access: Access) -> int:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,31}", self.name):
            raise UsageError(
                f"{self.name!r} is not a name for a station; allowed are up to 32 letters, "
                "digits and . _ -, a letter or digit first, like ben"
            )
        from vehicle_link.security.enrolment import issue_station

        data = open_data_folder(self.data)
        out = self.out or data / "issued" / f"{access}_{self.name}"
        base = data / "certificates"
        made = write_bundle(out, partial(issue_station, base, name=self.name, access=access))
        print(f"{self.name}'s station {MAY[access]}; its files are in {made}")
        print(
            f"1. copy ca.pem, station.pem and station.key into {REMOTE_FOLDER} there (mode 0700), "
            "or into\n   the folder certificates of another data folder"
        )
        print("2. there: quadlab station --vehicle NAME=ADDRESS")
        print(f"station.key is a secret: delete {made} once it is copied")
        return 0


@dataclass
class Observer(_Station):
    """Issue files for a station that may watch, but not command."""

    def run(self) -> int:
        return self.issue("observer")


@dataclass
class Pilot(_Station):
    """Issue files for a further station that may do everything."""

    def run(self) -> int:
        return self.issue("pilot")
