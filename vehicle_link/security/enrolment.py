"""Certificates for other machines, issued by the base's authority."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vehicle_link.security.access import COMMON_NAMES, Access
from vehicle_link.security.authority import LOCAL_NAMES, TlsFiles, ensure_certificates, issue


def issue_vehicle(base: Path, folder: Path, name: str, hosts: Sequence[str]) -> TlsFiles:
    """Issue the certificate of a vehicle that is dialled as one of `hosts`.

    Args:
        base: the base's folder of certificates; its authority is made when missing.
        folder: gets ca.pem, vehicle.pem and vehicle.key.

    Raises StorageError or LinkError.
    """
    return issue(ensure_certificates(base), folder, "vehicle", [*LOCAL_NAMES, *hosts], owner=name)


def issue_station(base: Path, folder: Path, name: str, access: Access) -> TlsFiles:
    """Issue the certificate of a person's or machine's station: ca.pem, station.pem, station.key in
    `folder`.

    Raises StorageError or LinkError.
    """
    return issue(
        ensure_certificates(base), folder, "station", LOCAL_NAMES, COMMON_NAMES[access], owner=name
    )
