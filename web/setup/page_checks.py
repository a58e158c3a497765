"""Checks of the web process itself: its addresses, TLS and accounts."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from urllib.parse import urlsplit

from vehicle_link.checks import Check, Place
from vehicle_link.security.certificate_checks import validity_check
from vehicle_link.security.certificates import load_certificate
from web.access.listen_address import is_loopback
from web.access.tls import Tls

PLACE: Place = "page"
PACKAGES = ("viser", "fastapi", "uvicorn", "uplot-python")


def page_checks(base_url: str, tls: Tls | None, accounts: int) -> list[Check]:
    """Return the page's checks; `accounts` is the number of accounts."""
    place = urlsplit(base_url)
    return [
        _encryption(place.hostname or "", tls),
        *([_certificate(tls)] if tls else []),
        _accounts(accounts),
        Check("address", "ok", base_url, place=PLACE),
        Check("libraries", "ok", _libraries(), place=PLACE),
    ]


def _encryption(host: str, tls: Tls | None) -> Check:
    if tls is not None:
        found = "on: the connection is encrypted"
        return Check("TLS", "ok", found, "on, or this computer only", place=PLACE)
    if is_loopback(host):
        found = "off: the page is for this computer only, and browsers trust it as such"
        return Check("TLS", "ok", found, "on, or this computer only", place=PLACE)
    advice = "start with --tls: passwords travel in the clear, and browsers give no gamepad"
    return Check("TLS", "fail", "off", "on, or this computer only", advice, PLACE)


def _certificate(tls: Tls) -> Check:
    name = "page's certificate"
    try:
        certificate = load_certificate(tls.certificate)
    except (OSError, ValueError) as error:
        advice = f"{tls.certificate}: {error}; it is needed at the next start"
        return Check(name, "fail", "cannot be read", "valid", advice, PLACE)
    return validity_check(PLACE, name, certificate.not_valid_after_utc, sorted(tls.names))


def _accounts(count: int) -> Check:
    if count:
        found = f"{count} with a password"
        return Check("accounts", "ok", found, "one for each person", place=PLACE)
    advice = "add one below: then the log says who did what, and others may reach the page"
    return Check("accounts", "warn", "none", "one for each person", advice, PLACE)


def _libraries() -> str:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return ", ".join(f"{name} {number}" for name, number in found.items())
