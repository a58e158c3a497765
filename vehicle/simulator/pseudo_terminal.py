"""A simulated serial device: a pseudo-terminal with a link to it in the run's folder."""

from __future__ import annotations

import array
import contextlib
import fcntl
import os
import select
import termios
import tty
from pathlib import Path
from typing import Protocol

from quadrotor.errors import StorageError
from vehicle.simulator.serial_faults import Line

BACKLOG = 3400
"""Largest number of unread bytes: 100 `D` frames, 0.4 s, and less than the kernel's 4 kB."""
FORGOTTEN = 1020
"""Number of bytes discarded, oldest first, when the backlog is full: 30 `D` frames."""
_CHUNK = 4096


class ServedPort(Line, Protocol):
    """The simulated end of a line, at a place where the vehicle finds it."""

    @property
    def link(self) -> object:
        """Return the place, for people."""
        ...

    @property
    def dropped(self) -> int:
        """Return the number of bytes that nobody read."""
        ...


class PseudoTerminal:
    """The microcontroller's end of one serial line; a `vehicle_link.serial.port.Port`.

    The device is raw and survives being opened and closed. Without a reader the oldest bytes are
    dropped once more than BACKLOG are waiting; `dropped` counts them.

    Args:
        link: symbolic link to make (or replace) for the device, removed by `close`.

    Raises StorageError when the link cannot be made.
    """

    def __init__(self, link: Path) -> None:
        self.link = link
        self.dropped = 0
        self._waiting = array.array("i", [0])
        self._unplugged = False
        self._open()

    def _open(self) -> None:
        link = self.link
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        os.set_blocking(self._slave, False)
        self._ready = select.poll()
        self._ready.register(self._master, select.POLLIN)
        self.device = os.ttyname(self._slave)
        new = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            link.parent.mkdir(parents=True, exist_ok=True)
            new.symlink_to(self.device)
            new.replace(link)
        except OSError as error:
            self._close_files()
            raise StorageError(
                f"cannot make the serial device's link {link}: {error.strerror}; "
                "choose a folder that can be written, with --folder"
            ) from None

    def unplug(self) -> None:
        """Hang up as if a USB adapter was unplugged; bytes written from now on are lost."""
        self._unplugged = True
        self._remove()

    def plug_in(self) -> None:
        """Create a new device behind the same link. Raises StorageError."""
        self._open()
        self._unplugged = False

    def read(self, most: int = _CHUNK) -> bytes:
        """Return at most `most` of the waiting bytes."""
        if self._unplugged or not self._ready.poll(0):  # usually: a third of a refused read's time
            return b""
        return os.read(self._master, most)

    def write(self, data: bytes) -> None:
        if self._unplugged:
            self.dropped += len(data)
            return
        fcntl.ioctl(self._slave, termios.FIONREAD, self._waiting)
        if self._waiting[0] > BACKLOG:
            self._throw_away()
        try:
            written = os.write(self._master, data)
        except BlockingIOError:
            written = 0
        self.dropped += len(data) - written

    def _throw_away(self) -> None:
        """Read the oldest bytes here, so that the newest stay and the count is exact."""
        with contextlib.suppress(BlockingIOError):  # the vehicle read them first
            self.dropped += len(os.read(self._slave, FORGOTTEN))

    def fileno(self) -> int:
        return self._master

    def close(self) -> None:
        """Hang up and remove the link, unless another simulator has replaced it in the meantime."""
        if not self._unplugged:
            self._remove()

    def _remove(self) -> None:
        try:
            if os.readlink(self.link) == self.device:
                self.link.unlink()
        except FileNotFoundError:
            pass  # the folder was cleared in the meantime: nothing left to remove
        self._close_files()

    def _close_files(self) -> None:
        os.close(self._master)
        os.close(self._slave)
