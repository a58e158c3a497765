"""The private certificate authority of a data folder, made on first use; both ends must present a
certificate that it issued (mutual TLS).

The vehicle needs `ca.pem`, `vehicle.pem`, `vehicle.key`; the station `ca.pem`, `station.pem`,
`station.key`; `ca.key` stays on the base. When the vehicle gets a new host name or address, its
certificate is made again, for the existing key. The page has an authority of its own
(`page_authority`).

A base that loses its authority is a stranger to all machines that it has enrolled. So an authority
is made only in an empty folder, and no existing file is overwritten except a certificate that is
made again. Files are made in an order, keys first, in which an interrupted start can be resumed.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from quadrotor.errors import ClockNotSetError, LinkError, StorageError, os_errors
from vehicle_link.security.certificates import (
    EARLIEST,
    certificate_builder,
    general_name,
    key_usage,
    names_of,
    pem_of_key,
    signed,
)
from vehicle_link.security.tls_files import (
    ROLES,
    Role,
    TlsFiles,
    authority_key,
    is_of_another_authority,
    is_there,
    locked,
    read_certificate,
    read_key,
    readable_keys,
    remedy_of_authority,
    remedy_of_pair,
    signing_key,
    write_secret,
)

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import NameConstraints

__all__ = [
    "LOCAL_NAMES",
    "ROLES",
    "Role",
    "TlsFiles",
    "check_certificate",
    "ensure_certificates",
    "issue",
    "make_authority",
    "make_certificate",
    "readable_keys",
]

LOCAL_NAMES = ("localhost", "127.0.0.1")
NAME = "quadlab private authority"


def ensure_certificates(folder: Path, names: Sequence[str] = ()) -> TlsFiles:
    """Return the certificates of this folder, made where they are missing; safe from several
    processes.

    Args:
        folder: made when missing, mode 0700; the files have mode 0600.
        names: host names and addresses under which the vehicle is dialled, next to this host's.

    Raises:
        StorageError: the folder cannot be written.
        ClockNotSetError: the computer's clock is from before the certificates are valid.
        LinkError: the authority of existing files is missing, or a file cannot be used.
    """
    now, files = datetime.datetime.now(datetime.UTC), TlsFiles(folder)
    if now < EARLIEST:
        raise ClockNotSetError(
            f"the clock of this computer says {now:%Y-%m-%d %H:%M} UTC, and certificates of the "
            f"link are valid from {EARLIEST:%Y-%m-%d} on; set the clock"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with locked(folder):
            _ensure(files, (*LOCAL_NAMES, *names))
    except OSError as error:
        raise StorageError(
            f"cannot make the certificates in {folder}: {error.strerror or error}; "
            "choose another data folder with --data"
        ) from error
    return files


def check_certificate(files: TlsFiles, role: Role, host: str = "") -> None:
    """Check that a role's certificate will be accepted, as Zenoh does not say why one is not.

    Args:
        host: a name or address that the certificate must contain; "" = any.

    Raises:
        LinkError: a file is missing or unreadable; the certificate is of another authority, has
            expired, does not fit its key, or does not contain `host`.
    """
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm

    path, remedy = files.certificate(role), remedy_of_pair(files, role)
    authority = read_certificate(files.authority, remedy_of_authority(files))
    certificate = read_certificate(path, remedy)
    key = read_key(files.key(role), remedy)
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise LinkError(f"{path} was not signed by {files.authority}; {remedy}") from error
    if certificate.public_key() != key.public_key():
        raise LinkError(f"{path} does not belong to {files.key(role)}; {remedy}")
    now = datetime.datetime.now(datetime.UTC)
    if not certificate.not_valid_before_utc <= now <= certificate.not_valid_after_utc:
        raise LinkError(
            f"{path} is valid from {certificate.not_valid_before_utc} to "
            f"{certificate.not_valid_after_utc}, and the clock says {now:%Y-%m-%d %H:%M} UTC; "
            f"set the clock, or {remedy}"
        )
    held = names_of(certificate)
    if host and host not in held:
        raise LinkError(
            f"{path} is for {', '.join(sorted(held))}, not for {host}; "
            f"dial one of these, or add {host} to the vehicle's names"
        )


def issue(
    authority: TlsFiles,
    folder: Path,
    role: Role,
    names: Sequence[str],
    subject: str = "",
    owner: str = "",
) -> TlsFiles:
    """Issue a certificate for another machine into a folder, with key and authority certificate.

    Args:
        folder: made when missing, mode 0700; what was issued into it before is replaced.
        subject: common name, which decides the access rights (see `access`); the role's if
            empty.
        owner: name of the machine or person, for people who inspect the certificate.

    Raises:
        StorageError: the folder cannot be written.
            LinkError: there is no authority's key here, or `folder` has one.
    """
    signer = signing_key(authority)
    files = TlsFiles(folder)
    if is_there(files.authority_key):
        raise LinkError(
            f"{folder} has a ca.key, so it is the folder of an authority and is left as it is; "
            "choose another with --out"
        )
    with os_errors(lambda why: f"cannot write {folder}: {why}"):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_secret(files.authority, authority.authority.read_bytes())
        files.key(role).unlink(missing_ok=True)
        make_certificate(files, role, sorted(names), signer, subject, owner)
    return files


def _ensure(files: TlsFiles, names: Sequence[str]) -> None:
    if not is_there(files.authority):
        make_authority(files)
    if not is_there(files.authority_key) or is_of_another_authority(files):
        return  # a vehicle's or station's copy: nothing can be issued here
    for role in ROLES:
        wanted = set(names)
        if is_there(files.certificate(role)):
            check_certificate(files, role)  # one that does not fit is never replaced silently
            held = _names(files, role)
            if wanted <= held:
                continue
            wanted |= held
        make_certificate(files, role, sorted(wanted), signing_key(files))


def _names(files: TlsFiles, role: Role) -> set[str]:
    return names_of(read_certificate(files.certificate(role), remedy_of_pair(files, role)))


def make_authority(
    files: TlsFiles, name: str = NAME, constraints: NameConstraints | None = None
) -> None:
    """Make an authority in a folder that is empty or has only the key of an interrupted start.

    Args:
        constraints: what it may issue certificates for; anything if None.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec

    there = files.present()
    if there not in ([], [files.authority_key]):
        names = ", ".join(path.name for path in there)
        raise LinkError(
            f"{files.authority} is missing next to {names}; {remedy_of_authority(files)}"
        )
    if there:
        key = authority_key(files)
    else:
        key = ec.generate_private_key(ec.SECP256R1())
        write_secret(files.authority_key, pem_of_key(key))
    builder = certificate_builder(name, name, key)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(key_usage(signs_certificates=True), critical=True)
    if constraints is not None:
        builder = builder.add_extension(constraints, critical=True)
    write_secret(files.authority, signed(builder, key))


def make_certificate(
    files: TlsFiles,
    role: Role,
    names: Sequence[str],
    signer: EllipticCurvePrivateKey,
    subject: str = "",
    owner: str = "",
    *,
    issuer: str = NAME,
    valid: tuple[datetime.datetime, datetime.datetime] | None = None,
) -> None:
    """Make a certificate for the key if it exists already, so that no interruption leaves a pair
    that does not fit.

    Args:
        valid: begin and end of its validity; the usual ones if None.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID

    if is_there(files.key(role)):
        found = read_key(files.key(role), remedy_of_pair(files, role))
        if not isinstance(found, ec.EllipticCurvePrivateKey):
            raise LinkError(f"{files.key(role)} is not of quadlab; {remedy_of_pair(files, role)}")
        key = found
    else:
        key = ec.generate_private_key(ec.SECP256R1())
        write_secret(files.key(role), pem_of_key(key))
    subject = subject or f"quadlab {role}"
    limits = {} if valid is None else {"begin": valid[0], "end": valid[1]}
    builder = certificate_builder(subject, issuer, key, owner=owner, **limits)
    extended = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    if role == "web":
        extended.pop()
    builder = (
        builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(key_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(extended), critical=False)
        .add_extension(x509.SubjectAlternativeName(map(general_name, names)), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False
        )
    )
    write_secret(files.certificate(role), signed(builder, signer))
