"""The private certificate authority of a data folder, made on first use; both ends must present a
certificate that it issued (mutual TLS).

The vehicle needs `ca.pem`, `vehicle.pem`, `vehicle.key`; the station `ca.pem`, `station.pem`,
`station.key`; `ca.key` stays on the base. When the vehicle gets a new host name or address, its
certificate is made again, for the existing key. `web.pem` is the page's, made when the page is
to use TLS.

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

__all__ = [
    "LOCAL_NAMES",
    "ROLES",
    "WEB_DAYS",
    "WEB_RENEWED",
    "Role",
    "TlsFiles",
    "check_certificate",
    "ensure_certificates",
    "ensure_web_certificate",
    "issue",
    "readable_keys",
]

LOCAL_NAMES = ("localhost", "127.0.0.1")
WEB_DAYS = 397  # browsers refuse a server's certificate for more than 398 (some 825) days
WEB_RENEWED = 60  # days before its end


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


def ensure_web_certificate(folder: Path, names: Sequence[str]) -> TlsFiles:
    """Return the files of `ensure_certificates`, with a certificate of the page for these names.

    It is a server's certificate only: the link, where both ends present one, does not accept it
    from a client. It is made again for a new name and when it ends within `WEB_RENEWED` days.

    Raises StorageError or LinkError.
    """
    files = ensure_certificates(folder)
    if not is_there(files.authority_key):
        raise LinkError(
            f"{folder} has no authority's key (it is a vehicle's copy), so no certificate of the "
            "page can be made; give one with --tls-certificate and --tls-key"
        )
    what = f"cannot make the certificate of the page in {folder}"
    with os_errors(lambda why: f"{what}: {why}"), locked(folder):
        _ensure_web(files, {*LOCAL_NAMES, "::1", *names})
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
        _make_certificate(files, role, sorted(names), signer, subject, owner)
    return files


def _ensure(files: TlsFiles, names: Sequence[str]) -> None:
    if not is_there(files.authority):
        _make_authority(files)
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
        _make_certificate(files, role, sorted(wanted), signing_key(files))


def _ensure_web(files: TlsFiles, wanted: set[str]) -> None:
    if is_there(files.certificate("web")):
        held = read_certificate(files.certificate("web"), remedy_of_pair(files, "web"))
        left = held.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
        if left > datetime.timedelta(days=WEB_RENEWED):
            check_certificate(files, "web")
            if wanted <= names_of(held):
                return
        wanted |= names_of(held)
    _make_certificate(files, "web", sorted(wanted), signing_key(files))


def _names(files: TlsFiles, role: Role) -> set[str]:
    return names_of(read_certificate(files.certificate(role), remedy_of_pair(files, role)))


def _make_authority(files: TlsFiles) -> None:
    """Make an authority in a folder that is empty or has only the key of an interrupted start."""
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
    builder = certificate_builder("quadlab private authority", "quadlab private authority", key)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(key_usage(signs_certificates=True), critical=True)
    write_secret(files.authority, signed(builder, key))


def _make_certificate(
    files: TlsFiles,
    role: Role,
    names: Sequence[str],
    signer: EllipticCurvePrivateKey,
    subject: str = "",
    owner: str = "",
) -> None:
    """Make a certificate for the key if it exists already, so that no interruption leaves a pair
    that does not fit.
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
    builder = certificate_builder(subject, "quadlab private authority", key, owner=owner)
    extended = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    if role == "web":
        now = datetime.datetime.now(datetime.UTC)
        extended.pop()
        builder = certificate_builder(
            subject,
            "quadlab private authority",
            key,
            now - datetime.timedelta(days=1),
            now + datetime.timedelta(days=WEB_DAYS - 1),
        )
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
