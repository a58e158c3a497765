"""`quadlab link`: enrol, issue, list, and the verdict on a link."""

from __future__ import annotations

import ipaddress
import math
import socket
import tarfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.link.known_vehicles import KnownVehicles
from quadlab.__main__ import main
from quadlab.link_commands.test import _table
from quadlab.link_commands.verdict import Grade, percentile, verdict
from quadrotor.errors import LinkError, StorageError, UsageError
from quadrotor.records import TICK
from tests.waiting import free_port
from vehicle_link import topics
from vehicle_link.security.authority import TlsFiles, check_certificate, ensure_certificates
from vehicle_link.security.certificates import load_certificate
from vehicle_link.serial.ids import THE_ONE
from vehicle_link.telemetry import pack
from vehicle_link.topics import TOPICS
from vehicle_link.transport import quic_probe
from vehicle_link.transport.link_measurement import Figures, measure
from vehicle_link.transport.node import Node
from vehicle_link.transport.quic_probe import ProbeResult, own_networks, probe, probe_all
from vehicle_link.transport.session import vehicle_session
from vehicle_link.transport.time_sync import serve_time_sync
from vehicle_link.transport.whoami import serve_whoami


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
        (("test", "a:b"), "'a:b' is not the address of a vehicle"),
        (("test", "--seconds", "0"), "allowed are 2 to 600"),
        (("test", "--name", "Bad"), "'Bad' is not a valid name"),
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


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory) -> TlsFiles:
    return ensure_certificates(tmp_path_factory.mktemp("tls"))


@pytest.fixture(scope="module")
def vehicle(tls: TlsFiles) -> Iterator[int]:
    """Yield the port of a vehicle that sends telemetry, of which every tenth packet is missing."""
    port, closing = free_port(socket.SOCK_DGRAM), threading.Event()
    session: Any = vehicle_session(port, tls, "127.0.0.1")
    node = Node(session, "/quad5", "vehicle")
    serve_time_sync(node, lambda: time.time_ns() + 3_600_000_000_000)  # an hour ahead
    serve_whoami(node, "quad5", 3, THE_ONE)
    telemetry = node.advertise(TOPICS["telemetry"])
    beats = node.advertise(TOPICS["vehicle_heartbeat"])
    holders: list[int] = [0]
    node.subscribe(
        "station_heartbeat",
        TOPICS["station_heartbeat"].type_name,
        lambda received: holders.append(topics.decode_heartbeat(received.payload).instance),
    )

    def run() -> None:
        ticks, k = np.zeros(1, TICK), 0
        while not closing.wait(0.01):
            k += 1
            ticks["imu"]["stamp_ns"] = time.time_ns()
            if k % 10:
                telemetry.put(pack(ticks, k))
            beats.put(topics.encode_heartbeat(k, time.time_ns(), 3, holders[-1]))

    thread = threading.Thread(target=run)
    thread.start()
    yield port
    closing.set()
    thread.join()
    session.close()


def test_a_link_is_measured_with_the_name_the_vehicle_gives_itself(
    vehicle: int, tls: TlsFiles
) -> None:
    found = measure(f"127.0.0.1:{vehicle}", tls, 1.0)
    assert (found.vehicle, found.access, found.disagreement) == ("quad5", "pilot", "")
    assert found.round_trips
    assert found.clock_offset == pytest.approx(3600.0, abs=0.1)
    assert 0.05 < found.loss < 0.15
    assert math.isnan(found.throughput)  # it serves no parameters
    assert not found.held_by_another


def test_packets_of_another_protocol_are_not_measured_and_spill_no_traceback(
    vehicle: int, tls: TlsFiles, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refused(payload: bytes) -> None:
        raise LinkError(f"{len(payload)} bytes are too few for a telemetry packet")

    monkeypatch.setattr("vehicle_link.transport.link_measurement.unpack", refused)
    monkeypatch.setattr(
        "vehicle_link.transport.link_measurement.disagreement", lambda *_: "another protocol"
    )
    found = measure(f"127.0.0.1:{vehicle}", tls, 1.0)
    assert (found.packets, math.isnan(found.loss), math.isnan(found.jitter)) == (0, True, True)
    hidden = "note: telemetry loss, jitter and throughput not measured: the vehicle speaks another"
    assert hidden in "\n".join(verdict(found)[1])
    assert "could not be handled" not in caplog.text


def test_no_link_is_told_with_its_cause(
    vehicle: int, tls: TlsFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vehicle_link.transport.link_measurement.CONNECT", 0.3)
    with pytest.raises(LinkError, match=r"within 0\.3 s: the machine is there, but no"):
        measure(f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}", tls, 1.0)
    with pytest.raises(
        LinkError, match=r"does not accept the other's certificate.*quadlab link.*too busy"
    ):
        measure(f"127.0.0.1:{vehicle}", ensure_certificates(tmp_path), 1.0)
    with pytest.raises(LinkError, match="no vehicle called quad6 says who it is"):
        measure(f"127.0.0.1:{vehicle}", tls, 1.0, name="quad6")


def test_a_knock_tells_who_is_there(vehicle: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mute:
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


def _figures(**changed: Any) -> Figures:
    values = {
        "round_trips": [0.01] * 99,
        "clock_offset": 0.0,
        "packets": 500,
        "rate": 100.0,
        "loss": 0.0,
        "jitter": 0.001,
        "throughput": 9e6,
        "vehicle": "quad1",
        "access": "pilot",
    }
    return Figures("10.0.0.2:7447", **{**values, **changed})


@pytest.mark.parametrize(
    ("changed", "grade", "told"),
    [
        ({}, "good", ""),
        ({"round_trips": [0.01] * 90 + [0.1] * 9}, "usable", "round trip p99 100 ms"),
        ({"round_trips": [0.3] * 99}, "bad", "power saving"),
        ({"round_trips": [], "unanswered": 9}, "bad", "requests not answered 100 %"),
        ({"unanswered": 1}, "usable", "requests not answered 1 %"),
        ({"loss": 0.1}, "usable", "telemetry lost 10 %, good is up to 2 %"),
        ({"loss": 0.3}, "bad", "telemetry lost"),
        ({"loss": math.nan}, "bad", "telemetry loss not measured: no packet of telemetry received"),
        ({"jitter": math.nan, "packets": 1}, "bad", "jitter not measured: one packet of"),
        ({"round_trips": [], "unanswered": 9}, "bad", "round trip not measured: no request was"),
        ({"jitter": 0.02}, "usable", "jitter 20 ms"),
        ({"throughput": 0.5e6}, "usable", "throughput 0.5 Mbit/s"),
        ({"throughput": 0.1e6}, "bad", "throughput 0.1 Mbit/s"),
        ({"throughput": math.nan, "armed": True}, "good", "the vehicle is armed"),
        ({"disagreement": "another protocol"}, "bad", "another protocol"),
        ({"clock_offset": -3600.0}, "good", "the clocks differ by 3600 s"),
        ({"access": "observer"}, "good", "lets us observe"),
        ({"held_by_another": True}, "good", "another station is connected to the vehicle"),
        ({"packets": 20, "rate": 5.0}, "good", "20 packets of telemetry only"),
    ],
)
def test_the_verdict_names_its_reasons(changed: dict[str, Any], grade: Grade, told: str) -> None:
    found, lines = verdict(_figures(**changed))
    assert found == grade
    assert told in " ".join(lines)
    assert bool(lines) == bool(changed)


def test_of_what_another_protocol_hides_the_radio_is_not_blamed() -> None:
    nothing = {
        "round_trips": [],
        "unanswered": 40,
        "loss": math.nan,
        "jitter": math.nan,
        "packets": 0,
        "rate": 0.0,
        "throughput": math.nan,
        "clock_offset": math.nan,
    }
    figures = _figures(disagreement="another protocol", **nothing)
    assert verdict(figures) == (
        "bad",
        [
            "bad: another protocol",
            "note: round trip, telemetry loss, jitter and throughput not measured: the vehicle "
            "speaks another protocol",
        ],
    )
    assert _table(figures)[1:] == [
        "  round trip   p50 not measured, p99 not measured, 40 of 40 not answered",
        "  telemetry    not measured, 0 packets, 0 Hz",
        "  jitter       not measured",
        "  throughput   not measured, in the background",
        "  clock        not measured",
    ]
    heard = _figures(disagreement="another protocol", jitter=0.02, throughput=math.nan)
    assert [line.split(",")[0] for line in verdict(heard)[1]] == [
        "bad: another protocol",
        "usable: jitter 20 ms",
        "note: throughput not measured: the vehicle speaks another protocol",
    ]


def test_what_was_measured_stands_in_the_table_with_its_unit() -> None:
    assert _table(_figures(loss=0.1, clock_offset=-0.002))[1:] == [
        "  round trip   p50 10 ms, p99 10 ms, 0 of 99 not answered",
        "  telemetry    lost 10 % of 500 packets, 100 Hz",
        "  jitter       1 ms",
        "  throughput   at least 9 Mbit/s, in the background",
        "  clock        vehicle 2.0 ms behind",
    ]


def test_a_base_that_lost_its_authority_says_so_and_keeps_what_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "certificates"
    ensure_certificates(folder).authority.unlink()
    before = {path: path.read_bytes() for path in folder.iterdir()}
    for words in (("enrol", "quad2", "10.0.0.2"), ("observer", "ben"), ("test",)):
        assert _link(tmp_path, *words) == 1
        said = capsys.readouterr().err
        assert said.startswith(f"quadlab: {folder}/ca.pem is missing next to ca.key, vehicle.pem")
        assert said.count("\n") == 1
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert KnownVehicles(tmp_path).all() == {}


def test_percentiles_are_of_values_that_were_seen() -> None:
    assert percentile([3.0, 1.0, 2.0], 50) == 2.0
    assert percentile([3.0, 1.0, 2.0], 99) == 3.0
    assert math.isnan(percentile([], 50))
