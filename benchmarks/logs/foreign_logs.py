"""A flight as other systems log it, in every format that `quadlab log import` reads."""

from __future__ import annotations

import gzip
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, NamedTuple

import h5py
import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pyarrow import csv, parquet
from scipy.io import savemat
from scipy.spatial.transform import Rotation
from zstandard import ZstdCompressor

from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.blackbox_writer import END, flight_log
from extensions.importers.tests.crazyflie_writer import write_crazyflie
from extensions.importers.tests.foreign_flight import FRD, NED, ForeignFlight, columns_of
from extensions.importers.tests.test_dataflash import IMU, XKF1, Writer
from extensions.importers.tests.ulog_writer import write_ulog
from extensions.mavlink.dialect import mavlink

G = 9.80665
START_US = 300_000_000
"""The vehicle's clock at the first sample; all stamps of some minutes have as many bytes of 7 bits
as this one.
"""


class Format(NamedTuple):
    """A format: what writes a flight to a folder, and the mapping by which it is read."""

    write: Callable[[Path, ForeignFlight], Path]
    mapping: str  # a name, "file" for one of `columns_of`, or empty for the format's own


def _us(flight: ForeignFlight) -> npt.NDArray[np.int64]:
    since: npt.NDArray[np.float64] = np.round((flight.seconds - flight.seconds[0]) * 1e6)
    return since.astype(np.int64) + START_US


def _text(name: str, delimiter: str) -> Callable[[Path, ForeignFlight], Path]:
    def write(folder: Path, flight: ForeignFlight) -> Path:
        table = pa.table(columns_of(flight))
        csv.write_csv(table, folder / name, csv.WriteOptions(delimiter=delimiter))
        return folder / name

    return write


def _packed(
    name: str, plain: Callable[[Path, ForeignFlight], Path], pack: Callable[[IO[bytes]], IO[bytes]]
) -> Callable[[Path, ForeignFlight], Path]:
    def write(folder: Path, flight: ForeignFlight) -> Path:
        inner = folder / "plain"
        inner.mkdir()
        source = plain(inner, flight)
        with source.open("rb") as data, (folder / name).open("wb") as file, pack(file) as packed:
            shutil.copyfileobj(data, packed)
        shutil.rmtree(inner)
        return folder / name

    return write


def _parquet(folder: Path, flight: ForeignFlight) -> Path:
    parquet.write_table(pa.table(columns_of(flight)), folder / "flight.parquet")
    return folder / "flight.parquet"


def _npy(folder: Path, flight: ForeignFlight) -> Path:
    columns = columns_of(flight)
    table = np.stack(list(columns.values()), axis=1)
    np.save(folder / "flight.npy", table.view([(name, "f8") for name in columns])[:, 0])
    return folder / "flight.npy"


def _hdf5(folder: Path, flight: ForeignFlight) -> Path:
    with h5py.File(folder / "flight.hdf5", "w") as file:
        file["ts"] = flight.seconds
        file["gyro_raw"], file["accel_raw"] = flight.rate @ FRD, flight.force @ FRD
        attitude = (flight.rotation * Rotation.from_matrix(FRD)).as_quat()  # x, y, z, w
        file["traj_target"] = np.hstack([flight.position, attitude])
    return folder / "flight.hdf5"


def _mat(folder: Path, flight: ForeignFlight) -> Path:
    savemat(folder / "flight.mat", columns_of(flight))
    return folder / "flight.mat"


def _ulog(folder: Path, flight: ForeignFlight) -> Path:
    kind = [("timestamp", "<u8"), ("gyro_rad", "<f4", 3), ("accelerometer_m_s2", "<f4", 3)]
    rows = np.zeros(len(flight.seconds), kind)
    rows["timestamp"] = _us(flight)
    rows["gyro_rad"] = flight.rate * [1, -1, -1]
    rows["accelerometer_m_s2"] = flight.force * [1, -1, -1]
    # What else PX4 writes at such a rate, and an import passes over.
    other = np.zeros(len(rows), [("timestamp", "<u8"), ("xyz", "<f4", 8)])
    other["timestamp"] = rows["timestamp"]
    topics: dict[str, npt.NDArray[Any]] = {"sensor_combined": rows, "vehicle_rates": other}
    return write_ulog(folder / "flight.ulg", topics)


def _crazyflie(folder: Path, flight: ForeignFlight) -> Path:
    columns = {
        **{f"gyro_{a}": np.degrees(flight.rate[:, k]) for k, a in enumerate("xyz")},
        **{f"acc_{a}": flight.force[:, k] / G for k, a in enumerate("xyz")},
        **{f"stateEstimate_{a}": flight.position[:, k] for k, a in enumerate("xyz")},
    }
    return write_crazyflie(folder / "log00", "fixedFrequency", _us(flight), **columns)


BLOCK = 3200
"""Rows of a blackbox that are encoded; longer ones repeat them with other stamps in I frames."""

OTHERS = 17
"""Further fields of a blackbox: with them a frame has 26 bytes, as in the public logs of Betaflight
3.0 to 3.4 (67 MB, 2.6 million frames).
"""


def _blackbox(folder: Path, flight: ForeignFlight) -> Path:
    us = _us(flight)
    first = min(len(us), BLOCK)
    rate = np.rint(np.degrees(flight.rate[:first])).astype(int)
    force = np.rint(2048 / G * flight.force[:first]).astype(int)
    step = int(us[1] - us[0])
    rows = np.hstack([np.arange(first)[:, None], START_US + step * np.arange(first)[:, None]])
    rows[:, 0] += 1 << 22
    whole = flight_log(np.hstack([rows, rate, force]).tolist(), OTHERS)
    body = whole.index(b"I" + _seven_bits(int(rows[0, 0])))
    frames = whole[body : -len(END)]
    stems = [b"I" + _seven_bits(int(i)) + _seven_bits(int(t)) for i, t in rows[::32]]
    places = np.cumsum([0, *(len(one) for one in _split_at(frames, stems))])[:-1]
    block = np.frombuffer(frames, np.uint8)
    with (folder / "flight.bbl").open("wb") as file:
        file.write(whole[:body])
        for begin in range(0, len(us), first):
            now = block.copy()
            for place, (number, stamp) in zip(places, rows[::32].tolist(), strict=True):
                stem = b"I" + _seven_bits(number + begin) + _seven_bits(stamp + begin * step)
                now[place : place + len(stem)] = np.frombuffer(stem, np.uint8)
            file.write(now.tobytes())
        file.write(END)
    return folder / "flight.bbl"


def _seven_bits(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def _split_at(data: bytes, stems: list[bytes]) -> list[bytes]:
    places = [0]
    for one in stems[1:]:
        places.append(data.index(one, places[-1] + 1))
    return [data[a:b] for a, b in zip(places, [*places[1:], len(data)], strict=True)]


def _dataflash(folder: Path, flight: ForeignFlight) -> Path:
    log = Writer()
    log.describe("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    log.describe("IMU", *IMU)
    log.describe("XKF1", *XKF1)
    log.write("FMTU", 0, log.number("IMU"), b"s#EEEooo", b"F-000000")
    frd = Rotation.from_matrix(NED) * flight.rotation * Rotation.from_matrix(FRD)
    angles = np.degrees(frd.as_euler("ZYX"))
    angles[:, 0] %= 360.0
    head = [("head", "V3"), ("t", "<u8"), ("i", "u1")]
    imu = np.dtype([*head, ("v", "<f4", 6)])
    pose = np.dtype([*head, ("a", "<i2", 3), ("v", "<f4", 7)])
    rows = np.zeros(len(flight.seconds), [("one", imu), ("two", imu), ("pose", pose)])
    for number, (name, kind) in enumerate((("one", "IMU"), ("two", "IMU"), ("pose", "XKF1"))):
        rows[name]["head"] = np.frombuffer(b"\xa3\x95" + bytes([log.number(kind)]), "V3")[0]
        rows[name]["t"], rows[name]["i"] = _us(flight), number % 2
    values = np.hstack([flight.rate @ FRD, flight.force @ FRD])
    rows["one"]["v"], rows["two"]["v"] = values, 2.0 * values
    rows["pose"]["a"] = np.rint(100.0 * angles[:, ::-1]).astype(int).astype(np.uint16).view("<i2")
    rows["pose"]["v"][:, [0, 1, 2]] = flight.velocity @ NED.T
    rows["pose"]["v"][:, [4, 5, 6]] = flight.position @ NED.T
    (folder / "flight.bin").write_bytes(log.data + rows.tobytes())
    return folder / "flight.bin"


def _tlog(folder: Path, flight: ForeignFlight) -> Path:
    sender: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    arrival = round(flight.seconds[0] * 1e6) - START_US
    rates, forces = flight.rate @ FRD, flight.force @ FRD
    frd = Rotation.from_matrix(NED) * flight.rotation * Rotation.from_matrix(FRD)
    angles = frd.as_euler("ZYX")[:, ::-1].tolist()
    places = np.hstack([flight.position @ NED.T, flight.velocity @ NED.T]).tolist()
    with (folder / "flight.tlog").open("wb") as file:
        for k, us in enumerate(_us(flight).tolist()):
            sample = (*forces[k], *rates[k], 0.0, 0.0, 0.0, 990.0, 0.0, 100.0, 30.0, 0xFFFF)
            for message in (
                mavlink.MAVLink_highres_imu_message(us, *sample),
                mavlink.MAVLink_attitude_message(us // 1000, *angles[k], 0.0, 0.0, 0.0),
                mavlink.MAVLink_local_position_ned_message(us // 1000, *places[k]),
            ):
                file.write(struct.pack(">Q", arrival + us) + bytes(message.pack(sender)))
    return folder / "flight.tlog"


def _rosbag(folder: Path, flight: ForeignFlight) -> Path:
    return write_bag(folder / "flight.bag", flight, 1)


def _bag_folder(folder: Path, flight: ForeignFlight) -> Path:
    return write_bag(folder / "flight", flight, 2)


def _mcap(folder: Path, flight: ForeignFlight) -> Path:
    [found] = write_bag(folder / "bag", flight, 2, mcap=True).glob("*.mcap")
    return found.rename(folder / "flight.mcap")


def _gzip(file: IO[bytes]) -> Any:
    return gzip.GzipFile(fileobj=file, mode="wb", compresslevel=1)


def _zstd(file: IO[bytes]) -> Any:
    return ZstdCompressor().stream_writer(file, closefd=False)


_csv = _text("flight.csv", ",")
FORMATS = {
    "csv": Format(_csv, "file"),
    "tsv": Format(_text("flight.tsv", "\t"), "file"),
    "csv.gz": Format(_packed("flight.csv.gz", _csv, _gzip), "file"),
    "csv.zst": Format(_packed("flight.csv.zst", _csv, _zstd), "file"),
    "parquet": Format(_parquet, "file"),
    "npy": Format(_npy, "file"),
    "mat": Format(_mat, "file"),
    "hdf5": Format(_hdf5, "blackbird"),
    "ulog": Format(_ulog, ""),
    "crazyflie": Format(_crazyflie, ""),
    "blackbox": Format(_blackbox, ""),
    "dataflash": Format(_dataflash, ""),
    "tlog": Format(_tlog, ""),
    "rosbag": Format(_rosbag, ""),
    "bag of ROS 2": Format(_bag_folder, ""),
    "mcap": Format(_mcap, ""),
    "mcap.zst": Format(_packed("flight.mcap.zstd", _mcap, _zstd), ""),
}
