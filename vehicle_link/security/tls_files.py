"""The files of a folder of certificates: their paths, why one cannot be used, the protection of the
secret ones, and whether the folder can issue further certificates.
"""

from __future__ import annotations

import fcntl
import os
import shlex
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from quadrotor.errors import LinkError
from vehicle_link.security.certificates import load_certificate

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
    from cryptography.x509 import Certificate

Role = Literal["vehicle", "station", "web"]
ROLES: tuple[Role, ...] = ("vehicle", "station")
"""Roles at the two ends of the link; each end presents a certificate."""


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """The files of one authority, all in one folder."""

    folder: Path
    is_page: bool = False
    """True for the page's files, in whose folder everything can be made again."""

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

    def present(self) -> list[Path]:
        """Return the files that exist, the authority's first."""
        files = [self.authority, self.authority_key]
        for role in (*ROLES, "web"):
            files += [self.certificate(role), self.key(role)]
        return [path for path in files if is_there(path)]


def page_files(folder: Path) -> TlsFiles:
    """Return the files of the page's authority, in a folder of their own beside the link's."""
    return TlsFiles(folder / "page", is_page=True)


def is_there(path: Path) -> bool:
    """Return whether the path exists, even as a link without a target, for instance on a disk that
    is not mounted.
    """
    return os.path.lexists(path)


def readable_keys(files: TlsFiles) -> list[str]:
    """Return a line for each secret key that users other than its owner may read or change; for the
    start of a process.
    """
    lines = []
    for path in (*files.present(), *page_files(files.folder).present()):
        try:
            mode = stat.S_IMODE(path.stat().st_mode)
        except OSError:  # reported where the file is needed
            continue
        if path.suffix == ".key" and mode & 0o077:
            lines.append(
                f"{path} is a secret and has mode {mode:04o}, so that others may use it; "
                f"`chmod 600 {shlex.quote(str(path))}`"
            )
    return lines


def read_certificate(path: Path, remedy: str) -> Certificate:
    """Read a certificate. Raises LinkError that names the file, what is wrong with it, and
    `remedy`.
    """
    from cryptography.exceptions import UnsupportedAlgorithm

    text = _content(path, remedy)
    try:
        certificate = load_certificate(path)
        certificate.public_key()  # it is parsed only here, and may be damaged
    except (ValueError, UnsupportedAlgorithm):
        raise LinkError(f"{path} {_no('certificate', text)}; {remedy}") from None
    return certificate


def read_key(path: Path, remedy: str) -> PrivateKeyTypes:
    """Read a private key. Raises LinkError that names the file, what is wrong with it, and
    `remedy`.
    """
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    text = _content(path, remedy)
    try:
        return load_pem_private_key(text, None)
    except TypeError:
        raise LinkError(f"{path} is encrypted; {remedy}") from None
    except (ValueError, UnsupportedAlgorithm):
        raise LinkError(f"{path} {_no('private key', text)}; {remedy}") from None


def write_secret(path: Path, data: bytes) -> None:
    """Write all or nothing, and never readable by others, not even for a moment."""
    part = path.with_name(f".{path.name}.part")
    part.unlink(missing_ok=True)
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())  # a robot may lose power right after
    part.replace(path)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a lock for one process at a time; the kernel releases it, even after a crash."""
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _content(path: Path, remedy: str) -> bytes:
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        raise LinkError(f"{path} is missing; {remedy}") from None
    except IsADirectoryError:
        raise LinkError(f"{path} is a folder, a file is needed; {remedy}") from None
    except PermissionError:
        raise LinkError(
            f"{path} may not be read by this user; start as its owner, or as root "
            f"`chown {os.getuid()} {shlex.quote(str(path))}`"
        ) from None
    except OSError as error:
        raise LinkError(f"{path} cannot be read ({error.strerror}); {remedy}") from None
    if not text.strip():
        raise LinkError(f"{path} is empty; {remedy}")
    return text


def _no(kind: str, text: bytes) -> str:
    """Return what a file holds instead of a certificate or private key."""
    if f"{kind.upper()}-----".encode() in text:
        return f"holds a damaged {kind}"
    if b"PRIVATE KEY-----" in text or b"CERTIFICATE-----" in text:
        return f"holds no {kind} but a {'private key' if b'KEY-----' in text else 'certificate'}"
    return f"holds no {kind} (PEM, which begins with -----BEGIN)"


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

    remedy = _remedy_of_page(files) or (
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


def _remedy_of_page(files: TlsFiles) -> str:
    """Return the remedy for any of the page's files, "" for the link's."""
    if not files.is_page:
        return ""
    return f"delete {files.folder} to have it made again, and trust its new ca.pem in each browser"


def remedy_of_authority(files: TlsFiles) -> str:
    return _remedy_of_page(files) or (
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
