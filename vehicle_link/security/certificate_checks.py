"""Checks whether the certificate of an end of the link, or of the page, will be accepted."""

from __future__ import annotations

import datetime
from pathlib import Path

from quadrotor.errors import LinkError
from vehicle_link.checks import Check, Place, State
from vehicle_link.security.authority import Role, TlsFiles, check_certificate
from vehicle_link.security.certificates import load_certificate, names_of

SOON = 30
"""Days before the end of a certificate from which there is a warning."""


def certificate_check(place: Place, folder: Path, role: Role) -> Check:
    """Check that a certificate is present, issued by this folder's authority, and valid; report its
    end and names.
    """
    files = TlsFiles(folder)
    name = "page's certificate" if role == "web" else "link's certificate"
    wanted = "of our authority, valid"
    try:
        check_certificate(files, role)
        certificate = load_certificate(files.certificate(role))
    except (LinkError, OSError, ValueError) as error:
        advice = f"{error}; the files are in {folder}"
        return Check(name, "fail", "not accepted", wanted, advice, place)
    return validity_check(
        place, name, certificate.not_valid_after_utc, sorted(names_of(certificate))
    )


def validity_check(
    place: Place,
    name: str,
    end: datetime.datetime,
    hosts: list[str],
    now: datetime.datetime | None = None,
) -> Check:
    """Check how long an accepted certificate stays valid, and report for which hosts."""
    left = end - (now or datetime.datetime.now(datetime.UTC))
    state: State = "ok" if left > datetime.timedelta(days=SOON) else "warn"
    if left <= datetime.timedelta(0):
        state = "fail"
    held = f" for {', '.join(hosts)}" if hosts else ""
    return Check(
        name,
        state,
        f"until {end:%Y-%m-%d}{held}",
        f"{SOON} days left",
        "renew it, or delete it and its key to have them made at the next start",
        place,
    )
