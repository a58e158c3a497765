"""The private certificate authority of a data folder, made on first use; both ends must show a
certificate of it (mutual TLS).

The vehicle needs `ca.pem`, `vehicle.pem`, `vehicle.key`; the station `ca.pem`, `station.pem`,
`station.key`; `ca.key` stays on the base. A new host name or address of the vehicle makes its
certificate anew.
"""

from __future__ import annotations

import datetime
import fcntl
import ipaddress
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from quadrotor.errors import LinkError, StorageError

if TYPE_CHECKING:  # cryptography costs 0.1 s to load
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate, CertificateBuilder, GeneralName, KeyUsage

Role = Literal["vehicle", "station"]
ROLES: tuple[Role, ...] = ("vehicle", "station")

LOCAL_NAMES = ("localhost", "127.0.0.1")
YEARS = 10


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
        authority, certificate = _load(files.authority), _load(path)
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
    held = _names_of(certificate)
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
            held = _names_of(_load(files.certificate(role)))
            if wanted <= held:
                continue
            wanted |= held
        _make_certificate(files, role, sorted(wanted))


def _make_authority(files: TlsFiles) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    builder = _builder("quadlab private authority", "quadlab private authority", key)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(_key_usage(signs_certificates=True), critical=True)
    _write(files.authority_key, _pem_of_key(key))
    _write(files.authority, _signed(builder, key))


def _make_certificate(files: TlsFiles, role: Role, names: Sequence[str]) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
    from cryptography.x509.oid import ExtendedKeyUsageOID

    authority_key = load_pem_private_key(files.authority_key.read_bytes(), None)
    if not isinstance(authority_key, ec.EllipticCurvePrivateKey):
        raise LinkError(f"{files.authority_key} is not of quadlab; empty {files.folder}")
    key = ec.generate_private_key(ec.SECP256R1())
    builder = _builder(f"quadlab {role}", "quadlab private authority", key)
    extended = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    builder = (
        builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_key_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(extended), critical=False)
        .add_extension(x509.SubjectAlternativeName(map(_general_name, names)), critical=False)
    )
    _write(files.key(role), _pem_of_key(key))
    _write(files.certificate(role), _signed(builder, authority_key))


def _builder(subject: str, issuer: str, key: EllipticCurvePrivateKey) -> CertificateBuilder:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, subject)]))
        .issuer_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, issuer)]))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        # A robot's clock may be behind the base's, by years when it has no battery.
        .not_valid_before(datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC))
        .not_valid_after(now + datetime.timedelta(days=365 * YEARS))
    )


def _key_usage(*, signs_certificates: bool) -> KeyUsage:
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _general_name(name: str) -> GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _names_of(certificate: Certificate) -> set[str]:
    from cryptography import x509

    try:
        extension = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return set()
    return {str(name.value) for name in extension.value}


def _load(path: Path) -> Certificate:
    from cryptography import x509

    return x509.load_pem_x509_certificate(path.read_bytes())


def _signed(builder: CertificateBuilder, key: EllipticCurvePrivateKey) -> bytes:
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.serialization import Encoding

    return builder.sign(key, SHA256()).public_bytes(Encoding.PEM)


def _pem_of_key(key: EllipticCurvePrivateKey) -> bytes:
    from cryptography.hazmat.primitives import serialization

    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


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
