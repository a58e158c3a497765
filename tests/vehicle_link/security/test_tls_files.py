"""Messages about certificates that cannot be used, and keys that others may read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization

from quadrotor.errors import LinkError
from vehicle_link.security.authority import (
    TlsFiles,
    check_certificate,
    ensure_certificates,
    readable_keys,
)
from vehicle_link.security.enrolment import issue_station, issue_vehicle
from vehicle_link.security.page_authority import ensure_web_certificate

FROM_A_BASE = "copy vehicle.pem and vehicle.key again from the base that issued ca.pem"
HAVE_MADE = "copy vehicle.pem and vehicle.key again from the base, or delete them to have them made"
FROM_ANOTHER = "copy it back from a machine that has it"


@pytest.fixture
def tls(tmp_path: Path) -> TlsFiles:
    return ensure_certificates(tmp_path / "tls")


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _damaged(path: Path) -> None:
    text = path.read_bytes()
    path.write_bytes(text[:60] + text[90:])


def _locked(path: Path) -> None:
    key = serialization.load_pem_private_key(path.read_bytes(), None)
    path.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"secret"),
        )
    )


@pytest.mark.parametrize(
    ("name", "spoil", "said"),
    [
        ("vehicle.pem", Path.unlink, f"is missing; {HAVE_MADE}"),
        ("vehicle.pem", lambda path: path.write_bytes(b""), f"is empty; {HAVE_MADE}"),
        (
            "vehicle.pem",
            lambda path: path.write_bytes(b"no certificate"),
            f"holds no certificate (PEM, which begins with -----BEGIN); {HAVE_MADE}",
        ),
        ("vehicle.pem", _damaged, f"holds a damaged certificate; {HAVE_MADE}"),
        (
            "vehicle.pem",
            lambda path: path.write_bytes(path.with_suffix(".key").read_bytes()),
            f"holds no certificate but a private key; {HAVE_MADE}",
        ),
        ("vehicle.key", Path.unlink, f"is missing; {HAVE_MADE}"),
        ("vehicle.key", lambda path: path.write_bytes(b"\n"), f"is empty; {HAVE_MADE}"),
        ("vehicle.key", _folder, f"is a folder, a file is needed; {HAVE_MADE}"),
        ("vehicle.key", _damaged, f"holds a damaged private key; {HAVE_MADE}"),
        ("vehicle.key", _locked, f"is encrypted; {HAVE_MADE}"),
        (
            "vehicle.key",
            lambda path: path.write_bytes(path.with_suffix(".pem").read_bytes()),
            f"holds no private key but a certificate; {HAVE_MADE}",
        ),
        ("ca.pem", Path.unlink, f"is missing; {FROM_ANOTHER}"),
        ("ca.pem", lambda path: path.write_bytes(b"x"), "holds no certificate (PEM"),
        ("ca.pem", _damaged, f"holds a damaged certificate; {FROM_ANOTHER}"),
    ],
)
def test_the_one_file_is_named_with_what_is_wrong_and_what_to_do(
    tls: TlsFiles, name: str, spoil: Callable[[Path], object], said: str
) -> None:
    path = tls.folder / name
    spoil(path)
    with pytest.raises(LinkError) as caught:
        check_certificate(tls, "vehicle")
    line = str(caught.value)
    assert line.startswith(f"{path} {said}")
    assert "\n" not in line
    assert "://" not in line


def test_a_start_says_the_same_and_changes_nothing(tls: TlsFiles) -> None:
    for name in ("vehicle.pem", "vehicle.key", "station.pem", "ca.pem"):
        path = tls.folder / name
        whole = path.read_bytes()
        path.write_bytes(b"garbled")
        before = {one: one.read_bytes() for one in tls.present()}
        with pytest.raises(LinkError, match=rf"^{path} holds no (certificate|private key) \(PEM"):
            ensure_certificates(tls.folder)
        assert {one: one.read_bytes() for one in tls.present()} == before
        path.write_bytes(whole)
    ensure_certificates(tls.folder)


def test_a_copy_is_not_told_to_have_its_certificate_made(tmp_path: Path) -> None:
    copy = issue_vehicle(tmp_path / "base", tmp_path / "vehicle", "quad1", [])
    copy.key("vehicle").unlink()
    with pytest.raises(LinkError, match=rf"vehicle\.key is missing; {FROM_A_BASE}, or delete both"):
        check_certificate(copy, "vehicle")
    station = issue_station(tmp_path / "base", tmp_path / "ben", "ben", "pilot")
    station.certificate("station").write_bytes(b"x")
    with pytest.raises(LinkError, match=r"again from the base that issued ca\.pem$"):
        check_certificate(station, "station")


def test_a_file_of_another_user_is_told_with_how_to_get_it(
    tls: TlsFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refused)
    with pytest.raises(LinkError, match=r"ca\.pem may not be read by this user; .*`chown \d+ /"):
        check_certificate(tls, "vehicle")


def test_a_damaged_key_of_the_authority_stops_only_what_needs_it(
    tls: TlsFiles, tmp_path: Path
) -> None:
    tls.authority_key.write_bytes(b"garbled")
    ensure_certificates(tls.folder)
    attempts: list[Callable[[], object]] = [
        lambda: ensure_certificates(tls.folder, ["new.local"]),
        lambda: issue_vehicle(tls.folder, tmp_path / "out", "quad1", []),
    ]
    for making in attempts:
        with pytest.raises(LinkError, match=r"ca\.key holds no private key .*; copy it back from"):
            making()
    assert not (tmp_path / "out").exists()


def test_a_damaged_certificate_of_the_page_is_named(tls: TlsFiles) -> None:
    path = ensure_web_certificate(tls.folder, []).certificate("web")
    path.write_bytes(b"garbled")
    with pytest.raises(LinkError, match=r"web\.pem holds no certificate .* delete them to have"):
        ensure_web_certificate(tls.folder, [])


def test_keys_that_others_may_use_are_told_with_mode_and_remedy(tmp_path: Path) -> None:
    tls = ensure_certificates(tmp_path / "my tls")
    assert readable_keys(tls) == []
    tls.key("vehicle").chmod(0o644)
    tls.authority_key.chmod(0o660)
    tls.authority.chmod(0o644)  # no secret
    folder = tls.folder
    assert readable_keys(tls) == [
        f"{folder}/ca.key is a secret and has mode 0660, so that others may use it; "
        f"`chmod 600 '{folder}/ca.key'`",
        f"{folder}/vehicle.key is a secret and has mode 0644, so that others may use it; "
        f"`chmod 600 '{folder}/vehicle.key'`",
    ]
    ensure_certificates(folder)
    check_certificate(tls, "vehicle")  # reported, not refused
