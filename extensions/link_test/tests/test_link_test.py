"""The measurement of a link by a real session, and the verdict on its figures."""

from __future__ import annotations

import math
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.link_test.command import _table
from extensions.link_test.measurement import Figures, measure
from extensions.link_test.verdict import Grade, percentile, verdict
from quadlab.__main__ import main
from quadrotor.errors import LinkError
from quadrotor.records import TICK
from tests.waiting import free_port
from vehicle_link.identity import THE_ONE
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.telemetry import pack
from vehicle_link.topics.control_inputs import decode_heartbeat, encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import vehicle_session
from vehicle_link.transport.time_sync import serve_time_sync
from vehicle_link.transport.whoami import serve_whoami


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
        lambda received: holders.append(decode_heartbeat(received.payload).instance),
    )

    def run() -> None:
        ticks, k = np.zeros(1, TICK), 0
        while not closing.wait(0.01):
            k += 1
            ticks["imu"]["stamp_ns"] = time.time_ns()
            if k % 10:
                telemetry.put(pack(ticks, k))
            beats.put(encode_heartbeat(k, time.time_ns(), 3, holders[-1]))

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

    monkeypatch.setattr("extensions.link_test.measurement.unpack", refused)
    monkeypatch.setattr(
        "extensions.link_test.measurement.disagreement", lambda *_: "another protocol"
    )
    found = measure(f"127.0.0.1:{vehicle}", tls, 1.0)
    assert (found.packets, math.isnan(found.loss), math.isnan(found.jitter)) == (0, True, True)
    hidden = "note: telemetry loss, jitter and throughput not measured: the vehicle speaks another"
    assert hidden in "\n".join(verdict(found)[1])
    assert "could not be handled" not in caplog.text


def test_no_link_is_told_with_its_cause(
    vehicle: int, tls: TlsFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("extensions.link_test.measurement.CONNECT", 0.3)
    with pytest.raises(LinkError, match=r"within 0\.3 s: the machine is there, but no"):
        measure(f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}", tls, 1.0)
    with pytest.raises(
        LinkError, match=r"does not accept the other's certificate.*quadlab link.*too busy"
    ):
        measure(f"127.0.0.1:{vehicle}", ensure_certificates(tmp_path), 1.0)
    with pytest.raises(LinkError, match="no vehicle called quad6 says who it is"):
        measure(f"127.0.0.1:{vehicle}", tls, 1.0, name="quad6")


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


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("a:b",), "'a:b' is not the address of a vehicle"),
        (("--seconds", "0"), "allowed are 2 to 600"),
        (("--name", "Bad"), "'Bad' is not a valid name"),
    ],
)
def test_a_mistake_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], told: str
) -> None:
    assert main(["link", "test", *words, "--data", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1


def test_a_base_that_lost_its_authority_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "certificates"
    ensure_certificates(folder).authority.unlink()
    assert main(["link", "test", "--data", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"quadlab: {folder}/ca.pem is missing next to ca.key, vehicle.pem")
    assert said.count("\n") == 1


def test_percentiles_are_of_values_that_were_seen() -> None:
    assert percentile([3.0, 1.0, 2.0], 50) == 2.0
    assert percentile([3.0, 1.0, 2.0], 99) == 3.0
    assert math.isnan(percentile([], 50))
