"""ArduPilot's logs: messages and their instances, damages, and a whole flight."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from extensions.importers.importing import read_flight
from extensions.importers.readers.dataflash import DataFlashTables
from extensions.importers.tests.foreign_flight import FRD, NED, make_flight
from quadrotor.errors import LogFormatError

LETTERS = {
    "c": "h",
    "C": "H",
    "e": "i",
    "E": "I",
    "L": "i",
    "Z": "64s",
    "N": "16s",
    "n": "4s",
    "M": "B",
}
IMU = ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
XKF1 = ("QBccCfffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD")
START_US = 7_000_000
HALF = 130


class Writer:
    """The bytes of a log, a description before the first message of each kind."""

    def __init__(self) -> None:
        self.data = b""
        self._structs: dict[str, tuple[int, struct.Struct]] = {}
        self._add("FMT", 0x80, "BBnNZ")

    def describe(self, name: str, letters: str, fields: str) -> None:
        number = 0x80 + len(self._structs)
        kind = self._add(name, number, letters)
        texts = [one.encode() for one in (name, letters, fields)]
        self.write("FMT", number, kind.size + 3, *texts)

    def write(self, name: str, *values: object) -> None:
        number, kind = self._structs[name]
        self.data += b"\xa3\x95" + bytes([number]) + kind.pack(*values)

    def number(self, name: str) -> int:
        return self._structs[name][0]

    def _add(self, name: str, number: int, letters: str) -> struct.Struct:
        kind = struct.Struct("<" + "".join(LETTERS.get(one, one) for one in letters))
        self._structs[name] = number, kind
        return kind


def flight_of(count: int = 3000) -> Writer:
    """Return a flight at 100 Hz as ArduPilot logs it, with two IMUs."""
    flight, log = make_flight(), Writer()
    log.describe("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    log.describe("IMU", *IMU)
    log.describe("XKF1", *XKF1)
    log.describe("BAT", "QBf", "TimeUS,Inst,Volt")
    log.describe("GPS", "QBIH", "TimeUS,I,GMS,GWk")
    log.describe("MSG", "QZ", "TimeUS,Message")
    log.write("FMTU", 0, log.number("IMU"), b"s#EEEooo", b"F-000000")
    log.write("MSG", START_US, b"ArduCopter V4")
    log.write("GPS", START_US, 0, 100_000_000, 2300)
    frd = Rotation.from_matrix(NED) * flight.rotation * Rotation.from_matrix(FRD)
    angles = np.degrees(frd.as_euler("ZYX"))
    angles[:, 0] %= 360.0
    for k in range(count):
        us = START_US + 10_000 * k
        values = [*(FRD @ flight.rate[k]), *(FRD @ flight.force[k])]
        log.write("IMU", us, 0, *values)
        log.write("IMU", us, 1, *(2.0 * one for one in values))
        yaw, pitch, roll = np.rint(100.0 * angles[k]).astype(int)
        place, speed = NED @ flight.position[k], NED @ flight.velocity[k]
        log.write("XKF1", us, 0, roll, pitch, yaw % 36000, *speed, 0.0, *place)
        if k % 100 == 0:
            log.write("BAT", us, 0, 15.5)
    return log


LOG = flight_of().data


def test_a_flight_is_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "00000001.BIN"
    path.write_bytes(LOG)
    found, flight = read_flight(path), make_flight()
    assert np.allclose(found.imu.angular_velocity_b, flight.rate, atol=1e-6)
    assert np.allclose(found.imu.specific_force_b, flight.force, atol=1e-5)
    assert found.estimate is not None
    assert np.allclose(found.estimate.states["position_w"], flight.position, atol=1e-5)
    along = np.abs((found.estimate.states["quaternion_wb"] * flight.quaternion).sum(axis=1))
    assert (2.0 * np.arccos(np.minimum(along, 1.0)) < np.radians(0.02)).all()
    assert found.battery is not None
    assert (found.battery[1] == 15.5).all()
    weeks = 315_964_800 - 18 + 604_800 * 2300 + 100_000
    assert found.imu.stamps_ns[0] == weeks * 10**9
    assert any(text == "ArduCopter V4" for _, _, text in found.events)


def test_messages_before_their_description_are_read(tmp_path: Path) -> None:
    place = LOG.rfind(b"\xa3\x95\x80", 0, LOG.index(b"IMU\0"))
    described = LOG[place : place + 89]
    path = tmp_path / "late.bin"
    path.write_bytes(LOG[:place] + LOG[place + 89 :] + described)
    whole = tmp_path / "whole.bin"
    whole.write_bytes(LOG)
    late, found = (DataFlashTables(one, ["IMU"]) for one in (path, whole))
    assert not late.notes
    names = found.columns("IMU")
    assert (late.read("IMU", names) == found.read("IMU", names)).all()


def test_instances_are_tables_and_scaled_letters_are_scaled(tmp_path: Path) -> None:
    log = flight_of(60)
    log.describe("POS", "QLeEnM", "TimeUS,Lat,Alt,Low,Id,Mode")
    log.write("POS", 1, -473_977_123, -12_345, 12_345, b"abcd", 5)
    path = tmp_path / "flight.bin"
    path.write_bytes(log.data)
    tables = DataFlashTables(path, {"IMU", "IMU#1", "POS"})
    assert {"IMU", "IMU#1", "POS", "XKF1", "BAT"} <= set(tables.tables())
    one, two = (tables.read(name, ["TimeUS", "I", "AccZ"]) for name in ("IMU", "IMU#1"))
    assert len(one) == len(two) == 60
    assert (two == one * [1, 1, 2] + [0, 1, 0]).all()
    assert tables.columns("POS") == ["TimeUS", "Lat", "Alt", "Low", "Mode"]
    assert tables.read("POS", tables.columns("POS")).tolist() == [
        [1.0, -47.3977123, -123.45, 123.45, 5.0]
    ]


def test_milliseconds_of_older_firmware(tmp_path: Path) -> None:
    log = Writer()
    log.describe("IMU", "Iffffff", IMU[1].replace("TimeUS,I", "TimeMS"))
    for k in range(60):
        log.write("IMU", 1000 + 20 * k, 0.0, 0.01, 0.0, 0.0, 0.0, -9.81)
    path = tmp_path / "flight.bin"
    path.write_bytes(log.data)
    assert (np.diff(read_flight(path).imu.stamps_ns) == 20_000_000).all()


@pytest.mark.parametrize("size", [1, 3, 201])
def test_damages_are_passed_over_and_counted(tmp_path: Path, size: int) -> None:
    at = LOG.index(b"\xa3\x95", len(LOG) // 2) + 10
    path = tmp_path / "flight.bin"
    path.write_bytes(LOG[:at] + LOG[at + size :] + bytes(400))
    found = read_flight(path)
    assert 2990 < len(found.imu.stamps_ns) < 3001
    assert np.abs(found.imu.specific_force_b).max() < 30.0
    assert any("damaged in 1 places" in note for note in found.notes)


def test_a_log_that_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(LOG[: LOG.index(b"\xa3\x95", len(LOG) // 2) + 10])
    with pytest.raises(LogFormatError, match="within a message"):
        read_flight(path)
    assert 1400 < len(read_flight(path, torn=True).imu.stamps_ns) < 1600


def test_noise_is_refused_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    for seed in range(3):
        path.write_bytes(LOG[:HALF] + np.random.default_rng(seed).bytes(20_000))
        with pytest.raises(LogFormatError) as refused:
            read_flight(path)
        assert "\n" not in str(refused.value)


def test_a_date_that_cannot_be_and_names_that_are_none(tmp_path: Path) -> None:
    log = flight_of(60)
    log.describe("\nIMU", "QI", "TimeUS,A\nB")
    log.write("\nIMU", 1, 2)
    path = tmp_path / "flight.bin"
    path.write_bytes(
        log.data.replace(struct.pack("<IH", 10**8, 2300), struct.pack("<IH", 5, 65535))
    )
    tables = DataFlashTables(path, {"IMU", "?IMU"})
    assert tables.epoch_ns is None
    assert "?IMU" in tables.tables()
    assert tables.columns("?IMU") == []
