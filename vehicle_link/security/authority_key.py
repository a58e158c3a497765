"""Checks whether a folder of certificates can issue further ones, and how to repair it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from quadrotor.errors import LinkError
from vehicle_link.security.tls_files import Role, TlsFiles, is_there, read_certificate, read_key

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey


def signing_key(files: TlsFiles) -> EllipticCurvePrivateKey:
    """Return the key that signs. Raises LinkError when there is none, or it does not belong to this
    ca.pem.
    """
    if not is_there(files.authority_key):
        raise LinkError(
            f"{files.folder} has no authority's key (it is a copy of another machine's); "
            "issue certificates on the base, where ca.key is"
        )
    key = authority_key(files)
    authority = read_certificate(files.authority, remedy_of_authority(files))
    if authority.public_key() != key.public_key():
        raise LinkError(
            f"{files.authority_key} does not belong to {files.authority}; on the base, copy back "
            "the one that does; elsewhere nothing can be issued, and it is of no use"
        )
    return key


def authority_key(files: TlsFiles) -> EllipticCurvePrivateKey:
    """Read the authority's key. Raises LinkError when it cannot be used."""
    from cryptography.hazmat.primitives.asymmetric import ec

    remedy = (
        f"copy it back from where you keep a second one, or move {files.folder} away to start "
        "over, and then enrol every vehicle again"
    )
    key = read_key(files.authority_key, remedy)
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise LinkError(f"{files.authority_key} is not of quadlab; {remedy}")
    return key


def is_of_another_authority(files: TlsFiles) -> bool:
    """Return whether ca.key belongs to another ca.pem: a vehicle that had its own authority was
    enrolled.
    """
    try:
        key = read_key(files.authority_key, "")
        return read_certificate(files.authority, "").public_key() != key.public_key()
    except LinkError:  # reported where the file is needed
        return False


def remedy_of_authority(files: TlsFiles) -> str:
    return (
        "copy it back from a machine that has it (the base and every vehicle enrolled there have "
        f"the same certificates/{files.authority.name}), or move {files.folder} away to start "
        "over, and then enrol every vehicle again"
    )


def remedy_of_pair(files: TlsFiles, role: Role) -> str:
    pair = f"{files.certificate(role).name} and {files.key(role).name}"
    if is_there(files.authority_key) and not is_of_another_authority(files):
        return f"copy {pair} again from the base, or delete them to have them made"
    own = ", or delete both if only a station runs here" if role == "vehicle" else ""
    return f"copy {pair} again from the base that issued ca.pem{own}"
