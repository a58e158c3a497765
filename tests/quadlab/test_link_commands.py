"""`quadlab link`: enrol, issue, list, and the verdict on a link."""

from __future__ import annotations

import ipaddress
import socket
import tarfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from console.link.known_vehicles import KnownVehicles
from quadlab.__main__ import main
from quadrotor.errors import StorageError, UsageError
from tests.waiting import free_port
from vehicle_link.security.authority import TlsFiles, check_certificate, ensure_certificates
from vehicle_link.security.certificates import load_certificate
from vehicle_link.transport import quic_probe
from vehicle_link.transport.quic_probe import ProbeResult, own_networks, probe, probe_all
from vehicle_link.transport.session import vehicle_session


def _link(data: Path, *words: str) -> int:
    return main(["link", *words, "--data", str(data)])


def test_an_enrolled_vehicle_is_known_and_has_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("enrol", "quad2", "192.168.4.3:7500", "--also", "quad2.local")
    assert _link(tmp_path, *words, "--out", str(tmp_path / "out")) == 0
    said = capsys.readouterr().out
    assert "quadlab vehicle --name quad2 --link-port 7500" in said
    assert f"scp -p {tmp_path}/out/* 192.168.4.3:" in said
    files = TlsFiles(tmp_path / "out")
    for host in ("192.168.4.3", "quad2.local", "localhost"):
        check_certificate(files, "vehicle", host)
    assert KnownVehicles(tmp_path).all()["quad2"].address == "192.168.4.3:7500"
    # The station connects to it without a further command.
    check_certificate(TlsFiles(tmp_path / "certificates"), "vehicle", "192.168.4.3")


def test_an_address_belongs_to_one_vehicle_until_it_is_forgotten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _link(tmp_path, "enrol", "quad2", "10.0.0.2") == 0
    assert _link(tmp_path, "enrol", "quad3", "10.0.0.2:7447") == 2
    assert "is quad2's address; forget that one first" in capsys.readouterr().err
    assert _link(tmp_path, "enrol", "quad2", "10.0.0.5") == 0  # it has moved
    assert _link(tmp_path, "forget", "quad2") == 0
    assert KnownVehicles(tmp_path).all() == {}


def test_an_observers_files_fit_into_a_tar(tmp_path: Path) -> None:
    out = tmp_path / "ben.tar"
    out.write_bytes(b"an older one, which others may read")
    out.chmod(0o644)
    assert _link(tmp_path, "observer", "ben", "--out", str(out)) == 0
    assert out.stat().st_mode & 0o077 == 0
    with tarfile.open(out) as tar:
        assert tar.getnames() == ["ca.pem", "station.key", "station.pem"]
        tar.extractall(tmp_path / "there")
    files = TlsFiles(tmp_path / "there")
    check_certificate(files, "station")
    subject = load_certificate(files.certificate("station")).subject.rfc4514_string()
    assert subject == "OU=ben,CN=quadlab observer"
    assert ensure_certificates(files.folder) == files  # as a station does at its start


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("enrol", "Bad", "10.0.0.2"), "'Bad' is not a valid name"),
        (("enrol", "quad2", "a:b"), "'a:b' is not the address of a vehicle"),
        (("enrol", "quad2"), "Missing from quadlab link enrol: ADDRESS"),
        (("observer", "../ben"), "not a name for a station"),
        (("pilot",), "Missing from quadlab link pilot: NAME"),
        (("list", "quad2"), "Unrecognized options: quad2"),
        (("forget", "quad2"), "no vehicle is called 'quad2'; known are: none"),
        (("frobnicate",), "Available subcommands: enrol"),
    ],
)
def test_a_mistake_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], told: str
) -> None:
    assert _link(tmp_path, *words) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
    assert not (tmp_path / "known_vehicles.toml").exists()


def test_a_file_of_vehicles_that_cannot_be_understood_is_kept_and_told(tmp_path: Path) -> None:
    known = KnownVehicles(tmp_path)
    for text in ("[quad1", "quad1 = 3", "[quad1]\naddres = 'x'", "[quad1]\naddress = 'a:b'"):
        known.path.write_text(text)
        with pytest.raises(StorageError, match="cannot be read"):
            known.add("quad2", "10.0.0.2")
        assert known.path.read_text() == text


def test_known_vehicles_survive_in_their_order(tmp_path: Path) -> None:
    known = KnownVehicles(tmp_path)
    known.add("quad2", "quad2.local")
    known.add("quad1", "[fe80::1]:7000")
    known.add("quad2", "10.0.0.2")
    found = KnownVehicles(tmp_path).all()
    assert {name: one.address for name, one in found.items()} == {
        "quad2": "10.0.0.2",
        "quad1": "[fe80::1]:7000",
    }
    with pytest.raises(UsageError):
        known.add("quad3", "a:b")
    words = ["quad1", "quad3=10.0.0.3", "10.0.0.4"]
    assert known.resolved(words) == ["quad1=[fe80::1]:7000", "quad3=10.0.0.3", "10.0.0.4"]


def test_a_knock_tells_who_is_there(tmp_path: Path) -> None:
    vehicle = free_port(socket.SOCK_DGRAM)
    session: Any = vehicle_session(vehicle, ensure_certificates(tmp_path), "127.0.0.1")
    with closing(session), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mute:
        mute.bind(("127.0.0.1", 0))
        places = [("127.0.0.1", vehicle), ("127.0.0.1", free_port(socket.SOCK_DGRAM))]
        assert list(probe_all(places).values()) == [ProbeResult.ANSWERS, ProbeResult.CLOSED]
        assert probe("127.0.0.1", mute.getsockname()[1], 0.01) is ProbeResult.SILENT
    assert probe("no such.invalid", 7447) is ProbeResult.NAMELESS
    assert set(quic_probe.EXPLANATIONS) == set(ProbeResult)


def test_own_networks_are_the_small_ones_without_a_gateway(tmp_path: Path) -> None:
    routes = tmp_path / "route"
    routes.write_text(
        "Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT\n"
        "wlan0 00000000 0104A8C0 0003 0 0 600 00000000 0 0 0\n"
        "wlan0 0004A8C0 00000000 0001 0 0 600 00FFFFFF 0 0 0\n"
        "eth0 0000000A 00000000 0001 0 0 100 000000FF 0 0 0\n"
    )
    assert own_networks(routes) == [ipaddress.IPv4Network("192.168.4.0/24")]
    assert own_networks(tmp_path / "none") == []


def test_a_base_that_lost_its_authority_says_so_and_keeps_what_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "certificates"
    ensure_certificates(folder).authority.unlink()
    before = {path: path.read_bytes() for path in folder.iterdir()}
    for words in (("enrol", "quad2", "10.0.0.2"), ("observer", "ben")):
        assert _link(tmp_path, *words) == 1
        said = capsys.readouterr().err
        assert said.startswith(f"quadlab: {folder}/ca.pem is missing next to ca.key, vehicle.pem")
        assert said.count("\n") == 1
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert KnownVehicles(tmp_path).all() == {}
