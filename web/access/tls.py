"""Certificate of the page: from the data folder's own authority, or provided by the user."""

from __future__ import annotations

import contextlib
import datetime
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from quadrotor.errors import UsageError, os_errors

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

SOON = 14  # days before its end from which a certificate causes a warning


@dataclass(frozen=True, slots=True)
class Tls:
    """Verified pair of certificate and key.

    names: hosts it is for, without wildcards.
    authority: to be trusted once in each browser; None for a certificate that the user provided.
    """

    certificate: Path
    key: Path
    names: tuple[str, ...]
    authority: Path | None = None


def private_tls(data: Path, names: tuple[str, ...]) -> Tls:
    """Return a certificate of the data folder's authority for these names, made if missing.

    Raises StorageError or LinkError.
    """
    from vehicle_link.security.authority import check_certificate
    from vehicle_link.security.page_authority import ensure_web_certificate

    files = ensure_web_certificate(data / "certificates", names)
    check_certificate(files, "web")
    names = _names(_read(files.certificate("web"), "the page's certificate"))
    return Tls(files.certificate("web"), files.key("web"), names, files.authority)


def given_tls(certificate: Path, key: Path) -> Tls:
    """Return a certificate (with its chain) and key in PEM.

    Raises UsageError if they are unreadable, not PEM, encrypted, do not fit each other
    or are not valid today.
    """
    held = _read(certificate, "--tls-certificate")
    _readable(key, "--tls-key")

    def locked() -> str:
        raise UsageError(f"--tls-key {key} is encrypted; give one without a password")

    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, locked)
    except ssl.SSLError as error:
        reason = (
            "does not fit" if error.reason == "KEY_VALUES_MISMATCH" else "is not the key (PEM) of"
        )
        raise UsageError(f"--tls-key {key} {reason} {certificate}") from None
    now = datetime.datetime.now(datetime.UTC)
    begin, end = held.not_valid_before_utc, held.not_valid_after_utc
    if not begin <= now <= end:
        raise UsageError(
            f"--tls-certificate {certificate} is valid from {begin:%Y-%m-%d} to {end:%Y-%m-%d} "
            f"and not today ({now:%Y-%m-%d}); renew it"
        )
    return Tls(certificate, key, _names(held))


def own_names(host: str) -> tuple[str, ...]:
    """Return the names and addresses under which others reach a server that listens on `host`."""
    if host not in ("", "0.0.0.0", "::"):
        return (host,)
    names = {socket.gethostname(), socket.getfqdn(), *_addresses()}
    return tuple(sorted(name for name in names if name and not name.endswith(".arpa")))


def shown_host(host: str) -> str:
    """Return the host that links use: `host`, or this computer's first address for a wildcard."""
    if host not in ("", "0.0.0.0", "::"):
        return host
    return next(iter(_addresses()), socket.gethostname())


def _read(path: Path, option: str) -> Certificate:
    from cryptography.x509 import load_pem_x509_certificate

    text = _readable(path, option)
    try:
        return load_pem_x509_certificate(text)
    except ValueError:
        raise UsageError(f"{option} {path} holds no certificate in PEM form") from None


def _names(certificate: Certificate) -> tuple[str, ...]:
    from cryptography.x509 import ExtensionNotFound, SubjectAlternativeName

    try:
        found = certificate.extensions.get_extension_for_class(SubjectAlternativeName).value
    except ExtensionNotFound:
        return ()
    return tuple(str(name.value) for name in found if "*" not in str(name.value))


def _readable(path: Path, option: str) -> bytes:
    with os_errors(lambda why: f"{option} {path} cannot be read ({why})", UsageError):
        return path.read_bytes()


def _addresses() -> list[str]:
    """Return the addresses of this computer, the one towards the network first."""
    found: list[str] = []
    for family, elsewhere in (
        (socket.AF_INET, "192.0.2.1"),  # addresses reserved for documentation; nothing is sent
        (socket.AF_INET6, "2001:db8::1"),
    ):
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((elsewhere, 9))
                found.append(str(probe.getsockname()[0]))
        except OSError:
            continue
    with contextlib.suppress(OSError):
        found += [str(one[4][0]) for one in socket.getaddrinfo(socket.gethostname(), None)]
    found += _interface_addresses()
    plain = [one for one in found if "%" not in one]
    return list(dict.fromkeys(plain))


def _interface_addresses() -> list[str]:
    """Return the IPv4 address of every network interface (Linux)."""
    import fcntl
    import struct

    get_address = 0x8915  # SIOCGIFADDR
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode()[:15])
            try:
                answer = fcntl.ioctl(probe.fileno(), get_address, request)
            except OSError:  # the interface has no address
                continue
            found.append(socket.inet_ntoa(answer[20:24]))
    return found
