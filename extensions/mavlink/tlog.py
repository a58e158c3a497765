"""Telemetry logs (`.tlog`) of QGroundControl, Mission Planner and MAVProxy.

Each record is the time of its arrival, µs since 1970 (big-endian), and a packet. There is a table
for each message of the first vehicle, its instance K as NAME#K; of vehicle S, where there are
several, as S/NAME. After each restart of the vehicle new tables begin, NAME@2, NAME@3, …

The table IMU is made of HIGHRES_IMU, SCALED_IMU or RAW_IMU, the first one of these that the vehicle
sent, in m/s² and rad/s, with `time_usec`. Messages that overtook others are put in order.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from extensions.mavlink.dialect import mavlink
from flight_log.limits import bounded_reader
from quadrotor.records import Array

ARRIVAL = 8  # bytes
LOGGED = "logged"
"""The column of arrival, s."""
HEAD_1, HEAD_2 = 6, 10  # bytes before the payload of both versions
AUTOPILOT = 1  # component
MILLI = 1e-3
GRAVITY = 9.80665
RESTART = 10_000_000
"""us by which the vehicle's clock goes back at least when it was started anew."""
TIMES = {"time_boot_ms": 1000.0, "time_usec": 1.0}
"""Columns of the vehicle's clock, and their factors to us."""
DATE = 1e15  # us; a larger `time_usec` is a date, not the time since the start
IMU = "IMU"
IMU_AXES = ["xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"]
SOURCES_OF_IMU = {
    "HIGHRES_IMU": ("time_usec", 1.0, 1.0, 1.0),
    "SCALED_IMU": ("time_boot_ms", 1000.0, MILLI * GRAVITY, MILLI),
    "RAW_IMU": ("time_usec", 1.0, MILLI * GRAVITY, MILLI),  # as ArduPilot fills it
}
"""Column of time, and factors to µs, m/s² and rad/s."""


class Kind(NamedTuple):
    """A kind of messages, of which the numbers are decoded, without arrays and texts."""

    name: str
    layout: struct.Struct
    checksum: int  # that of its description
    names: list[str]  # of the fields that are numbers
    places: list[int]  # of these in `layout`
    instance: int | None  # which of `names` tells instances apart
    time: int | None  # which of them is the vehicle's clock
    to_us: float  # its factor

    @classmethod
    def of(cls, described: Any) -> Kind:
        """Return the decoding of a kind that pymavlink describes."""
        layout, lengths = described.unpacker, described.lengths
        sample = layout.unpack(bytes(layout.size))
        found = {}
        for name, order in zip(described.fieldnames, described.orders, strict=True):
            place = sum(lengths[:order])
            if lengths[order] == 1 and isinstance(sample[place], int | float):
                found[name] = place
        names = list(found)
        time = next((one for one in TIMES if one in found), None)
        instance = described.instance_field
        return cls(
            str(described.msgname),
            layout,
            checksum=described.crc_extra,
            names=names,
            places=list(found.values()),
            instance=names.index(instance) if instance in found else None,
            time=None if time is None else names.index(time),
            to_us=TIMES.get(time or "", 1.0),
        )

    def values(self, packet: bytes) -> list[float] | None:
        """Return the numbers of a packet in the order of `names`, None if its checksum is wrong."""
        begin = HEAD_1 if packet[0] == 0xFE else HEAD_2
        end = begin + packet[1]
        checked = mavlink.x25crc(packet[1:end] + bytes([self.checksum])).crc
        if checked != int.from_bytes(packet[end : end + 2], "little"):
            return None
        size = self.layout.size
        # Zeros at the end of a packet are not sent.
        found = self.layout.unpack(packet[begin:end][:size].ljust(size, b"\0"))
        return [found[place] for place in self.places]


class TlogTables:
    """The messages `wanted` that the log has."""

    @classmethod
    def opened(cls, path: Path, wanted: Collection[str]) -> TlogTables:
        """Read the log, in bounded memory. Raises LogFormatError."""
        with bounded_reader(path.name):
            return cls(path, wanted)

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self.path = path
        self.epoch_ns: int | None = None
        self.torn = ""
        self.events: list[tuple[float, int, str]] = []
        self.units = {"time_boot_ms": "ms", "time_usec": "us", LOGGED: "s"}
        self.notes: list[str] = []
        self.flights: list[str] = []
        self.unreadable: dict[str, str] = {}
        names = {re.sub(r"^\d+/|[#@].*", "", one) for one in wanted} | {"SYSTEM_TIME"}
        if IMU in names:
            names |= SOURCES_OF_IMU.keys()
        self._columns: dict[str, list[str]] = {}
        self._numbers: dict[str, array[float]] = {}
        self._rows: dict[str, Array] = {}
        self._vehicle: int | None = None
        self._starts = 1
        starts = (one.partition("@")[2] for one in wanted)
        self._wanted = max((int(one) for one in starts if one.isdecimal()), default=1)
        self._latest = 0.0
        self._read(path.read_bytes(), names)
        self._put_in_order()
        for start in range(1, self._starts + 1):
            self._add_imu(f"@{start}" if start > 1 else "")
        if self._starts > 1:
            self.flights = [IMU, *(f"{IMU}@{k}" for k in range(2, self._starts + 1))]
            self.notes.append(
                f"{path.name}: the vehicle was started {self._starts} times; tables of the second "
                "start and later ones are called NAME@2, …: --table IMU@2 imports these, "
                "--flight all each as a run"
            )

    def tables(self) -> list[str]:
        return list(self._columns)

    def columns(self, table: str) -> list[str]:
        return self._columns[table]

    def read(self, table: str, names: list[str]) -> Array:
        return self._table(table, names)

    def remainders(self, table: str, name: str) -> None:
        """Return nothing: its integers fit into float64."""

    def _add_imu(self, suffix: str) -> None:
        for source, (time, to_us, force, rate) in SOURCES_OF_IMU.items():
            if source + suffix in self._rows:
                found = self._table(source + suffix, [time, *IMU_AXES])
                found *= [to_us, *[force] * 3, *[rate] * 3]
                self._columns[IMU + suffix] = ["time_usec", *IMU_AXES]
                self._rows[IMU + suffix] = found
                break

    def _put_in_order(self) -> None:
        late = 0
        for name, numbers in self._numbers.items():
            rows = np.frombuffer(numbers).reshape(-1, len(self._columns[name]))
            time = next((one for one in TIMES if one in self._columns[name]), None)
            if time is not None:
                times = rows[:, self._columns[name].index(time)]
                if overtaken := int((np.diff(times) < 0.0).sum()):
                    late += overtaken
                    rows = rows[np.argsort(times, kind="stable")]
            self._rows[name] = rows
        if late:
            self.notes.append(
                f"{self.path.name}: {late} messages arrived after later ones: put in order"
            )

    def _table(self, table: str, names: list[str]) -> Array:
        places = [self._columns[table].index(one) for one in names]
        found: Array = self._rows[table][:, places]
        return found

    def _read(self, data: bytes, names: Collection[str]) -> None:
        """Read the messages of these names, and the names of the others."""
        kinds: dict[int, Kind] = {}
        wrong = 0
        for arrival, packet in self._packets(data):
            number = _number(packet)
            described = mavlink.mavlink_map.get(number)
            if described is None:
                continue
            system, component = packet[3:5] if packet[0] == 0xFE else packet[5:7]
            if self._vehicle is None and component == AUTOPILOT:
                self._vehicle = system
            name = str(described.msgname)
            if name not in names:
                if system == self._vehicle:
                    self._columns.setdefault(name, [])
                continue
            kind = kinds.get(number) or kinds.setdefault(number, Kind.of(described))
            values = kind.values(packet)
            if values is None:
                wrong += 1
            else:
                self._keep(kind, values, arrival, system)
        if wrong:
            self.notes.append(f"{self.path.name}: {wrong} packets with a wrong checksum left out")

    def _keep(self, kind: Kind, values: list[float], arrival: int, system: int) -> None:
        """Add the numbers of a message to its table."""
        instance = values[kind.instance] if kind.instance is not None else 0
        name = f"{kind.name}#{instance}" if instance else kind.name
        if system != self._vehicle:
            name = f"{system}/{name}"
        else:
            self._note_time(kind, values, arrival)
            name += f"@{self._starts}" if self._starts > 1 else ""
        if not self._columns.get(name):
            self._columns[name] = [*kind.names, LOGGED]
        if name not in self._numbers:
            self._numbers[name] = array("d")
        self._numbers[name].extend((*values, 1e-6 * arrival))

    def _note_time(self, kind: Kind, values: list[float], arrival: int) -> None:
        """Note the date, and a restart of the vehicle, by the time in a message."""
        if kind.time is None or (time := values[kind.time] * kind.to_us) > DATE:
            return
        if time < self._latest - RESTART:
            self._starts += 1
            self._latest = 0.0
        if self.epoch_ns is None and self._starts == self._wanted:
            self.epoch_ns = (arrival - int(time)) * 1000
        self._latest = max(self._latest, time)

    def _packets(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield times of arrival in us, and packets; pass over what is none."""
        at, damages, searches = 0, 0, False
        while at + ARRIVAL < len(data):
            start = at + ARRIVAL
            end = start + _size(data, start)
            if start < end <= len(data) and _begins(data, at) and _begins(data, end):
                searches = False
                yield int.from_bytes(data[at:start], "big"), data[start:end]
                at = end
            elif not searches and end > len(data):
                self.torn = f"it ends within a packet at byte {at}"
                break
            else:
                damages += not searches
                searches, at = True, at + 1
        if damages:
            self.notes.append(f"{self.path.name}: damaged in {damages} places, which are left out")


def _begins(data: bytes, at: int) -> bool:
    """Return whether a record can begin here; a piece of one at the end of the file can."""
    if at + ARRIVAL >= len(data):
        return True
    return data[at] == 0 and 4 <= data[at + 1] <= 15 and data[at + ARRIVAL] in (0xFE, 0xFD)


def _size(data: bytes, start: int) -> int:
    """Return the size of the packet that begins here; 0 if none does."""
    if data[start] == 0xFE and start + 1 < len(data):
        return 8 + data[start + 1]
    if data[start] == 0xFD and start + 2 < len(data):
        return 12 + data[start + 1] + (13 if data[start + 2] & 1 else 0)
    return 0


def _number(packet: bytes) -> int:
    return packet[5] if packet[0] == 0xFE else int.from_bytes(packet[7:10], "little")
