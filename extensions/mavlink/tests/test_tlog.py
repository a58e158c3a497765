"""Telemetry logs: recognised, read by message, put in order, one start of the vehicle at a time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.mavlink.dialect import mavlink
from extensions.mavlink.tlog import TlogTables
from quadlab.__main__ import main

ARRIVAL_US = 1_700_000_000_000_000
BOOT_MS = 5000


def record(message: Any, arrival_us: int, *, system: int = 1, old: bool = False) -> bytes:
    sender: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
    packet = message.pack(sender, force_mavlink1=old)
    return arrival_us.to_bytes(8, "big") + bytes(packet)


def messages(k: int, start_ms: int = BOOT_MS) -> list[Any]:
    """Return what a vehicle at rest, rolled by 30 deg, sends every 20 ms."""
    ms = (start_ms + 20 * k) % 2**32
    force = [0, round(-1000 * math.sin(math.pi / 6)), round(-1000 * math.cos(math.pi / 6))]
    return [
        mavlink.MAVLink_scaled_imu_message(ms, *force, 5 + k % 2, -7, k % 3, 0, 0, 0),
        mavlink.MAVLink_attitude_message(ms, math.pi / 6, 0.0, 0.1, 0.0, 0.0, 0.0),
        mavlink.MAVLink_local_position_ned_message(ms, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0),
    ]


def flight(count: int = 200, *, start_ms: int = BOOT_MS, old: bool = False) -> list[bytes]:
    return [
        record(one, ARRIVAL_US + 1000 * (start_ms + 20 * k - BOOT_MS) + 137, old=old)
        for k in range(count)
        for one in messages(k, start_ms)
    ]


def opened(folder: Path, data: bytes, *tables: str) -> TlogTables:
    path = folder / "flight.tlog"
    path.write_bytes(data)
    return TlogTables(path, tables or ("IMU", "ATTITUDE", "LOCAL_POSITION_NED"))


@pytest.mark.parametrize("old", [False, True])
def test_a_log_is_imported(tmp_path: Path, old: bool, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "without ending"
    path.write_bytes(b"".join(flight(old=old)))
    assert main(["log", "import", str(path), "--data", str(tmp_path / "lab")]) == 0
    told = capsys.readouterr().out
    assert "(tlog, mapping mavlink): 4.0 s, 200 IMU samples" in told
    [run] = (tmp_path / "lab" / "runs").glob("*_mavlink")
    assert run.name.startswith("20231114T2213")


def test_numbers_are_those_of_the_messages(tmp_path: Path) -> None:
    tables = opened(tmp_path, b"".join(flight(3)))
    assert (tables.torn, tables.notes) == ("", [])
    assert tables.epoch_ns == (ARRIVAL_US + 137) * 1000 - BOOT_MS * 10**6
    g = 9.80665e-3
    assert np.allclose(
        tables.read("IMU", tables.columns("IMU")),
        [
            [
                1000.0 * (5000 + 20 * k),
                0,
                -500 * g,
                -866 * g,
                *(1e-3 * np.array([5 + k % 2, -7, k])),
            ]
            for k in range(3)
        ],
    )
    assert tables.read("ATTITUDE", ["roll", "logged"])[1].tolist() == pytest.approx(
        [math.pi / 6, 1e-6 * (ARRIVAL_US + 20_137)]
    )


def test_the_best_imu_that_was_sent_is_taken(tmp_path: Path) -> None:
    fine = mavlink.MAVLink_highres_imu_message(
        7_000_000, 0.1, 0.2, -9.8, 0.01, 0.02, 0.03, *[0.0] * 7, 0, 0
    )
    other = mavlink.MAVLink_highres_imu_message(7_000_000, *[1.0] * 6, *[0.0] * 7, 0, 2)
    raw = mavlink.MAVLink_raw_imu_message(6_000_000, 0, 0, -1000, 1, 2, 3, 0, 0, 0)
    data = b"".join(record(one, ARRIVAL_US) for one in (raw, fine, other))
    tables = opened(tmp_path, data)
    assert np.allclose(
        tables.read("IMU", tables.columns("IMU")), [[7e6, 0.1, 0.2, -9.8, 0.01, 0.02, 0.03]]
    )
    assert tables.read("HIGHRES_IMU#2", ["xacc"]).tolist() == [[1.0]]
    only = opened(tmp_path, record(raw, ARRIVAL_US))
    assert np.allclose(
        only.read("IMU", only.columns("IMU")), [[6e6, 0, 0, -9.80665, 1e-3, 2e-3, 3e-3]]
    )


def test_messages_that_overtook_others_are_put_in_order(tmp_path: Path) -> None:
    parts = flight(10)
    parts[3:3] = [parts.pop(9)]
    tables = opened(tmp_path, b"".join(parts))
    assert (np.diff(tables.read("IMU", ["time_usec"])[:, 0]) == 20_000).all()
    assert any("arrived after later ones" in note for note in tables.notes)


def test_a_restart_of_the_vehicle_begins_new_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(flight(120, start_ms=60_000) + flight(90, start_ms=1000)))
    command = ["log", "import", str(path), "--data", str(tmp_path / "lab")]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "120 IMU samples" in told
    assert "was started 2 times" in told
    assert main([*command, "--table", "IMU@2"]) == 0
    told = capsys.readouterr().out
    assert "90 IMU samples" in told
    assert "no estimate" not in told


def test_a_clock_of_32_bits_that_wraps_is_no_restart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = flight(200, start_ms=2**32 - 2000)
    parts[299], parts[300] = parts[300], parts[299]  # one message overtakes another at the wrap
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(parts))
    tables = TlogTables(path, ("IMU", "ATTITUDE"))
    assert tables.flights == []
    assert not any("was started" in note for note in tables.notes)
    assert tables.read("IMU", ["time_usec"])[[0, -1], 0].tolist() == [
        1000.0 * (2**32 - 2000),
        1000.0 * (2**32 + 1980),
    ]
    assert (np.diff(tables.read("ATTITUDE", ["time_boot_ms"])[:, 0]) == 20.0).all()
    assert main(["log", "import", str(path), "--data", str(tmp_path / "lab")]) == 0
    assert "4.0 s, 200 IMU samples" in capsys.readouterr().out


@pytest.mark.parametrize("before_wrap_ms", [2000, -5000])
def test_a_clock_that_wraps_beside_one_that_does_not_is_no_restart(
    tmp_path: Path, before_wrap_ms: int
) -> None:
    data = b""
    for k in range(200):
        ms = 2**32 // 1000 - before_wrap_ms + 20 * k
        raw = mavlink.MAVLink_raw_imu_message(
            ms * 1000 % 2**32, 0, 0, -1000, 1, 2, 3, 0, 0, 0
        )  # of an ArduPilot before 2015
        pose = mavlink.MAVLink_attitude_message(ms, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
        data += record(raw, ARRIVAL_US + 20_000 * k) + record(pose, ARRIVAL_US + 20_000 * k)
    tables = opened(tmp_path, data)
    assert tables.flights == []
    assert (np.diff(tables.read("IMU", ["time_usec"])[:, 0]) == 20_000).all()
    assert len(tables.read("ATTITUDE", ["roll"])) == 200


def test_a_telemetry_of_four_hertz_is_not_taken_for_another_unit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = [flight(1, start_ms=BOOT_MS + 250 * k) for k in range(200)]
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(one for part in parts for one in part))
    assert main(["log", "import", str(path), "--data", str(tmp_path / "lab")]) == 0
    assert "200 IMU samples" in capsys.readouterr().out


def test_other_vehicles_and_unknown_messages_are_kept_apart(tmp_path: Path) -> None:
    [_, attitude, _] = messages(1)
    unknown = bytearray(record(attitude, ARRIVAL_US))
    unknown[8 + 7 : 8 + 10] = (54321).to_bytes(3, "little")
    data = flight(3)
    data[3:3] = [record(attitude, ARRIVAL_US, system=7), bytes(unknown)]
    tables = opened(tmp_path, b"".join(data), "ATTITUDE", "7/ATTITUDE")
    assert len(tables.read("ATTITUDE", ["roll"])) == 3
    assert len(tables.read("7/ATTITUDE", ["roll"])) == 1
    assert tables.notes == []


@pytest.mark.parametrize("place", [4, 12, 30])
def test_damages_are_passed_over_and_counted(tmp_path: Path, place: int) -> None:
    parts = flight(50)
    parts[60] = parts[60][:place] + parts[60][place + 1 :]
    tables = opened(tmp_path, b"".join(parts))
    rows = [len(tables.read(one, ["time_boot_ms"])) for one in ("ATTITUDE", "SCALED_IMU")]
    assert 97 <= sum(rows) <= 99
    assert any("damaged in 1 places" in note for note in tables.notes)


def test_a_wrong_checksum_and_the_end_of_a_torn_log(tmp_path: Path) -> None:
    parts = flight(50)
    parts[60] = parts[60][:25] + bytes([parts[60][25] ^ 1]) + parts[60][26:]
    tables = opened(tmp_path, b"".join(parts)[:-5])
    assert len(tables.read("SCALED_IMU", ["xacc"])) == 49
    assert any("1 packets with a wrong checksum" in note for note in tables.notes)
    assert "within a packet" in tables.torn


def test_a_computer_whose_clock_began_in_1970_is_dated_as_soon_as_it_is_set(tmp_path: Path) -> None:
    whole = flight()
    early = [(20_000 * k).to_bytes(8, "big") + one[8:] for k, one in enumerate(whole)]
    log = opened(tmp_path, b"".join(early))
    assert main(["log", "import", str(log.path), "--data", str(tmp_path / "lab")]) == 0
    assert len(log.read("IMU", ["xacc"])) == 200
    assert log.epoch_ns is None
    log = opened(tmp_path, b"".join(early[:300] + whole[300:]))
    assert len(log.read("IMU", ["xacc"])) == 200
    dated = opened(tmp_path, b"".join(whole)).epoch_ns
    assert log.epoch_ns == dated == (ARRIVAL_US + 137 - 1000 * BOOT_MS) * 1000
