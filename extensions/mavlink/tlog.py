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
from pathlib import Path

import numpy as np
import numpy.typing as npt

from extensions.mavlink.dialect import mavlink
from extensions.mavlink.tlog_messages import (
    ARRIVAL,
    HEAD_2,
    LOGGED,
    TIMES,
    Bytes,
    Kind,
    Messages,
    Places,
    decoded,
)
from flight_log.limits import bounded_reader
from quadrotor.records import Array

AUTOPILOT = 1  # component
PIECE = 1 << 20
"""Bytes that are searched for records at once."""
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
        self._read(np.asarray(np.memmap(path, np.uint8, "r")), names)
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
                scales = {one: (one, force if one.endswith("acc") else rate) for one in IMU_AXES}
                self._imus[IMU + suffix] = source + suffix, {"time_usec": (time, to_us), **scales}
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

    def _read(self, octets: Bytes, names: Collection[str]) -> None:
        """Read the messages of these names, and the names of the others."""
        at = self._records(octets)
        if not len(at):
            return
        # The last packet may have less bytes than the head of the second version.
        magic, length, *rest = (_octets(octets, at + ARRIVAL + k) for k in range(HEAD_2))
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
        clocks, begins, later = [], [], [0]
        for one in read:
            if time := one.kind.time:
                mine = np.flatnonzero(of_vehicle[one.numbers])
                us = one.column(time, mine) * TIMES[time]
                mine, us = mine[us <= DATE], us[us <= DATE]
                clocks.append((one.numbers[mine], one.arrival[mine], us))
        while later:  # each kind may have a clock of its own
            begins.append(min(later))
            later = []
            for packets, _, us in clocks:
                first = int(np.searchsorted(packets, begins[-1]))
                back = us[first:] < np.maximum.accumulate(us[first:]) - RESTART
                if back.any():
                    later.append(int(packets[first + back.argmax()]))
        self._starts = len(begins)
        if self._wanted <= len(begins):
            begin, end = [*begins, len(of_vehicle)][self._wanted - 1 : self._wanted + 1]
            dated = [
                (packets[k], arrival[k] - int(us[k]))
                for packets, arrival, us in clocks
                for k in np.flatnonzero((arrival > FIRST_DATE) & (packets >= begin))[:1]
                if packets[k] < end
            ]
            if dated:
                self.epoch_ns = int(min(dated)[1]) * 1000
        return np.array(begins[1:], np.int64)

    def _records(self, octets: Bytes) -> Places:
        """Return where records begin; pass over what is none."""
        found, due, damages = array("q"), 0, 0
        for begin in range(0, len(octets), PIECE):
            magic = octets[begin + ARRIVAL : begin + ARRIVAL + PIECE]
            at = begin + np.flatnonzero(magic - 0xFD < 2)
            at = at[_begins(octets, at)]
            ends = _ends(octets, at)
            whole = (ends <= len(octets)) & _begins(octets, ends)
            for place, end in zip(at[whole].tolist(), ends[whole].tolist(), strict=True):
                if place >= due:
                    damages += place > due
                    found.append(place)
                    due = end
        if due + ARRIVAL < len(octets):
            rest = np.array([due])
            if _begins(octets, rest)[0] and _ends(octets, rest)[0] > len(octets):
                self.torn = f"it ends within a packet at byte {due}"
            else:
                damages += 1
        if damages:
            self.notes.append(f"{self.path.name}: damaged in {damages} places, which are left out")
        return np.frombuffer(found, np.int64)


def _begins(octets: Bytes, at: Places) -> npt.NDArray[np.bool_]:
    """Return where a record can begin, as a piece of one at the end of the file can."""
    sign, year, month, magic = (_octets(octets, at + k) for k in (0, 1, 2, ARRIVAL))
    is_dated = (year - 4 < 12) | (year | month == 0)  # a computer's clock begins in 1970
    found: npt.NDArray[np.bool_] = (sign == 0) & is_dated & (magic - 0xFD < 2)
    return found | (at + ARRIVAL >= len(octets))


def _ends(octets: Bytes, at: Places) -> Places:
    """Return where the records end that begin at these places."""
    magic, length, flags = (_octets(octets, at + ARRIVAL + k) for k in range(3))
    return at + ARRIVAL + length + np.where(magic == 0xFE, 8, 12 + 13 * (flags & 1))


def _octets(octets: Bytes, at: Places) -> Bytes:
    """Return the bytes at these places, the last one instead of those behind the file."""
    return octets[np.minimum(at, len(octets) - 1)]
