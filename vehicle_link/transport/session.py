"""Zenoh sessions of the vehicle and the station.

Vehicle and station share one QUIC link with mutual TLS: reliable streams, and datagrams for best
effort (`mixed_rel=1`). The station has one session on its loopback (`hub_session`) with its nodes,
and one more for each vehicle (vehicle_link.transport.radio) that dials it and routes between the
two. The numbers were measured on an emulated lossy link: short leases and time-outs resume data
0.35 s after an outage instead of seconds, short queues keep old samples from arriving in a burst.
"""

from __future__ import annotations

import ipaddress
import threading
from typing import TYPE_CHECKING, Any

from vehicle_link.addresses import EVERYWHERE, LOOPBACK, parse_endpoint
from vehicle_link.security.access import access_control
from vehicle_link.security.authority import Role, TlsFiles, check_certificate
from vehicle_link.transport.loopback import RETRY, open_session
from vehicle_link.transport.unused_memory import map_large_buffers

if TYPE_CHECKING:
    import zenoh

OPEN_S = 0.3
"""Time limit, in s, of one attempt to open a link."""
VEHICLES = "vehicle"
"""Region of the vehicles. A router forwards nothing within one region, where peers connect to each
other directly; ROS 2 nodes are peers too, and could not reach a vehicle otherwise."""
GATEWAY = {
    "south": [
        {"filters": [{"region_names": [VEHICLES]}]},
        {"filters": [{"modes": ["client", "peer"]}]},
    ]
}
_QUEUES = {
    "control": 2,
    "real_time": 4,
    "interactive_high": 4,
    "interactive_low": 2,
    "data_high": 2,
    "data": 2,
    "data_low": 2,
    "background": 16,
}


def vehicle_session(port: int, tls: TlsFiles, host: str = EVERYWHERE) -> zenoh.Session:
    """Open a session that listens for the station on UDP `port`, and never dials.

    Raises:
        LinkError: the port is in use, or the vehicle's certificate cannot be used.
    """
    check_certificate(tls, "vehicle")
    config = link_config("peer", tls, "vehicle")
    config["listen"] = {"endpoints": [quic(host, port)]}
    config["region_name"] = VEHICLES
    config["access_control"] = access_control()
    return open_session(config, f"UDP port {port} of {host}")


def hub_session(loopback_port: int) -> zenoh.Session:
    """Open the hub, where the station's nodes, radios, page, tools and ROS 2 meet; it never dials.

    Raises LinkError when the loopback port is in use.
    """
    config = link_config("router")
    config["listen"] = {"endpoints": [f"tcp/{LOOPBACK}:{loopback_port}"]}
    config["gateway"] = GATEWAY
    return open_session(config, f"TCP port {loopback_port} of {LOOPBACK}")


def radio_session(
    vehicle_endpoint: str, tls: TlsFiles, loopback_port: int | None = None
) -> zenoh.Session:
    """Open a session that keeps dialling a vehicle, and routes between it and the hub, if named.

    Returns within a second, whether or not the vehicle answers.

    Args:
        vehicle_endpoint: `host`, `host:port` or `quic/host:port`; a name or address that is in the
            vehicle's certificate.

    Raises:
        LinkError: the session cannot be opened.
        UsageError: the endpoint cannot be parsed.
    """
    map_large_buffers()
    config = link_config("router", tls, "station")
    host, port = parse_endpoint(vehicle_endpoint)
    endpoints = [quic(host, port)]
    if host == LOOPBACK:  # a vehicle of this computer is reached by no other network
        endpoints[0] += f"#bind={LOOPBACK}:0"
    if loopback_port is not None:
        endpoints.append(f"tcp/{LOOPBACK}:{loopback_port}")
    config["connect"] = {"endpoints": endpoints, **RETRY}
    config["listen"] = {"endpoints": []}
    config["gateway"] = GATEWAY
    return open_session(config, vehicle_endpoint)


def check_station(vehicle_endpoint: str, tls: TlsFiles) -> None:
    """Check that the certificates let us dial this vehicle, as far as this machine can know.

    Raises LinkError or UsageError.
    """
    host, _ = parse_endpoint(vehicle_endpoint)
    check_certificate(tls, "station")
    if tls.certificate("vehicle").exists():  # the base issued it, so its faults can be reported
        check_certificate(tls, "vehicle", host)


def wait_connected(session: zenoh.Session, timeout: float) -> bool:
    """Wait at most `timeout` seconds for a session's QUIC link; return whether it is connected."""
    import zenoh

    stands = threading.Event()

    def changed(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT and event.link.dst.startswith("quic/"):
            stands.set()

    with session.info.declare_link_events_listener(changed, history=True):
        return stands.wait(timeout)


def link_config(mode: str, tls: TlsFiles | None = None, role: Role = "station") -> dict[str, Any]:
    """Return the configuration that all routing sessions share; with `tls`, also the certificates
    of an end of the radio link.
    """
    attempt = round(1e3 * OPEN_S)
    link: dict[str, object] = {
        "tx": {
            "lease": 1500,
            "keep_alive": 8,
            "batch_size": 1450,
            "queue": {
                "size": _QUEUES,
                "congestion_control": {
                    "drop": {"wait_before_drop": 1000, "max_wait_before_drop_fragments": 100_000}
                },
            },
        }
    }
    if tls is not None:
        key, certificate = str(tls.key(role)), str(tls.certificate(role))
        link["tls"] = {
            "root_ca_certificate": str(tls.authority),
            "listen_private_key": key,
            "listen_certificate": certificate,
            "connect_private_key": key,
            "connect_certificate": certificate,
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    return {
        "mode": mode,
        # Nothing is discovered, so opening need not wait half a second for results.
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            # On one host, shared memory would let large messages bypass the link.
            "shared_memory": {"enabled": False},
            "unicast": {"open_timeout": attempt, "accept_timeout": attempt, "max_links": 1},
            "link": link,
        },
    }


def quic(host: str, port: int) -> str:
    try:
        bracketed = f"[{host}]" if ipaddress.ip_address(host).version == 6 else host
    except ValueError:
        bracketed = host
    return f"quic/{bracketed}:{port}?mixed_rel=1"
