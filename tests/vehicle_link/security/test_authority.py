"""Private authority: files, names, and messages when a certificate does not fit."""

from __future__ import annotations

import datetime
import multiprocessing
import shutil
import stat
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import pytest

from quadrotor.errors import ClockNotSetError, LinkError, StorageError
from vehicle_link.security import authority
from vehicle_link.security.authority import ROLES, TlsFiles, check_certificate, ensure_certificates
from vehicle_link.security.enrolment import issue_station, issue_vehicle
from vehicle_link.security.page_authority import ensure_web_certificate
from vehicle_link.security.tls_files import write_secret


@pytest.fixture
def tls(tmp_path: Path) -> TlsFiles:
    return ensure_certificates(tmp_path / "tls", ["quad1.local", "192.168.4.2"])


def test_certificates_fit_both_roles_and_all_names(tls: TlsFiles) -> None:
    for role in ROLES:
        for host in ("", "localhost", "127.0.0.1", "quad1.local", "192.168.4.2"):
            check_certificate(tls, role, host)


def test_a_clock_from_before_all_certificates_makes_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    future = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=1)
    monkeypatch.setattr(authority, "EARLIEST", future)
    with pytest.raises(ClockNotSetError, match=r"valid from .* on; set the clock"):
        ensure_certificates(tmp_path / "tls")
    assert not (tmp_path / "tls").exists()


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


def _contents(tls: TlsFiles) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in tls.present()}


def _subsets(names: Sequence[str]) -> list[tuple[str, ...]]:
    return [some for k in range(len(names) + 1) for some in combinations(names, k)]


PAIRS = ("station.pem", "station.key", "vehicle.pem", "vehicle.key", "web.pem", "web.key")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a base's folder with every file, those of a page as older versions had them there."""
    folder = tmp_path_factory.mktemp("whole")
    ensure_certificates(folder)
    page = ensure_web_certificate(folder, []).folder
    for name in ("web.pem", "web.key"):
        shutil.move(page / name, folder / name)
    return folder


def _copy(whole: Path, folder: Path, names: Sequence[str]) -> TlsFiles:
    folder.mkdir()
    for name in names:
        shutil.copy2(whole / name, folder / name)
    return TlsFiles(folder)


def test_without_ca_pem_nothing_is_made_beside_what_is_left(whole: Path, tmp_path: Path) -> None:
    left = [some for some in _subsets(("ca.key", *PAIRS)) if some not in ((), ("ca.key",))]
    assert len(left) == 126
    for k, names in enumerate(left):
        tls = _copy(whole, tmp_path / str(k), names)
        before = _contents(tls)
        with pytest.raises(LinkError) as caught:
            ensure_certificates(tls.folder, ["quad1.local"])
        beside = ", ".join(path.name for path in tls.present())
        assert str(caught.value).startswith(f"{tls.authority} is missing next to {beside}; copy it")
        assert f"or move {tls.folder} away to start over, and then enrol" in str(caught.value)
        assert _contents(tls) == before


def test_with_the_authority_whole_a_start_changes_no_file_that_is_there(
    whole: Path, tmp_path: Path
) -> None:
    for k, names in enumerate(_subsets(PAIRS[:4])):
        tls = _copy(whole, tmp_path / str(k), ("ca.pem", "ca.key", *names))
        before = _contents(tls)
        lone = [role for role in ROLES if f"{role}.pem" in names and f"{role}.key" not in names]
        if lone:  # a certificate whose key is missing would have to be overwritten
            with pytest.raises(LinkError, match=rf"{lone[0]}\.key is missing"):
                ensure_certificates(tls.folder)
        else:
            ensure_certificates(tls.folder)
            for role in ROLES:
                check_certificate(tls, role)
        after = _contents(tls)
        assert {name: after[name] for name in before} == before


def test_without_the_authoritys_key_a_folder_is_left_as_it_is(whole: Path, tmp_path: Path) -> None:
    for k, names in enumerate(_subsets(PAIRS[:4])):
        tls = _copy(whole, tmp_path / str(k), ("ca.pem", *names))
        before = _contents(tls)
        ensure_certificates(tls.folder, ["new.local"])
        assert _contents(tls) == before


def test_an_enrolled_vehicle_that_lost_ca_pem_keeps_its_certificate(tmp_path: Path) -> None:
    vehicle = issue_vehicle(tmp_path / "base", tmp_path / "vehicle", "quad1", [])
    ca = vehicle.authority.read_bytes()
    vehicle.authority.unlink()
    with pytest.raises(LinkError, match=r"ca\.pem is missing next to vehicle\.pem, vehicle\.key; "):
        ensure_certificates(vehicle.folder)
    vehicle.authority.write_bytes(ca)
    ensure_certificates(vehicle.folder)
    check_certificate(vehicle, "vehicle")


def test_a_link_that_leads_nowhere_is_no_empty_folder(tls: TlsFiles, tmp_path: Path) -> None:
    """The certificates may be on a disk that is not mounted."""
    linked = TlsFiles(tmp_path / "linked")
    linked.folder.mkdir()
    for path in tls.present():
        (linked.folder / path.name).symlink_to(tmp_path / "unmounted" / path.name)
    with pytest.raises(LinkError, match=r"ca\.pem is missing; copy it back"):
        ensure_certificates(linked.folder)
    assert all(path.is_symlink() for path in linked.present())


def test_a_first_start_that_was_cut_off_anywhere_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class CutOff(BaseException):
        """Kill, raised as an exception that nothing cleans up after."""

    for kept in range(7):
        tls, writes = TlsFiles(tmp_path / str(kept)), iter(range(kept))

        def write(path: Path, data: bytes, writes: Iterator[int] = writes) -> None:
            if next(writes, None) is None:
                raise CutOff
            write_secret(path, data)

        with monkeypatch.context() as patched:
            patched.setattr(authority, "write_secret", write)
            if kept < 6:
                with pytest.raises(CutOff):
                    ensure_certificates(tls.folder, ["quad1.local"])
            else:
                ensure_certificates(tls.folder, ["quad1.local"])
        before = _contents(tls)
        assert len(before) == kept
        ensure_certificates(tls.folder, ["quad1.local"])
        for role in ROLES:
            check_certificate(tls, role, "quad1.local")
        after = _contents(tls)
        assert {name: after[name] for name in before} == before


def test_an_authority_made_of_the_key_alone_is_no_stranger_to_what_it_has_signed(
    tls: TlsFiles, tmp_path: Path
) -> None:
    enrolled = issue_vehicle(tls.folder, tmp_path / "vehicle", "quad1", [])
    for path in tls.present():
        if path != tls.authority_key:
            path.unlink()
    ensure_certificates(tls.folder)
    enrolled.certificate("station").write_bytes(tls.certificate("station").read_bytes())
    enrolled.key("station").write_bytes(tls.key("station").read_bytes())
    check_certificate(enrolled, "station")  # by the previous ca.pem


def test_a_certificate_made_anew_keeps_its_key(tls: TlsFiles) -> None:
    """Two files cannot be replaced at once."""
    before = _contents(tls)
    ensure_certificates(tls.folder, ["quad2.local"])
    after = _contents(tls)
    changed = {name for name in before if after[name] != before[name]}
    assert changed == {"vehicle.pem", "station.pem"}


def test_a_vehicle_that_had_made_its_own_takes_the_files_of_a_base(tmp_path: Path) -> None:
    own = ensure_certificates(tmp_path / "own")
    issued = issue_vehicle(tmp_path / "base", tmp_path / "out", "quad1", ["quad1.local"])
    for path in issued.present():
        shutil.copy2(path, own.folder / path.name)
    before = _contents(own)
    ensure_certificates(own.folder, ["new.local"])  # its ca.key cannot sign for this ca.pem
    assert _contents(own) == before
    check_certificate(own, "vehicle", "quad1.local")
    with pytest.raises(LinkError, match=r"ca\.key does not belong to .*ca\.pem; on the base, copy"):
        issue_vehicle(own.folder, tmp_path / "x", "quad2", [])
    assert not (tmp_path / "x").exists()


def test_nothing_is_issued_into_the_folder_of_an_authority(tls: TlsFiles) -> None:
    before = _contents(tls)
    with pytest.raises(LinkError, match=r"has a ca\.key, .*; choose another with --out"):
        issue_station(tls.folder, tls.folder, "ben", "observer")
    assert _contents(tls) == before


def test_what_was_issued_before_is_issued_anew_with_another_key(
    tls: TlsFiles, tmp_path: Path
) -> None:
    first = _contents(issue_vehicle(tls.folder, tmp_path / "out", "quad1", ["10.0.0.2"]))
    again = issue_vehicle(tls.folder, tmp_path / "out", "quad1", ["10.0.0.3"])
    check_certificate(again, "vehicle", "10.0.0.3")
    assert _contents(again)["vehicle.key"] != first["vehicle.key"]


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
