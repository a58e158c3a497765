"""Telemetry logs (`.tlog`) of QGroundControl, Mission Planner and MAVProxy.

Each record is the time of its arrival, µs since 1970 (big-endian), and a packet. There is a table
for each message of the first vehicle, its instance K as NAME#K; of vehicle S, where there are
several, as S/NAME. After each restart of the vehicle new tables begin, NAME@2, NAME@3, …

The table IMU is made of HIGHRES_IMU, SCALED_IMU or RAW_IMU, the first one of these that the vehicle
sent, in m/s² and rad/s, with `time_usec`. Messages that overtook others are put in order.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Collection, Iterable
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
import numpy.typing as npt

from extensions.mavlink.dialect import mavlink
from extensions.mavlink.tlog_messages import (
    ARRIVAL,
    HEAD_2,
    LOGGED,
    TIMES,
    Kind,
    Messages,
    Places,
    decoded,
)
from flight_log.limits import bounded_reader
from quadrotor.records import Array

AUTOPILOT = 1  # component
MILLI = 1e-3
GRAVITY = 9.80665
RESTART = 10_000_000
"""us by which the vehicle's clock goes back at least when it was started anew."""
DATE = 1e15  # us; a larger `time_usec` is a date, not the time since the start
FIRST_DATE = 1 << 50  # us; September 2005, before which no clock of a computer is set
IMU = "IMU"
IMU_AXES = ["xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"]
SOURCES_OF_IMU = {
    "HIGHRES_IMU": ("time_usec", 1.0, 1.0, 1.0),
    "SCALED_IMU": ("time_boot_ms", 1000.0, MILLI * GRAVITY, MILLI),
    "RAW_IMU": ("time_usec", 1.0, MILLI * GRAVITY, MILLI),  # as ArduPilot fills it
}
"""Column of time, and factors to µs, m/s² and rad/s."""


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
        self._rows: dict[str, Messages] = {}
        self._imus: dict[str, tuple[str, dict[str, tuple[str, float]]]] = {}  # source, its scales
        self._starts = 1
        starts = (one.partition("@")[2] for one in wanted)
        self._wanted = max((int(one) for one in starts if one.isdecimal()), default=1)
        with path.open("rb") as file:
            data = mmap(file.fileno(), 0, access=ACCESS_READ)
        self._read(data, names)
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
        source, made = self._imus.get(table, (table, {}))
        found = np.empty((len(self._rows[source].numbers), len(names)))
        for k, name in enumerate(names):
            column, scale = made.get(name, (name, 1.0))
            found[:, k] = scale * self._rows[source].column(column)
        return found

    def remainders(self, table: str, name: str) -> None:
        """Return nothing: its integers fit into float64."""

    def _add_imu(self, suffix: str) -> None:
        for source, (time, to_us, force, rate) in SOURCES_OF_IMU.items():
            if source + suffix in self._rows:
                self._columns[IMU + suffix] = ["time_usec", *IMU_AXES]
                self._imus[IMU + suffix] = (
                    source + suffix,
                    {
                        "time_usec": (time, to_us),
                        **{one: (one, force if one.endswith("acc") else rate) for one in IMU_AXES},
                    },
                )
                break

    def _put_in_order(self) -> None:
        late = 0
        for name, rows in self._rows.items():
            if rows.kind.time is not None:
                times = rows.column(rows.kind.time)
                if overtaken := int((np.diff(times) < 0.0).sum()):
                    late += overtaken
                    self._rows[name] = rows.chosen(np.argsort(times, kind="stable"))
        if late:
            self.notes.append(
                f"{self.path.name}: {late} messages arrived after later ones: put in order"
            )

    def _read(self, data: mmap, names: Collection[str]) -> None:
        """Read the messages of these names, and the names of the others."""
        at = self._records(data)
        if not len(at):
            return
        octets = np.frombuffer(data, np.uint8)
        # The last packet may have less bytes than the head of the second version.
        magic, length, *rest = (
            octets[np.minimum(at + ARRIVAL + k, len(octets) - 1)] for k in range(HEAD_2)
        )
        is_1 = magic == 0xFE
        number = np.where(is_1, rest[3], rest[5] + 256 * (rest[6] + 256 * rest[7].astype(np.int32)))
        system, component = np.where(is_1, rest[1:3], rest[3:5])
        heads = length + (magic.astype(np.uint16) << 8)
        described = {one: mavlink.mavlink_map.get(one) for one in np.unique(number).tolist()}
        known = np.isin(number, [one for one, found in described.items() if found])
        pilots = np.flatnonzero(known & (component == AUTOPILOT))
        vehicle = int(system[pilots[0]]) if len(pilots) else -1
        read, wrong = [], 0
        for one, told in described.items():
            if told is None:
                continue
            chosen = np.flatnonzero(number == one)
            if told.msgname in names:
                read.append(decoded(Kind.of(told), octets, at, chosen, heads))
                wrong += len(chosen) - len(read[-1].numbers)
            elif (system[chosen] == vehicle).any():
                self._columns.setdefault(str(told.msgname), [])
        if wrong:
            self.notes.append(f"{self.path.name}: {wrong} packets with a wrong checksum left out")
        restarts = self._restarts(read, system == vehicle)
        while read:  # so that only those of one kind are held twice
            messages = read.pop()
            self._keep(messages, system[messages.numbers], vehicle, restarts)

    def _keep(
        self, messages: Messages, system: npt.NDArray[np.uint8], vehicle: int, restarts: Places
    ) -> None:
        """Put messages into their tables: of each vehicle, instance and start."""
        kind = messages.kind
        instance = messages.column(kind.instance) if kind.instance else np.zeros(len(system))
        start = 1 + np.searchsorted(restarts, messages.numbers, side="right")
        start[system != vehicle] = 1
        keys = system + 256 * (instance.astype(np.int64) + (start << 32))
        for key in np.unique(keys).tolist():
            of, number, begun = key % 256, (key >> 8) % 2**32, key >> 40
            name = f"{kind.name}#{number}" if number else kind.name
            name = f"{of}/{name}" if of != vehicle else name + f"@{begun}" * (begun > 1)
            self._columns[name] = [*kind.fields, LOGGED]
            alike = keys == key
            self._rows[name] = messages if alike.all() else messages.chosen(alike)

    def _restarts(self, read: Iterable[Messages], of_vehicle: npt.NDArray[np.bool_]) -> Places:
        """Return the packets with which the vehicle's clock begins anew; note the date."""
        timed = [
            (one.numbers, one.arrival, one.column(one.kind.time) * TIMES[one.kind.time])
            for one in read
            if one.kind.time
        ]
        if not timed:
            return np.zeros(0, np.int64)
        packets, arrival, us = (np.concatenate(parts) for parts in zip(*timed, strict=True))
        order = np.argsort(packets)
        order = order[of_vehicle[packets[order]] & (us[order] <= DATE)]
        packets, arrival, us = packets[order], arrival[order], us[order]
        begins, first = [], 0
        while first < len(us):
            begins.append(first)
            latest = np.maximum.accumulate(us[first:])
            back = np.flatnonzero(us[first:] < latest - RESTART)
            first = first + int(back[0]) if len(back) else len(us)
        self._starts = max(1, len(begins))
        if self._wanted <= len(begins):
            k, end = [*begins, len(us)][self._wanted - 1 : self._wanted + 1]
            if len(dated := np.flatnonzero(arrival[k:end] > FIRST_DATE)):
                k += int(dated[0])
                self.epoch_ns = (int(arrival[k]) - int(us[k])) * 1000
        found: Places = packets[begins[1:]]
        return found

    def _records(self, data: mmap) -> Places:
        """Return where records begin; pass over what is none."""
        found = array("q")
        at, damages, searches, begins = 0, 0, False, _begins(data, 0)
        while at + ARRIVAL < len(data):
            start = at + ARRIVAL
            end = start + _size(data, start)
            if begins and start < end <= len(data) and _begins(data, end):
                searches = False
                found.append(at)
                at = end
            elif not searches and end > len(data):
                self.torn = f"it ends within a packet at byte {at}"
                break
            else:
                damages += not searches
                searches, at = True, at + 1
                begins = _begins(data, at)
        if damages:
            self.notes.append(f"{self.path.name}: damaged in {damages} places, which are left out")
        return np.frombuffer(found, np.int64)


def _begins(data: mmap, at: int) -> bool:
    """Return whether a record can begin here; a piece of one at the end of the file can."""
    if at + ARRIVAL >= len(data):
        return True
    is_dated = 4 <= data[at + 1] <= 15
    return (
        data[at] == 0
        and (is_dated or data[at + 1] == data[at + 2] == 0)  # a computer's clock begins in 1970
        and data[at + ARRIVAL] in (0xFE, 0xFD)
    )


def _size(data: mmap, start: int) -> int:
    """Return the size of the packet that begins here; 0 if none does."""
    if data[start] == 0xFE and start + 1 < len(data):
        return 8 + data[start + 1]
    if data[start] == 0xFD and start + 2 < len(data):
        return 12 + data[start + 1] + (13 if data[start + 2] & 1 else 0)
    return 0
