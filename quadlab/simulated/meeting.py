"""The meetings of several simulated vehicles: each leaves a row, and then reads those of all.

The vehicles of a process take turns; the processes share memory and wait for each other. All meet
at the same instants, so what a vehicle knows of another depends on the instant alone, and not on
which process was faster.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]

_COUNTERS = struct.Struct("<3q")  # processes that meet, those that wait, meetings so far
_ROW = struct.Struct("<q12dH")
MAIL_MAX = 1024
"""Largest number of bytes that a vehicle broadcasts at one meeting."""
_SIZE = _ROW.size + MAIL_MAX


class Row(NamedTuple):
    """Facts that the others learn of a vehicle at a meeting; the motion is the true one.

    Attributes:
        thrust: N, of its rotors together. radius: m, of a sphere around its rotors.
        mail: what it broadcasts.
    """

    stamp_ns: int
    position_w: Triple
    velocity_w: Triple
    quaternion_wb: Quadruple
    thrust: float
    radius: float
    mail: bytes


class Meeting:
    """The meetings, as the process of some of the vehicles takes part in them.

    Args:
        files: of `new_files`, the same in each process.
        count: of all vehicles.
        own: indices, from 0, of the vehicles of this process.

    Attributes:
        rows: of all vehicles at the last meeting.
    """

    def __init__(self, files: Sequence[int], count: int, own: Sequence[int]) -> None:
        memory, self._mutex, *self._gates = files
        self._memory = mmap.mmap(memory, 2 * count * _SIZE + _COUNTERS.size)
        self._count, self._own = count, own
        self._others = [k for k in range(count) if k not in own]
        here = (0.0, 0.0, 0.0)
        self._left: dict[int, Row] = {}
        self.rows = [Row(0, here, here, (1.0, *here), 0.0, 0.0, mail=b"") for _ in range(count)]

    @staticmethod
    def new_files(count: int, processes: int) -> tuple[int, ...]:
        """Return new file descriptors: the memory, a mutex, and two gates that open in turn."""
        memory = os.memfd_create("quadlab-vehicles")
        os.ftruncate(memory, 2 * count * _SIZE + _COUNTERS.size)
        os.pwrite(memory, _COUNTERS.pack(processes, 0, 0), 0)
        flags = os.EFD_SEMAPHORE | os.EFD_CLOEXEC
        files = memory, os.eventfd(1, flags), os.eventfd(0, flags), os.eventfd(0, flags)
        for file in files:
            os.set_inheritable(file, True)
        return files

    def leave_row(self, index: int, row: Row) -> None:
        """Leave the row of a vehicle of this process, which all see from the next meeting on."""
        self._left[index] = row

    def meet(self) -> None:
        """Leave the rows of this process, wait until all have left theirs, and read them."""
        for k, row in self._left.items():
            self.rows[k] = row
        if not self._others:
            return
        with self._counters() as (parties, waiting, meetings):
            half = meetings % 2
            self._write(half)
            is_last = waiting + 1 == parties
            if is_last:
                self._open(waiting, meetings)
            else:
                _COUNTERS.pack_into(self._memory, 0, parties, waiting + 1, meetings)
        if not is_last:
            os.eventfd_read(self._gates[half])
        for k in self._others:
            self.rows[k] = self._read(k, half)

    def leave(self) -> None:
        """Meet once more, and never again: these vehicles stay in their places for the others."""
        if not self._others:
            return
        self.meet()
        with self._counters() as (parties, waiting, meetings):
            self._write(meetings % 2)  # the other half has the rows from the meeting above
            _COUNTERS.pack_into(self._memory, 0, parties - 1, waiting, meetings)
            if waiting and waiting == parties - 1:
                self._open(waiting, meetings)

    @contextmanager
    def _counters(self) -> Iterator[tuple[int, int, int]]:
        os.eventfd_read(self._mutex)
        try:
            yield _COUNTERS.unpack_from(self._memory, 0)
        finally:
            os.eventfd_write(self._mutex, 1)

    def _open(self, waiting: int, meetings: int) -> None:
        parties = _COUNTERS.unpack_from(self._memory, 0)[0]
        _COUNTERS.pack_into(self._memory, 0, parties, 0, meetings + 1)
        if waiting:
            os.eventfd_write(self._gates[meetings % 2], waiting)

    def _write(self, half: int) -> None:
        for k in self._own:
            row, at = self.rows[k], self._at(k, half)
            motion = (*row.position_w, *row.velocity_w, *row.quaternion_wb)
            numbers = (*motion, row.thrust, row.radius, len(row.mail))
            _ROW.pack_into(self._memory, at, row.stamp_ns, *numbers)
            at += _ROW.size
            self._memory[at : at + len(row.mail)] = row.mail

    def _read(self, k: int, half: int) -> Row:
        at = self._at(k, half)
        found = _ROW.unpack_from(self._memory, at)
        at += _ROW.size
        mail = self._memory[at : at + found[13]]
        return Row(found[0], found[1:4], found[4:7], found[7:11], found[11], found[12], mail=mail)

    def _at(self, k: int, half: int) -> int:
        return _COUNTERS.size + (half * self._count + k) * _SIZE
