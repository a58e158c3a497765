"""The page's own authority, which people import into their browsers, and the page's certificate.

It is another one than the link's, and its certificate permits this computer's names and addresses,
and those of private networks, alone: whoever gets its key cannot stand for any other site in these
browsers.
"""

from __future__ import annotations

import datetime
import ipaddress
import socket
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from quadrotor.errors import os_errors
from vehicle_link.security.authority import (
    LOCAL_NAMES,
    check_certificate,
    make_authority,
    make_certificate,
)
from vehicle_link.security.certificates import general_name, names_of
from vehicle_link.security.tls_files import (
    TlsFiles,
    is_there,
    locked,
    page_files,
    read_certificate,
    remedy_of_authority,
    remedy_of_pair,
    signing_key,
)

if TYPE_CHECKING:
    from cryptography.x509 import Certificate, NameConstraints

NAME = "quadlab page authority"
WEB_DAYS = 397  # browsers refuse a server's certificate for more than 398 (some 825) days
WEB_RENEWED = 60  # days before its end
DOMAINS = ("localhost", "local")
NETWORKS = (
    *("127.0.0.0/8", "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16"),
    *("::1/128", "fc00::/7", "fe80::/10"),
)
"""Domains and networks that nobody owns in the internet: of this computer, or private."""


def ensure_web_certificate(folder: Path, names: Sequence[str]) -> TlsFiles:
    """Return the page's authority and certificate for these names, made where they are missing;
    safe from several processes.

    The certificate is a server's only, and made again for a new name and when it ends within
    `WEB_RENEWED` days; the authority's for a new name that it does not permit.

    Args:
        folder: of the link's certificates, made when missing; the page's are in one of its own
            there.

    Raises StorageError or LinkError.
    """
    files = page_files(folder)
    wanted = {*LOCAL_NAMES, "::1", *names}
    what = f"cannot make the certificate of the page in {files.folder}"
    with os_errors(lambda why: f"{what}: {why}"):
        for one in (folder, files.folder):
            one.mkdir(parents=True, exist_ok=True, mode=0o700)
        with locked(files.folder):
            _ensure_web(files, wanted | _ensure_authority(files, wanted))
    return files


def permits(authority: Certificate, name: str) -> bool:
    """Return whether an authority may issue a certificate for a name or an address."""
    constraints = _constraints_of(authority)
    allowed = [] if constraints is None else list(constraints.permitted_subtrees or ())
    for value in (one.value for one in allowed if isinstance(one, type(general_name(name)))):
        if isinstance(value, str):
            if name == value or name.endswith(f".{value}"):
                return True
        elif ipaddress.ip_address(name) in value:
            return True
    return False


def _ensure_authority(files: TlsFiles, wanted: set[str]) -> set[str]:
    """Make the authority where it is missing or does not permit all names; return the names of the
    certificate that a former one issued.
    """
    former = set[str]()
    names = {*wanted, socket.gethostname(), socket.getfqdn()}
    if is_there(files.authority):
        authority = read_certificate(files.authority, remedy_of_authority(files))
        if all(permits(authority, name) for name in wanted):
            return former
        if is_there(files.certificate("web")):
            former = names_of(
                read_certificate(files.certificate("web"), remedy_of_pair(files, "web"))
            )
        # The key last, so that an interrupted start is resumed.
        for path in (files.certificate("web"), files.key("web"), files.authority):
            path.unlink(missing_ok=True)
    make_authority(files, NAME, _permitting(names | former))
    return former


def _permitting(names: Iterable[str]) -> NameConstraints:
    from cryptography import x509

    networks = [ipaddress.ip_network(one) for one in NETWORKS]
    domains = set(DOMAINS)
    for name in sorted(names):
        try:
            network = ipaddress.ip_network(name)
        except ValueError:
            domains |= {name} if name and not name.endswith(".arpa") else set()
            continue
        if not any(network.network_address in one for one in networks):
            networks.append(network)
    return x509.NameConstraints(
        [*map(x509.DNSName, sorted(domains)), *map(x509.IPAddress, networks)], None
    )


def _constraints_of(authority: Certificate) -> NameConstraints | None:
    from cryptography import x509

    try:
        return authority.extensions.get_extension_for_class(x509.NameConstraints).value
    except x509.ExtensionNotFound:
        return None


def _ensure_web(files: TlsFiles, wanted: set[str]) -> None:
    if is_there(files.certificate("web")):
        held = read_certificate(files.certificate("web"), remedy_of_pair(files, "web"))
        left = held.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
        if left > datetime.timedelta(days=WEB_RENEWED):
            check_certificate(files, "web")
            if wanted <= names_of(held):
                return
        wanted |= names_of(held)
    now = datetime.datetime.now(datetime.UTC)
    valid = (now - datetime.timedelta(days=1), now + datetime.timedelta(days=WEB_DAYS - 1))
    make_certificate(files, "web", sorted(wanted), signing_key(files), issuer=NAME, valid=valid)
