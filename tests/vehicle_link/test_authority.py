"""The private authority: files, names, and what is said when a certificate does not fit."""

from __future__ import annotations

import multiprocessing
import stat
from pathlib import Path

import pytest

from quadrotor.errors import LinkError, StorageError
from vehicle_link.authority import ROLES, TlsFiles, check_certificate, ensure_certificates


@pytest.fixture
def tls(tmp_path: Path) -> TlsFiles:
    return ensure_certificates(tmp_path / "tls", ["quad1.local", "192.168.4.2"])


def test_certificates_fit_both_roles_and_all_names(tls: TlsFiles) -> None:
    for role in ROLES:
        for host in ("", "localhost", "127.0.0.1", "quad1.local", "192.168.4.2"):
            check_certificate(tls, role, host)


def test_only_the_owner_may_read_the_files(tls: TlsFiles) -> None:
    assert stat.S_IMODE(tls.folder.stat().st_mode) == 0o700
    files = [path for path in tls.folder.iterdir() if path.suffix in (".pem", ".key")]
    assert len(files) == 6
    for path in files:
        assert stat.S_IMODE(path.stat().st_mode) == 0o600, path


def test_a_second_call_changes_nothing(tls: TlsFiles) -> None:
    before = {path: path.read_bytes() for path in tls.folder.iterdir()}
    ensure_certificates(tls.folder, ["quad1.local"])
    assert {path: path.read_bytes() for path in tls.folder.iterdir()} == before


def test_a_new_name_is_added_to_the_old_ones(tls: TlsFiles) -> None:
    authority = tls.authority.read_bytes()
    ensure_certificates(tls.folder, ["quad2.local"])
    check_certificate(tls, "vehicle", "quad2.local")
    check_certificate(tls, "vehicle", "quad1.local")
    assert tls.authority.read_bytes() == authority


def test_a_host_that_is_not_in_the_certificate_is_named(tls: TlsFiles) -> None:
    with pytest.raises(LinkError, match=r"quad1\.local.*not for 10\.0\.0\.9"):
        check_certificate(tls, "vehicle", "10.0.0.9")


def test_a_certificate_of_another_authority_is_refused(tls: TlsFiles, tmp_path: Path) -> None:
    other = ensure_certificates(tmp_path / "other")
    tls.authority.write_bytes(other.authority.read_bytes())
    with pytest.raises(LinkError, match=r"station\.pem was not signed by"):
        check_certificate(tls, "station")


def test_a_certificate_with_another_key_is_refused(tls: TlsFiles) -> None:
    tls.key("station").write_bytes(tls.key("vehicle").read_bytes())
    with pytest.raises(LinkError, match=r"does not belong to .*station\.key"):
        check_certificate(tls, "station")


@pytest.mark.parametrize("content", [None, b"", b"no certificate"])
def test_a_missing_or_broken_file_is_named(tls: TlsFiles, content: bytes | None) -> None:
    tls.certificate("vehicle").unlink()
    if content is not None:
        tls.certificate("vehicle").write_bytes(content)
    with pytest.raises(LinkError, match="cannot read the certificates"):
        check_certificate(tls, "vehicle")


def test_with_the_authority_gone_all_is_made_anew(tls: TlsFiles) -> None:
    tls.authority.unlink()
    tls.authority_key.unlink()
    ensure_certificates(tls.folder)
    for role in ROLES:
        check_certificate(tls, role, "localhost")


def test_a_certificate_that_does_not_fit_is_said_and_never_replaced(
    tls: TlsFiles, tmp_path_factory: pytest.TempPathFactory
) -> None:
    foreign = ensure_certificates(tmp_path_factory.mktemp("foreign"))
    for path in (tls.certificate("vehicle"), tls.key("vehicle")):
        path.write_bytes((foreign.folder / path.name).read_bytes())
    before = tls.certificate("vehicle").read_bytes()
    with pytest.raises(LinkError, match=r"vehicle\.pem was not signed by"):
        ensure_certificates(tls.folder)
    assert tls.certificate("vehicle").read_bytes() == before


def test_a_vehicles_copy_without_the_authoritys_key_is_left_alone(tls: TlsFiles) -> None:
    tls.authority_key.unlink()
    for path in (tls.certificate("station"), tls.key("station")):
        path.unlink()
    ensure_certificates(tls.folder, ["new.local"])
    check_certificate(tls, "vehicle", "quad1.local")
    with pytest.raises(LinkError, match=r"station\.pem"):
        check_certificate(tls, "station")


def test_processes_that_start_together_end_with_one_authority(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    makers = [context.Process(target=ensure_certificates, args=(tmp_path,)) for _ in range(3)]
    for maker in makers:
        maker.start()
    for maker in makers:
        maker.join(30)
        assert maker.exitcode == 0
    for role in ROLES:
        check_certificate(TlsFiles(tmp_path), role)


def test_a_folder_that_cannot_be_written_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="choose another data folder"):
        ensure_certificates(tmp_path / "file" / "tls")
