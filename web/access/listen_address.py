"""Addresses on which the page may listen: loopback; others only with TLS and accounts."""

from __future__ import annotations

import ipaddress
import socket

from quadrotor.errors import UsageError


def is_loopback(host: str) -> bool:
    """Return whether a server on `host` is reached only from this computer.

    Raises UsageError for an unknown host.
    """
    if not host:
        return False
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        pass
    try:
        found = {str(one[4][0]).split("%")[0] for one in socket.getaddrinfo(host, None)}
    except OSError as error:
        raise UsageError(
            f"--host {host} is not known ({error.strerror}); give an address of this computer, "
            "0.0.0.0 for all of them"
        ) from None
    return all(ipaddress.ip_address(one).is_loopback for one in found)


def check_listen_address(host: str, *, has_tls: bool, accounts: int) -> None:
    """Raise UsageError unless others reach the page only by password and over TLS.

    The page moves a machine.
    """
    if is_loopback(host):
        return
    lacking = []
    if not has_tls:
        lacking.append("TLS (add --tls)")
    if accounts == 0:
        lacking.append("at least one account (quadlab user add NAME)")
    if lacking:
        raise UsageError(
            f"--host {host} opens the page to others, which needs {' and '.join(lacking)}; "
            "leave --host out to stay on this computer"
        )
