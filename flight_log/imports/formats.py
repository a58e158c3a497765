"""Formats, recognised by the first bytes of their files."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from flight_log.imports.crazyflie import CrazyflieTables
from flight_log.imports.ros_bags import BagTables
from flight_log.imports.tables import Hdf5Table, NumpyTable, Source, TextTable
from flight_log.imports.ulog import UlogTables
from flight_log.limits import bounded_reader
from quadrotor.errors import LogFormatError, StorageError, os_errors

MAGIC = {
    b"\x89HDF\r\n\x1a\n": "hdf5",
    b"\x93NUMPY": "npy",
    b"ULog\x01\x12\x35": "ulog",
    b"\xbc": "crazyflie",
    b"#ROSBAG V2": "rosbag",
}
TEXT = "csv"


def format_of(path: Path) -> str:
    """Return the format of a file or folder. Raises LogFormatError or StorageError."""
    with os_errors(lambda why: f"cannot read {path}: {why}"):
        if not path.exists():
            raise StorageError(f"{path} is not a file")
        if (path / "metadata.yaml").is_file():
            return "rosbag"
        if path.is_dir():
            raise LogFormatError(f"{path} is a folder; give one file of it")
        with path.open("rb") as file:
            head = file.read(4096)
    if not head:
        raise LogFormatError(f"{path.name} is empty")
    found = next((name for magic, name in MAGIC.items() if head.startswith(magic)), None)
    if found is None and b"\0" in head:
        raise LogFormatError(
            f"{path.name} has an unknown format; "
            f"known are {', '.join(dict.fromkeys([*MAGIC.values(), TEXT]))}"
        )
    return found or TEXT


def open_source(path: Path, wanted: Collection[str]) -> Source:
    """Open a file; if it has many tables, only those `wanted` are read. Raises as `format_of`."""
    match format_of(path):
        case "hdf5":
            return Hdf5Table(path)
        case "npy":
            return NumpyTable(path)
        case "crazyflie":
            return CrazyflieTables(path)
        case "rosbag":
            with bounded_reader(path.name):
                return BagTables(path, wanted)
        case "ulog":
            with bounded_reader(path.name):
                return UlogTables(path, wanted)
        case _:
            return TextTable(path)
