"""The private certificate authority of a data folder, made on first use; both ends must show a
certificate of it (mutual TLS).

The vehicle needs `ca.pem`, `vehicle.pem`, `vehicle.key`; the station `ca.pem`, `station.pem`,
`station.key`; `ca.key` stays on the base. A new host name or address of the vehicle makes its
certificate anew. `web.pem` is the page's under TLS, made when it is asked for.
"""

from __future__ import annotations

import datetime
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from quadrotor.errors import LinkError, StorageError
from vehicle_link.certificates import (
    certificate_builder,
    general_name,
    key_usage,
    load_certificate,
    names_of,
    pem_of_key,
    signed,
)

Role = Literal["vehicle", "station", "web"]
ROLES: tuple[Role, ...] = ("vehicle", "station")
"""Of the link; both ends show theirs."""

LOCAL_NAMES = ("localhost", "127.0.0.1")
WEB_DAYS = 397  # browsers refuse a server's certificate for more than 398 (some 825) days
WEB_RENEWED = 60  # days before its end


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """The files of one authority, all in one folder."""

    folder: Path

    @property
    def authority(self) -> Path:
        return self.folder / "ca.pem"

    @property
    def authority_key(self) -> Path:
        return self.folder / "ca.key"

    def certificate(self, role: Role) -> Path:
        return self.folder / f"{role}.pem"

    def key(self, role: Role) -> Path:
        return self.folder / f"{role}.key"


def ensure_certificates(folder: Path, names: Sequence[str] = ()) -> TlsFiles:
    """The certificates of this folder, made where they are missing; safe from several processes.

    Args:
        folder: made when missing, mode 0700; the files have mode 0600.
        names: host names and addresses under which the vehicle is dialled, beside this host's.

    Raises:
        StorageError: the folder cannot be written.
        LinkError: the authority's key is not one of quadlab.
    """
    files = TlsFiles(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with _locked(folder):
            _ensure(files, (*LOCAL_NAMES, *names))
    except OSError as error:
        raise StorageError(
            f"cannot make the certificates in {folder}: {error.strerror or error}; "
            "choose another data folder with --data"
        ) from error
    return files


def ensure_web_certificate(folder: Path, names: Sequence[str]) -> TlsFiles:
    """As `ensure_certificates`, and a certificate of the page for these names.

    It is a server's only: the link, where both ends show a certificate, does not take it for a
    client's. Made anew for a new name and when it ends within `WEB_RENEWED` days.

    Raises StorageError or LinkError.
    """
    files = ensure_certificates(folder)
    if not files.authority_key.exists():
        raise LinkError(
            f"{folder} has no authority's key (it is a vehicle's copy), so no certificate of the "
            "page can be made; give one with --tls-certificate and --tls-key"
        )
    try:
        with _locked(folder):
            _ensure_web(files, {*LOCAL_NAMES, "::1", *names})
    except OSError as error:
        raise StorageError(
            f"cannot make the certificate of the page in {folder}: {error.strerror or error}"
        ) from error
    return files


def check_certificate(files: TlsFiles, role: Role, host: str = "") -> None:
    """That a role's certificate will be accepted: Zenoh itself does not say why it is not.

    Args:
        host: a name or address the certificate must hold; "" = any.

    Raises:
        LinkError: a file is missing or unreadable, the certificate is not of this authority, has
            expired, does not fit its key, or does not hold `host`.
    """
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    path = files.certificate(role)
    try:
        authority, certificate = load_certificate(files.authority), load_certificate(path)
        key = load_pem_private_key(files.key(role).read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:
        raise LinkError(f"cannot read the certificates in {files.folder}: {error}") from error
    remedy = f"copy {path.name} and its key anew from the base, or delete them to have them made"
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError) as error:
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


def _ensure(files: TlsFiles, names: Sequence[str]) -> None:
    if files.authority.exists() and not files.authority_key.exists():
        return  # a vehicle's copy of the folder: nothing can be issued here
    new_authority = not files.authority.exists()
    if new_authority:
        _make_authority(files)  # what an authority that is gone has signed is of no use
    for role in ROLES:
        wanted = set(names)
        held_already = files.certificate(role).exists() or files.key(role).exists()
        if held_already and not new_authority:
            check_certificate(files, role)  # one that does not fit is never replaced in silence
            held = names_of(load_certificate(files.certificate(role)))
            if wanted <= held:
                continue
            wanted |= held
        _make_certificate(files, role, sorted(wanted))


def _ensure_web(files: TlsFiles, wanted: set[str]) -> None:
    if files.certificate("web").exists():
        held = load_certificate(files.certificate("web"))
        left = held.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
        if left > datetime.timedelta(days=WEB_RENEWED):
            check_certificate(files, "web")
            if wanted <= names_of(held):
                return
        wanted |= names_of(held)
    _make_certificate(files, "web", sorted(wanted))


def _make_authority(files: TlsFiles) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    builder = certificate_builder("quadlab private authority", "quadlab private authority", key)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(key_usage(signs_certificates=True), critical=True)
    _write(files.authority_key, pem_of_key(key))
    _write(files.authority, signed(builder, key))


def issue(
    authority: TlsFiles,
    folder: Path,
    role: Role,
    names: Sequence[str],
    subject: str = "",
    owner: str = "",
) -> TlsFiles:
    """A certificate, its key and the authority's certificate, into a folder of another machine.

    Args:
        folder: made when missing, mode 0700.
        subject: its common name, what access goes by (vehicle_link.access); the role's if empty.
        owner: whose it is, for people who look at it.

    Raises:
        StorageError: the folder cannot be written.
        LinkError: there is no authority's key here.
    """
    if not authority.authority_key.exists():
        raise LinkError(
            f"{authority.folder} has no authority's key (it is a copy of another machine's); "
            "issue certificates on the base, where ca.key is"
        )
    files = TlsFiles(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        _write(files.authority, authority.authority.read_bytes())
        _make_certificate(files, role, sorted(names), authority, subject, owner)
    except OSError as error:
        raise StorageError(f"cannot write {folder}: {error.strerror or error}") from error
    return files


def _make_certificate(
    files: TlsFiles,
    role: Role,
    names: Sequence[str],
    authority: TlsFiles | None = None,
    subject: str = "",
    owner: str = "",
) -> None:
    """Into `files`, signed by `authority` (default: the same folder's)."""
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
    from cryptography.x509.oid import ExtendedKeyUsageOID

    signer = (authority or files).authority_key
    authority_key = load_pem_private_key(signer.read_bytes(), None)
    if not isinstance(authority_key, ec.EllipticCurvePrivateKey):
        raise LinkError(f"{signer} is not of quadlab; empty {signer.parent}")
    key = ec.generate_private_key(ec.SECP256R1())
    subject = subject or f"quadlab {role}"
    builder = certificate_builder(subject, "quadlab private authority", key, owner=owner)
    extended = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    if role == "web":
        now = datetime.datetime.now(datetime.UTC)
        extended.pop()
        builder = certificate_builder(
            subject, "quadlab private authority", key,
            now - datetime.timedelta(days=1), now + datetime.timedelta(days=WEB_DAYS - 1),
        )  # fmt: skip
    builder = (
        builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(key_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(extended), critical=False)
        .add_extension(x509.SubjectAlternativeName(map(general_name, names)), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()),
            critical=False,
        )
    )
    _write(files.key(role), pem_of_key(key))
    _write(files.certificate(role), signed(builder, authority_key))


def _write(path: Path, data: bytes) -> None:
    """Whole or not at all, and never readable by others, not even for a moment."""
    part = path.with_name(f".{path.name}.part")
    part.unlink(missing_ok=True)
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
    part.replace(path)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """One process at a time; the lock goes with the descriptor, also in a crash."""
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
