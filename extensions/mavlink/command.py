"""`quadlab mavlink`: lets ground stations and programs that speak MAVLink fly the vehicle."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import File, Flag, Folder
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from extensions.mavlink.frames import Origin
    from extensions.mavlink.gateway import Gateway
    from extensions.mavlink.link import Link
    from extensions.mavlink.peer import Peer
    from quadlab.station_client import StationClient

LIBRARY = "pymavlink"
USUAL = ("udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540")


@dataclass
class Mavlink:
    """Let QGroundControl, MAVSDK and others fly the vehicle over MAVLink 2."""

    connection: Annotated[
        tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="CONNECTION")
    ] = USUAL
    """udpin:ADDRESS:PORT or tcpin:ADDRESS:PORT listens there, udpout:ADDRESS:PORT sends there; the
    usual ones are where QGroundControl and MAVSDK listen"""
    viewers: Flag = False
    """send telemetry only: nobody may command, except an emergency landing"""
    passphrase: File = None
    """a file with the passphrase of signed messages; others are refused"""
    unsigned: Flag = False
    """accept unsigned commands where it listens, and from other computers, too: anybody can fly"""
    origin: Annotated[str, tyro.conf.arg(metavar="LAT,LON,ALT")] = "47.397742,8.545594,0"
    """where on Earth the world's origin is said to be"""
    data: Folder = None
    """data folder, of the runs to download"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback; --link-port of `quadlab up`"""
    name: str = THE_VEHICLE
    """namespace of the vehicle's topics"""

    def run(self) -> int:
        check_name(self.name)
        if importlib.util.find_spec(LIBRARY) is None:
            raise UsageError(
                f"MAVLink needs the package {LIBRARY}; install it with `scripts/setup mavlink`"
            )
        from extensions.mavlink.link import check_reach, is_open, parse_endpoint

        endpoints = [parse_endpoint(word) for word in self.connection or USUAL]
        secret = "" if self.passphrase is None else _passphrase(self.passphrase)
        check_reach(endpoints, self.unsigned or bool(secret))
        from extensions.mavlink.frames import parse_origin
        from extensions.mavlink.link import Link
        from quadlab.station_client import StationClient, await_session
        from vehicle_link.termination_signal import EndSignal

        origin = parse_origin(self.origin)
        stopping = EndSignal()
        session = await_session(self.loopback_port, stopping, say)
        if session is None:
            return 0

        def open_link(has_left: Callable[[Peer], None]) -> Link:
            return Link(endpoints, secret, say, has_left, unsigned=self.unsigned)

        client = StationClient(session, self.name, "mavlink")
        try:
            gateway = self._gateway(
                client, lambda who: StationClient(session, self.name, who), open_link, origin
            )
            say(f"{self.name} at {', '.join(self.connection or USUAL)}")
            if is_open(endpoints) and not (secret or self.unsigned or self.viewers):
                say("who sends unsigned where it listens may watch, not fly; --unsigned allows it")
            gateway.run(stopping)
        finally:
            client.close()
            session.close()
        return 0

    def _gateway(
        self,
        client: StationClient,
        connect: Callable[[str], StationClient],
        open_link: Callable[[Callable[[Peer], None]], Link],
        origin: Origin,
    ) -> Gateway:
        from console.catalogue.catalogue import Catalogue
        from extensions.mavlink.gateway import Gateway
        from extensions.mavlink.logs import Logs
        from extensions.mavlink.vehicle import Vehicle

        return Gateway(
            open_link,
            Vehicle(client),
            connect=connect,
            logs=Logs(Catalogue(open_data_folder(self.data)), self.name),
            advertise=client.advertise,
            changes=client.listen("parameter_changes"),
            events=client.listen("events"),
            origin=origin,
            viewers=self.viewers,
            say=say,
        )


def say(line: str) -> None:
    """Print a line of this process."""
    print(f"mavlink: {line}", flush=True)


def _passphrase(file: Path) -> str:
    try:
        words = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"--passphrase {file} cannot be read: {error}") from None
    if len(words) < 8:
        raise UsageError(f"--passphrase {file} has {len(words)} characters; give 8 or more")
    return words
